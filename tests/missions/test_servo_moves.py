"""``mission servo record`` and ``play``: what a hand has shown, the arm does again, and how well is told."""

import csv
import io
import signal
from collections.abc import Callable, Iterator
from math import degrees, radians
from pathlib import Path

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from config.gesture import load_gesture
from drivers.transport.ports import open_port
from tests.missions.command import Outcome, Process, command
from tests.missions.servo_bench import Three, by_hand, patient, three
from tests.waiting import wait_until

Mission = Callable[[str], Outcome]

NOD = """\
gesture: nod
summary: Nod with the elbow.
keyframes:
  - {at: 0.3 s, elbow: 5 deg}
  - {at: 0.8 s, elbow: 25 deg, waist: 10 deg}
  - {at: 1.3 s, elbow: 0 deg}
"""


@pytest.fixture(scope="module", autouse=True)
def fonts() -> None:
    """Have Matplotlib open its fonts before the tests: it keeps their files open."""
    FigureCanvasAgg(figure := Figure())
    figure.text(0.1, 0.1, "plain")
    figure.savefig(io.BytesIO())


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Three]:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nod.yaml").write_text(NOD)
    with three(Path("three.yaml"), patient(monkeypatch)) as found:
        yield found


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str]) -> Mission:
    """The command, in one line of words."""
    return lambda line: command(capsys, *line.split())


# Play


def test_servo_play_reports_tracking_errors(robot: Three, mission: Mission) -> None:
    outcome = mission("servo play nod.yaml --robot three.yaml --csv nod.csv --plot nod.svg")
    assert outcome.code == 0, outcome.err + outcome.out
    table = [line.split() for line in outcome.out.splitlines()]
    assert ["joint", "rms", "deg", "worst", "deg", "at", "s", "readings"] in table
    assert {row[0] for row in table if row and row[0] in ("elbow", "waist", "wrist")} == {"elbow", "waist"}
    with Path("nod.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["joint"] == "elbow"]
    assert len(rows) > 5
    assert max(float(row["position"]) for row in rows) == pytest.approx(radians(25), abs=radians(4))
    assert Path("nod.svg").read_text().count("<svg") == 1
    assert robot.elbow.angle == pytest.approx(radians(10), abs=radians(4))  # 0 deg of the joint
    wait_until(lambda: robot.elbow.limp)  # at_end: relax


def test_dry_run_of_play_opens_no_port(robot: Three, mission: Mission) -> None:
    robot.path.write_text(robot.path.read_text().replace(robot.terminal.path, "/dev/nothing_here"))
    outcome = mission("servo play nod.yaml --robot three.yaml --dry-run --speed 0.5 --plot nod.png")
    assert outcome.code == 0, outcome.err
    assert outcome.out.splitlines() == [
        "nod: 3 keyframes in 2.0 s; before that to its first pose, at 50 deg/s at most",
        "   s  elbow  waist",
        "0.00    5.0   10.0",
        "1.00   25.0   10.0",
        "2.00    0.0   10.0",
    ]
    assert Path("nod.png").read_bytes().startswith(b"\x89PNG")


def test_servo_play_accepts_a_spreadsheet(robot: Three, mission: Mission) -> None:
    rows = "".join(f"{index / 25:.2f},{0.2 * min(index, 50 - index) / 25:.4f}\n" for index in range(51))
    Path("sheet.csv").write_text("time,waist\n" + rows)
    outcome = mission("servo play sheet.csv --robot three.yaml --speed 2")
    assert outcome.code == 0, outcome.err + outcome.out
    assert abs(degrees(robot.waist.angle)) < 4


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("far.yaml --dry-run", "far.yaml:4:24:"),
        ("nod.yaml --dry-run --plot nod.gif", "a picture ends in .png or .svg"),
        ("nod.yaml --dry-run --csv nod.csv", "--dry-run has none"),
        ("nod.yaml --plot there/nod.png", "there is no folder there"),
        ("nodd", "unknown move 'nodd'"),
    ],
)
@pytest.mark.usefixtures("robot")
def test_servo_play_refuses_unsuitable_moves_before_motion(line: str, words: str, mission: Mission) -> None:
    Path("far.yaml").write_text(NOD.replace("5 deg", "95 deg", 1))
    outcome = mission(f"servo play {line} --robot three.yaml")
    assert (outcome.code, words in outcome.err) == (2, True), outcome.err


