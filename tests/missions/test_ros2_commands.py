"""`mission ros2` and `mission ros2 place` on a simulated TurtleBot 4; missions in which it drives by Nav2."""

import base64
import json
from collections.abc import Callable, Iterator
from math import nan, pi
from pathlib import Path
from signal import SIGTERM
from types import SimpleNamespace

import pytest

from drivers.clock import SystemClock
from drivers.ros2.types import types
from drivers.ros2.virtual import free_address
from drivers.ros2.wire import parse_entity
from missions.assembly.simulation import Simulation
from missions.library.drivers import load_robot
from missions.plugins.ros2.place import FrameTree, compose
from tests.missions.command import Outcome, Process, command

Mission = Callable[..., Outcome]

ROOT = Path(__file__).parents[2]

STRAIGHT = """mission: straight
tree:
  sequence:
    - navigate: kitchen
    - go_to: {x: 0.2 m, y: 0 m}
"""


WAVING = """robot: waving
ros2: {router: ROUTER}
base: {driver: ros2, battery: battery_state, hazards: hazard_detection}
head: {driver: ros2, speed: 120 deg/s, acceleration: 400 deg/s^2, pan: {joint: pan}, tilt: {joint: tilt}}
camera: {driver: ros2, width: 320, height: 240, field_of_view: 60 deg, position: [0.05 m, 0 m, 1.1 m]}
voice: {driver: print}
arm:
  driver: ros2
  joints:
"""
WAVING += "".join(
    f"    {joint}: {{speed: 150 deg/s}}\n"
    for joint in ("shoulder_lift", "shoulder_pan", "elbow", "upper_roll", "wrist_bend", "gripper")
)


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    Path("straight.yaml").write_text(STRAIGHT)
    return lambda *arguments: command(capsys, *arguments)


@pytest.fixture
def router() -> Iterator[str]:
    config = load_robot(ROOT / "config/robots/turtlebot4.yaml")
    simulation = Simulation(config, frozenset({"ros2", "base", "range"}), SystemClock())
    simulation.open()
    yield simulation.ports["ros2"]
    simulation.close()


@pytest.mark.real_time
def test_topics_nodes_messages_and_places_of_a_robot_are_shown_without_ros(mission: Mission, router: str) -> None:
    at = ("--router", router)
    told = mission("ros2", "topics", *at)
    assert told.code == 0
    assert "/cmd_vel  geometry_msgs/msg/Twist  (1 subscribes)\n" in told.out
    assert "send_goal" not in told.out
    assert "  serves     /navigate_to_pose/_action/send_goal" in mission("ros2", "graph", *at).out
    first = mission("ros2", "echo", "/odom", "--seconds", "0.3", *at).out.splitlines()[0]
    assert json.loads(first)["child_frame_id"] == "base_link"
    unknown = mission("ros2", "echo", "/nobody", *at)
    assert (unknown.code, "no publisher of /nobody" in unknown.err) == (3, True)
    assert mission("ros2", "place", "add", "kitchen", *at).out.startswith("kitchen: 0.00 m, 0.00 m, 0 deg")


@pytest.mark.real_time
def test_greet_runs_on_a_robot_simulated_by_another_ros2_process(mission: Mission) -> None:
    router = free_address()
    Path("waving.yaml").write_text(WAVING.replace("ROUTER", router))
    beside = Process(
        "simulate", "--ros2", router, "--robot", "waving.yaml", "--world", "living_room", folder=Path.cwd()
    )
    beside.wait_for_line(lambda line: router in line)
    told = mission("run", "greet", "--robot", "waving.yaml", "--no-record")
    assert told.code == 0, told.err
    assert "robot: Hello!" in told.out + told.err
    assert beside.end(SIGTERM) == 0


@pytest.mark.real_time
def test_dock_uses_the_robots_ros2_action(
    mission: Mission,
) -> None:
    dock = ("run", "dock", "--robot", "turtlebot4", "--simulate", "wire", "--no-record", "--world")
    docked = mission(*dock, "square_arena")
    assert (docked.code, "info: The battery holds" in docked.out) == (0, True)
    rejected = mission(*dock, "empty")
    assert (rejected.code, "/dock: the goal was rejected" in rejected.out) == (1, True)
    ended = mission(*dock, "square_arena", "--param", "patience=1 s")
    assert (ended.code, "timed out after 1 s" in ended.out) == (1, True)


@pytest.mark.real_time
def test_a_capture_holds_tokens_and_messages_and_no_name_of_a_session(mission: Mission, router: str) -> None:
    assert mission("ros2", "capture", "robot.jsonl", "--seconds", "0.5", "--router", router).code == 0
    lines = [json.loads(line) for line in Path("robot.jsonl").read_text().splitlines()]
    tokens = [parse_entity(line["token"]) for line in lines if "token" in line]
    assert {each.zid for each in tokens if each is not None} == {f"{1:032x}"}
    heard = [line for line in lines if "payload" in line]
    assert {"/odom", "/scan", "/tf"} <= {line["topic"] for line in heard}
    for line in heard:
        types().decode(line["type"], base64.b64decode(line["payload"]))


