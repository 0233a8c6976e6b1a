"""What a record says of its run before the first moment: every file with its bytes, by a name that tells what it is."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from config.file_io import collect_read_files, record_read
from config.library import DEFAULT_ROBOT, find_file
from missions.library.drivers import load_robot
from missions.plugins.records.recording.record_contents import contents_of
from missions.plugins.records.recording.record_header import RecordContents
from missions.request import RunRequest
from missions.runner import Runner

STARTED = datetime(2026, 11, 21, 14, 3, tzinfo=UTC)

LEAF = '''
from behaviours.leaf import Leaf
from py_trees.common import Status

class Idle(Leaf):
    """SUCCESS at once."""
    tag = "idle_about"
    def work(self) -> Status:
        return Status.SUCCESS
'''


def gathered(order: RunRequest) -> tuple[RecordContents, Mapping[Path, bytes]]:
    with collect_read_files() as files:
        runner = Runner(order)
    config = load_robot(find_file("robots", order.robot or DEFAULT_ROBOT))
    return contents_of(order, runner.plan, config, files, started=STARTED, command=("mission", "run")), files


def test_record_contains_all_files_of_a_shipped_mission() -> None:
    contents, files = gathered(RunRequest("greet", simulate="fast", seed=3))
    assert set(contents.files) == {
        "mission/greet.yaml",
        "robot/turtlebot2_arm.yaml",
        "world/living_room.yaml",
        "controller/face.yaml",
        "gesture/hello.yaml",
    }
    for name, data in contents.files.items():
        path = Path(contents.header.paths[name])
        assert data == path.read_bytes() == files[path]
    head = contents.header
    assert (head.mission, head.file, head.robot) == ("greet", "mission/greet.yaml", "turtlebot2_arm")
    assert (head.world, head.seed, head.simulate, head.eyes) == ("living_room", 3, "fast", "pixels")
    assert head.started == "2026-11-21T14:03:00+00:00"
    assert {"base", "head", "camera"} <= set(head.parts)
    assert b'"mission": "greet"' in contents.tree


def test_record_contains_the_users_own_files(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "leaf.py").write_text(LEAF, encoding="utf-8")
    (tmp_path / "sheet.csv").write_text("time,elbow\n0,0\n1,0.5\n2,0\n", encoding="utf-8")
    steps = f"[wait: 1 s, idle_about: , play: {tmp_path / 'sheet.csv'}]"
    (inner / "count.yaml").write_text(f"mission: inner\ntree:\n  sequence: {steps}\n", encoding="utf-8")
    outer = tmp_path / "count.yaml"
    outer.write_text("mission: outer\nparams: {to: 3}\ntree:\n  mission: inner/count.yaml\n", encoding="utf-8")
    order = RunRequest(str(outer), {"to": "5"}, simulate="fast", behaviours=[tmp_path / "leaf.py"])
    contents, _ = gathered(order)
    head = contents.header
    assert {"mission/count.yaml", "mission/count-2.yaml", "behaviours/leaf.py", "move/sheet.csv"} <= set(contents.files)
    assert contents.files[head.file] == outer.read_bytes()
    assert head.behaviours == ("behaviours/leaf.py",)
    assert head.params == {"to": "5"}
    assert head.values == {"to": "5"}


def test_record_contains_files_as_they_were_read(tmp_path: Path) -> None:
    path = tmp_path / "short.yaml"
    path.write_text("mission: short\ntree: {wait: 1 s}\n", encoding="utf-8")
    with collect_read_files() as files:
        runner = Runner(order := RunRequest(str(path), simulate="fast"))
    before = path.read_bytes()
    path.write_text("mission: other\ntree: {wait: 9 s}\n", encoding="utf-8")
    config = load_robot(find_file("robots", DEFAULT_ROBOT))
    contents = contents_of(order, runner.plan, config, files, started=STARTED)
    assert contents.files["mission/short.yaml"] == before


def test_inner_file_collection_hides_reads_from_the_outer(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"x")
    with collect_read_files() as outer:
        with collect_read_files() as inner:
            record_read(path)
        assert dict(inner) == {path: b"x"}
    record_read(path)
    assert not outer


def test_camera_passwords_are_not_recorded(tmp_path: Path) -> None:
    robot = tmp_path / "far.yaml"
    robot.write_text(
        "robot: far\ncamera: {source: 'http://me:secret@cam:81/stream?pwd=secret', rotate: 90}\nvoice: {}\n"
    )
    mission = tmp_path / "look.yaml"
    mission.write_text("mission: look\ntree: {say: hello}\n")
    order = RunRequest(str(mission), robot=str(robot), simulate="fast")
    with collect_read_files() as files:
        runner = Runner(order)
    command = ("mission", "run", "--camera=rtsp://me:secret@cam/x")
    contents = contents_of(order, runner.plan, load_robot(robot), files, started=STARTED, command=command)
    kept = contents.files["robot/far.yaml"].decode()
    assert "secret" not in kept + " ".join(contents.header.command)
    assert "http://***@cam:81/stream?pwd=***" in kept
    robot.write_text(kept)
    again = load_robot(robot).camera
    assert again is not None
    assert again.orientation.swaps_sides