def test_servo_play_fails_if_a_joint_does_not_follow(robot: Three, mission: Mission) -> None:
    Path("up.yaml").write_text(NOD.replace("elbow: 0 deg", "elbow: 20 deg"))
    robot.elbow.load = 2.0
    outcome = mission("servo play up.yaml --robot three.yaml")
    assert outcome.code == 1
    assert "joint elbow: commanded" in outcome.out
    (row,) = [line.split() for line in outcome.out.splitlines() if line.startswith("elbow ")]
    assert float(row[2]) == pytest.approx(25.0, abs=2.0)  # the worst


@pytest.mark.parametrize(
    "words", ["play nod.yaml --speed 0.1", "record shown --seconds 60 --yes", "move elbow 50 deg --speed 5deg/s"]
)
@pytest.mark.real_time
def test_ctrl_c_leaves_the_arm_at_rest_and_the_port_free(robot: Three, words: str) -> None:
    robot.path.write_text(robot.path.read_text().replace("at_end: relax", "at_end: hold"))
    limp = words.startswith("record")
    robot.elbow.set("torque_enable", limp)
    process = Process("servo", *words.split(), "--robot", "three.yaml", folder=Path.cwd())
    wait_until(lambda: robot.elbow.limp == limp)
    assert process.end(signal.SIGINT) == 130
    errors = "".join(process.errors + process.lines)  # a busy machine may miss replies: then that is told
    assert [number for number in (1, 2, 3) if robot.bus.servo(number).limp and f"(servo {number})" not in errors] == []
    open_port("test", robot.terminal.path, 1_000_000).close()


# Record


def moving(robot: Three) -> Iterator[None]:
    """Turn the elbow by hand, to and fro once it is limp."""
    while not robot.elbow.limp:
        yield
    for step in [*range(41), *[40] * 5, *range(40, -1, -1)]:
        robot.elbow.turn_by_hand(radians(10 - step))
        yield


def pulling(robot: Three) -> Iterator[None]:
    """Pull the plug while it is looked."""
    for _ in range(10):
        yield
    robot.terminal.unplug()


def test_recorded_gesture_can_be_played(robot: Three, mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    robot.elbow.set("torque_enable", 1)
    by_hand(monkeypatch, robot.clock, moving(robot))
    outcome = mission("servo record lift --robot three.yaml --joint elbow --seconds 4 --yes")
    assert outcome.code == 0, outcome.err
    gesture = load_gesture(Path("lift.yaml"))
    assert (gesture.name, gesture.interpolation) == ("lift", "cubic")
    assert gesture.joints == {"elbow"}
    highest = max(positions.get("elbow", 0.0) for _, positions in gesture.keyframes)
    assert degrees(highest) == pytest.approx(40.0, abs=1.0)
    assert mission("servo play lift --robot three.yaml --dry-run").code == 0
    again = mission("servo record lift --robot three.yaml --seconds 1")
    assert (again.code, "--force replaces it" in again.err) == (2, True)


@pytest.mark.usefixtures("robot")
def test_servo_record_refuses_a_shipped_name(mission: Mission) -> None:
    outcome = mission("servo record hello --robot three.yaml --seconds 1")
    assert (outcome.code, "choose another name" in outcome.err) == (2, True)


def test_where_nothing_moved_nothing_is_written(robot: Three, mission: Mission) -> None:
    outcome = mission("servo record still --robot three.yaml --seconds 0.5")
    assert outcome.code == 3
    assert "no joint moved during the recording" in outcome.err
    assert not Path("still.yaml").exists()
    assert all(each.limp for each in robot.bus.servos)


@pytest.mark.real_time
def test_unplugged_arm_ends_the_recording(robot: Three, mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    by_hand(monkeypatch, robot.clock, pulling(robot))
    outcome = mission("servo record lost --robot three.yaml --seconds 30")
    assert outcome.code == 3
    assert "no reading for" in outcome.err
    assert not Path("lost.yaml").exists()