def test_places_are_stored_by_name_and_navigated_to(mission: Mission) -> None:
    refused = mission("run", "straight.yaml", "--robot", "turtlebot4", "--simulate", "fast")
    assert refused.code == 1
    assert "unknown place 'kitchen'; places: none" in refused.out
    assert mission("ros2", "place", "add", "kitchen", "--at", "0.5 m, 0.4 m, 90 deg").code == 0
    assert mission("ros2", "place", "list").out == 'places:\n  "kitchen": {x: 0.500 m, y: 0.400 m, heading: 90.0 deg}\n'
    assert mission("run", "straight.yaml", "--robot", "turtlebot4", "--simulate", "fast").code == 0
    assert mission("ros2", "place", "remove", "kitchen").out.startswith("kitchen: removed  (")
    assert "no places yet" in mission("ros2", "place", "list").out
    wrong = mission("ros2", "place", "add", "cellar", "--at", "here")
    assert (wrong.code, "give x, y and heading" in wrong.err) == (2, True)


def test_a_place_behind_a_wall_is_given_up_with_nav2s_reason(mission: Mission) -> None:
    mission("ros2", "place", "add", "kitchen", "--at", "50 m, 0 m, 0 deg")
    told = mission("run", "straight.yaml", "--robot", "turtlebot4", "--simulate", "fast", "--world", "square_arena")
    assert told.code == 1
    assert "navigate_to_pose: no progress (error 105)" in told.out


def test_ros2_commands_refuse_a_robot_without_ros2(mission: Mission) -> None:
    told = mission("ros2", "topics", "--robot", "turtlebot2")
    assert (told.code, "has no ros2 section" in told.err) == (2, True)
    told = mission("simulate", "--ros2", "tcp/127.0.0.1:1", "--robot", "turtlebot2")
    assert (told.code, "is not a ROS 2 robot" in told.err) == (2, True)


def test_a_pose_on_the_map_is_put_together_of_two_frames() -> None:
    assert compose((1.0, 2.0, pi / 2), (3.0, 0.0, 0.5)) == pytest.approx((1.0, 5.0, pi / 2 + 0.5))


def test_map_pose_is_composed_along_the_frame_tree() -> None:
    turned = SimpleNamespace(x=0.0, y=0.0, z=2.0, w=2.0)  # a quarter, of another length
    odom = ("tb4/map", "tb4/odom", (1.0, 2.0), turned)
    foot = ("tb4/odom", "tb4/base_footprint", (3.0, 0.0), turned)
    for chain in (
        [odom, foot, ("tb4/base_footprint", "tb4/base_link", (0.0, 0.0), turned)],
        [odom, foot],
        [odom, ("tb4/odom", "tb4/base_link", (3.0, 0.0), turned)],
        [("/map", "/base_link", (1.0, 5.0), turned)],
    ):  # fmt: skip
        frames = FrameTree("/tb4")
        assert frames.body_pose() is None
        for frame, child, (x, y), rotation in chain:
            frames.add_transform(
                frame, child, SimpleNamespace(translation=SimpleNamespace(x=x, y=y), rotation=rotation)
            )
        found = frames.body_pose()
        assert found is not None
        assert found[:2] == pytest.approx((1.0, 5.0))


def test_foreign_or_cyclic_frames_give_no_pose() -> None:
    frames, turned = FrameTree("/tb4"), SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    for frame, child in (
        ("map", "tb3/odom"),
        ("tb3/odom", "tb3/base_link"),
        ("odom", "base_link"),
        ("base_link", "odom"),
    ):
        frames.add_transform(frame, child, SimpleNamespace(translation=SimpleNamespace(x=0.0, y=0.0), rotation=turned))
    assert frames.body_pose() is None
    assert frames.missing_frame == "map to odom (is it localised?)"


@pytest.mark.parametrize(("x", "w", "why"), [(nan, 1.0, "its place is nan, 0"), (1e9, 1.0, "its place is 1e+09, 0"),
                                             (0.0, 0.0, "its orientation has the length 0"),
                                             (0.0, nan, "its orientation has the length 0")])  # fmt: skip
def test_malformed_frame_gives_no_pose_and_a_reason(x: float, w: float, why: str) -> None:
    frames, turned = FrameTree("/tb4"), SimpleNamespace(x=0.0, y=0.0, z=0.0, w=w)
    frames.add_transform(
        "map", "tb4/base_link", SimpleNamespace(translation=SimpleNamespace(x=x, y=0.0), rotation=turned)
    )
    assert frames.body_pose() is None
    assert frames.fault == f"base_link in map: {why}"


def test_unreadable_place_names_are_refused(mission: Mission) -> None:
    at = ("--at", "0.5 m, 0.4 m, 90 deg")
    for name in ("yes", "17", "Anna Küche-2"):
        assert mission("ros2", "place", "add", name, *at).code == 0
    for name in ("a: {b", "", " ", "a\nb", "x" * 41):
        assert mission("ros2", "place", "add", name, *at).code == 2, name
    assert mission("ros2", "place", "add", "nowhere", "--at", "nan m, 0 m, 0 deg").code == 2
    listed = mission("ros2", "place", "list")
    assert (listed.code, listed.out.count("heading")) == (0, 3)
    assert mission("ros2", "place", "add", "kitchen", *at, "--robot", "turtlebot2").code == 2


def test_missions_are_not_offered_to_a_network_without_keys(mission: Mission) -> None:
    told = mission("ros2", "serve", "--router", "tcp/192.168.1.20:7447")
    assert (told.code, "open to the network" in told.err) == (2, True)
