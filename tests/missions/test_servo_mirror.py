"""``mission servo mirror``: one arm copies another, each on a port of its own."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Thread

import click
import pytest

from drivers.api import Coupling, JointLimits
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.terminal import PseudoTerminal
from missions.plugins.setup.servo.mirror import couple_joints
from tests.missions.command import Outcome, command
from tests.missions.servo_bench import patient
from tests.waiting import wait_until

Mission = Callable[[str], Outcome]

FILE = """\
robot: NAME
arm:
  driver: feetech
  port: PORT
  at_end: END
  joints:
    elbow: {id: 1, limits: [-90 deg, 90 deg], speed: 180 deg/s}
    gripper: {id: 2, limits: [0 deg, RANGE deg], speed: 180 deg/s}
"""


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str]) -> Mission:
    return lambda line: command(capsys, *line.split())


@pytest.fixture
def arms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[VirtualServoBus, VirtualServoBus]]:
    """A leader and a follower on ports, with their files in the folder of the test."""
    monkeypatch.chdir(tmp_path)
    clock, chains = patient(monkeypatch), []
    with ExitStack() as closings:
        for name, end, reach in (("leader", "relax", "40"), ("follower", "hold", "80")):
            servos = VirtualServoBus([VirtualServo(number, model="STS3215") for number in (1, 2)])
            terminal = PseudoTerminal(name, servos, clock)
            terminal.open()
            closings.callback(terminal.close)
            told = FILE.replace("NAME", name).replace("PORT", terminal.path).replace("END", end)
            Path(f"{name}.yaml").write_text(told.replace("RANGE", reach))
            chains.append(servos)
        leader, follower = chains
        yield leader, follower


@pytest.mark.real_time
def test_servo_mirror_follows_the_leader_and_holds(
    arms: tuple[VirtualServoBus, VirtualServoBus], mission: Mission
) -> None:
    leader, follower = arms

    def move() -> None:
        wait_until(lambda: not follower.servo(1).limp)
        leader.servo(1).turn_by_hand(0.3)
        leader.servo(2).turn_by_hand(0.2)
        wait_until(lambda: abs(follower.servo(1).angle - 0.3) < 0.01 and abs(follower.servo(2).angle - 0.4) < 0.01)

    hand = Thread(target=move)
    hand.start()
    outcome = mission("servo mirror leader.yaml --robot follower.yaml --seconds 4")
    hand.join()
    assert outcome.code == 0, outcome.err
    assert "the torque of leader.yaml is off" in outcome.err
    assert follower.servo(1).angle == pytest.approx(0.3, abs=0.02)
    assert follower.servo(2).angle == pytest.approx(0.4, abs=0.02)  # its gripper opens twice as far
    assert [servo.limp for servo in leader.servos] == [True, True]
    assert [servo.limp for servo in follower.servos] == [False, False]


def test_joints_are_coupled_by_name_and_grippers_by_range() -> None:
    one = {"elbow": JointLimits(-1.0, 1.0, 1.0), "gripper": JointLimits(0.0, 1.0, 1.0)}
    other = {"gripper": JointLimits(-0.5, 1.5, 1.0), "elbow": JointLimits(-1.0, 1.0, 1.0)}
    assert couple_joints(one, other, ["gripper"]) == [
        Coupling("gripper", "gripper", 2.0, -0.5),
        Coupling("elbow", "elbow"),
    ]
    assert couple_joints(one, other, [])[0] == Coupling("gripper", "gripper")
    with pytest.raises(click.UsageError, match="the leader has toe, the follower gripper, elbow"):
        couple_joints({"toe": one["elbow"]}, other, [])
    with pytest.raises(click.UsageError, match="gripper: the leader's limits are equal"):
        couple_joints({**one, "gripper": JointLimits(0.5, 0.5, 1.0)}, other, ["gripper"])


def test_leader_with_other_joints_is_refused_before_opening(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "other.yaml"
    file.write_text("robot: other\narm: {driver: dynamixel, port: /dev/null, joints: {neck: {id: 1}}}\n")
    told = command(capsys, "servo", "mirror", str(file), "--robot", "so101", "--seconds", "1")
    assert (told.code, "no joints with the same name" in told.err) == (2, True)
