"""A robot with two arms: the second is a part under a name of its own, which missions move by saying ``on``."""

from collections.abc import Iterator
from math import degrees, radians
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from behaviours.catalogue import LEAVES
from behaviours.robot import ExtraPart, Robot
from config.diagnostics import InvalidFileError, SourceText
from config.robot import RobotConfig
from drivers.clock import SystemClock
from drivers.errors import DeviceFault
from missions.assembly.assembled_robot import AssembledRobot
from missions.assembly.simulation import Simulation
from missions.executive.events import CommandSent, Event
from missions.executive.proxied_robot import with_proxies
from missions.executive.stop_latch import StopLatch
from missions.executive.tick_cache import TickCache
from missions.library.drivers import load_robot, parse_robot
from missions.plugins.setup.doctor.movement_trials import movement_trials
from missions.plugins.testing.commands.simulate import DeviceCommands
from missions.plugins.testing.recorders import HOLD, LeafTestBench, RecordedJoints
from missions.request import RunRequest, contradictions
from missions.runner import Runner, parts_with_ports
from tests.drivers.arms import Make, making
from tests.missions.command import Outcome, command

PATIENCE = 20.0

ARMS = """
robot: pair
arm:
  driver: feetech
  port: /dev/one
  joints:
    shoulder: {id: 1, limits: [-90 deg, 90 deg], speed: 120 deg/s}
    elbow: {id: 2, limits: [-90 deg, 90 deg], speed: 120 deg/s}
"""

RIGHT = """
right_arm:
  kind: arm
  driver: feetech
  port: /dev/two
  joints:
    shoulder: {id: 1, limits: [-30 deg, 30 deg], speed: 120 deg/s}
    elbow: {id: 2, limits: [-90 deg, 90 deg], speed: 120 deg/s}
    gripper: {id: 3, limits: [0 deg, 60 deg], speed: 120 deg/s}
  groups:
    wrist: [elbow, gripper]
"""

BOTH = """
mission: both
tree:
  sequence:
    - parallel:
        - move_joints: {to: {elbow: 30 deg}}
        - move_joints: {to: {elbow: -40 deg}, on: right_arm}
    - joint_at: {joint: elbow, angle: 30 deg}
    - joint_at: {joint: elbow, angle: -40 deg, on: right_arm}
    - torque: {stiff: off, joints: wrist, on: right_arm}
"""


def pair(right: str = RIGHT) -> RobotConfig:
    return parse_robot(SourceText("pair.yaml", ARMS + right))


def written(folder: Path, mission: str = BOTH) -> tuple[str, str]:
    robot, path = folder / "pair.yaml", folder / "both.yaml"
    robot.write_text(ARMS + RIGHT)
    path.write_text(mission)
    return str(path), str(robot)


def test_leaf_moves_the_named_arm(tmp_path: Path) -> None:
    mission, robot = written(tmp_path)
    events: list[Event] = []
    result = Runner(RunRequest(mission, robot=robot, simulate="fast"), listeners=[events.append]).run()
    goals = {
        (event.to, event.values["elbow"])
        for event in events
        if isinstance(event, CommandSent) and "elbow" in event.values
    }
    assert result.result == "success"
    assert goals == {("arm", round(radians(30), 4)), ("right_arm", round(radians(-40), 4))}
    limp = [event.to for event in events if isinstance(event, CommandSent) and "relax" in event.values]
    assert set(limp) == {"right_arm"}


@pytest.mark.real_time
def test_each_arm_uses_its_own_virtual_bus(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission, robot = written(tmp_path)
    assert command(capsys, "run", mission, "--robot", robot, "--simulate", "wire").code == 0


def test_port_option_takes_the_name_of_the_second_arm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission, robot = written(tmp_path)
    order = RunRequest(mission, robot=robot, ports={"right_arm": "/dev/three"})
    assert list(contradictions(order, lambda name, _="": name, parts_with_ports)) == []
    told = command(capsys, "run", mission, "--robot", robot, "--port", "rigth_arm=/dev/three")
    assert told.code == 2
    assert (
        "'rigth_arm' is not a part with a port; parts with ports: base, head, arm, imu, range, ros2, right_arm"
        in told.err
    )


def test_a_record_of_both_decides_the_same_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission, robot = written(tmp_path)
    record = str(tmp_path / "both.mcap")
    assert command(capsys, "run", mission, "--robot", robot, "--simulate", "fast", "--record", record).code == 0
    again = command(capsys, "record", "rerun", record)
    assert (again.code, "no difference" in again.out) == (0, True)


def test_every_arm_leaf_has_the_argument_on() -> None:
    of_arms = {
        word: leaf.arguments for word, leaf in LEAVES.items() if "arm" in leaf.needs and "base" not in leaf.needs
    }
    assert "gesture" in of_arms
    assert [word for word, arguments in of_arms.items() if "on" not in arguments] == []


ROS = """
wing_controller:
  controller: {package: dynamixel_controllers, module: joint_position_controller, type: JointPositionController}
  joint_name: wing
  motor: {id: 11, init: 512, min: 205, max: 819}
"""

SWEEP = "sweep: {joints: elbow, between: [0 deg, 9 deg], on: right_arm}"


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (
            "move_joints: {to: {elbow: 3 deg}, on: rigth_arm}",
            "3:3: 'move_joints' needs a rigth_arm; robot 'pair' has none (its arms are arm, right_arm)",
        ),
        (
            "look: {pan: 3 deg, on: right_arm}",
            "3:3: 'look' needs a right_arm; robot 'pair' has none (it has no head)",
        ),
        (
            f"parallel: [{{torque: {{stiff: on, on: right_arm}}}}, {{{SWEEP}}}]",
            "can both drive the right_arm at the same time",
        ),
        (
            "move_joints: {to: {shoulder: 60 deg}, on: right_arm}",
            "shoulder at 60 deg is outside its limits (-30 deg to 30 deg)",
        ),
        ("move_joints: {to: {gripper: 9 deg}}", "the arm has no joint 'gripper'"),
        ("mirror: {leader_arm: arm, on: right_arm, follower: gripper}", "the arm has no joint 'gripper'"),
        (
            "mirror: {leader_arm: rigth_arm}",
            "3:3: 'mirror' needs a rigth_arm; robot 'pair' has none (its arms are arm, right_arm)",
        ),
        (
            "parallel: [{mirror: {leader_arm: right_arm}}, {torque: {stiff: on, on: right_arm}}]",
            "can both drive the right_arm at the same time",
        ),
        (
            "parallel: [{mirror: {leader_arm: arm, on: right_arm}}, {torque: on}]",
            "can both drive the arm at the same time",
        ),
        (
            "sequence: [{set: {which: right_arm}}, {mirror: {leader_arm: '${which}'}}]",
            "which arm it means must be known before the mission runs",
        ),
        (
            "sequence: [{set: {which: right_arm}}, {torque: {stiff: on, on: '${which}'}}]",
            "which arm it means must be known before the mission runs",
        ),
    ],
)
def test_the_checker_knows_which_arm_a_leaf_drives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str, told: str
) -> None:
    mission, robot = written(tmp_path, f"mission: both\ntree:\n  {line}\n")
    checked = command(capsys, "check", mission, "--robot", robot)
    assert checked.code == 2
    assert told in checked.out + checked.err


def test_joints_are_checked_against_the_named_arm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = "sequence: [{move_joints: {to: {gripper: 9 deg}, on: right_arm}}, {move_joints: {to: {shoulder: 60 deg}}}]"
    mission, robot = written(tmp_path, f"mission: both\ntree:\n  {lines}\n")
    assert command(capsys, "check", mission, "--robot", robot).code == 0


def test_two_arms_do_not_share_a_port() -> None:
    with pytest.raises(InvalidFileError, match="port /dev/one is used by 'arm' already"):
        pair(RIGHT.replace("/dev/two", "/dev/one"))


@pytest.mark.usefixtures("here")
def test_faults_of_test_files_name_the_arm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = "move_joints: {to: {elbow: 30 deg}}", "move_joints: {to: {gripper: 50 deg}, on: right_arm}"
    _, robot = written(tmp_path, f"mission: both\ntree:\n  sequence: [{{{first}}}, {{{second}, timeout: 3 s}}]\n")
    suite = tmp_path / "both.test.yaml"

    def tested(given: str, expected: str) -> Outcome:
        case = f"{{case: it, robot: {robot}, given: [{given}], expect: {{{expected}}}}}"
        suite.write_text(f"tests: both.yaml\ncases:\n  - {case}\n")
        return command(capsys, "test", str(suite))

    whole = "result: success, ran: {move_joints: 2}, joints: {elbow: 30 deg, right_arm.gripper: 50 deg}"
    assert tested("right_arm overloaded gripper at 0.3 s", "result: failure, ran: {move_joints: 2}").code == 0
    assert tested("right_arm unplugged at 0.3 s", "result: failure, ran: {move_joints: 2}").code == 0
    assert tested("arm unplugged when move_joints succeeds", whole).code == 0
    assert "the arm of 'pair' has no joint 'gripper'" in tested("arm overloaded gripper", whole).err


MIRROR = """
mission: both
tree:
  sequence:
    - mirror: {leader_arm: arm, on: right_arm}
      timeout: 4 s
      on_failure: succeed
    - joint_at: {joint: elbow, angle: 40 deg, on: right_arm}
"""


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("leader", ["arm", "right_arm"])
def test_mirror_copies_one_arm_to_the_other(tmp_path: Path, capsys: pytest.CaptureFixture[str], leader: str) -> None:
    follower = {"arm": "right_arm", "right_arm": "arm"}[leader]
    text = f"{{leader_arm: {leader}, on: {follower}}}"
    _, robot = written(tmp_path, MIRROR.replace("{leader_arm: arm, on: right_arm}", text))
    suite = tmp_path / "both.test.yaml"
    joint = {"arm": "elbow", "right_arm": "right_arm.elbow"}[follower]
    case = (
        f"{{case: it, robot: {robot}, given: [{leader} turned elbow to 40 deg at 1 s], "
        f"expect: {{ran: {{mirror: 1}}, joints: {{{joint}: 40 deg}}}}}}"
    )
    suite.write_text(f"tests: both.yaml\ncases:\n  - {case}\n")
    tested = command(capsys, "test", str(suite))
    assert tested.code == 0, tested.out + tested.err


def test_rerun_of_a_mirror_record_is_identical(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission, robot = written(tmp_path, MIRROR.replace("40 deg", "0 deg"))
    record = str(tmp_path / "both.mcap")
    assert command(capsys, "run", mission, "--robot", robot, "--simulate", "fast", "--record", record).code == 0
    again = command(capsys, "record", "rerun", record)
    assert (again.code, "no difference" in again.out) == (0, True)


@pytest.fixture
def make() -> Iterator[Make]:
    with making() as maker:
        yield maker


@pytest.fixture
def one_thread_after_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """Time stands still on hand-cranked wires: who starts a thread goes on once that has done what it can."""
    start = Thread.start

    def slowly(self: Thread) -> None:
        start(self)
        self.join(PATIENCE)

    monkeypatch.setattr(Thread, "start", slowly)


@pytest.mark.usefixtures("one_thread_after_another")
def test_stop_latches_both_arms_until_released(make: Make) -> None:
    left, right = make().start(), make(name="right_arm").start()
    robot = Robot(arm_part=left.joints, extra_parts={"right_arm": ExtraPart("arm", right.joints)})
    assembled = AssembledRobot("pair", robot, {"arm": left.joints, "right_arm": right.joints})
    latch = StopLatch(
        assembled.devices, assembled.stoppable_parts, None, assembled.safe_stop, lambda _: None, lambda: None
    )
    answers = TickCache()
    seen = with_proxies(robot, answers, lambda *_: latch.permit())
    arms = {left: seen.arm, right: seen.with_named_parts({"arm": "right_arm"}).arm}
    for arm, joints in arms.items():
        joints.move({"elbow": radians(80)}, speeds={"elbow": radians(30)})
        arm.until(lambda arm=arm: arm.state("elbow").position > radians(5))  # type: ignore[misc]
    assert latch.stop("Ada") == ["arm", "right_arm"]
    stopped = {arm: arm.chain.servo(2).angle for arm in arms}
    for arm, joints in arms.items():
        with pytest.raises(DeviceFault, match="stopped by Ada"):
            joints.move({"elbow": radians(80)})
        begun = arm.clock.now()
        arm.until(lambda arm=arm, begun=begun: arm.clock.now() > begun + 2.0)  # type: ignore[misc]
        assert degrees(arm.chain.servo(2).angle) == pytest.approx(degrees(stopped[arm]), abs=1.0)
        assert not arm.limp(2)
    assert latch.release(1)
    for arm, joints in arms.items():
        joints.move({"elbow": radians(20)})
        arm.until(lambda arm=arm: arm.at("elbow", radians(20)))  # type: ignore[misc]


def test_one_is_held_without_the_other() -> None:
    bench = LeafTestBench()
    right = RecordedJoints(bench.clock)
    robot = Robot(arm_part=bench.arm, extra_parts={"right_arm": ExtraPart("arm", right)})
    assembled = AssembledRobot("pair", robot, {"arm": bench.arm, "right_arm": right})
    assert assembled.moving_parts == ("arm", "right_arm")
    assembled.safe_stop(frozenset({"right_arm"}))
    assert (bench.arm.commands, right.commands) == ([], [HOLD])


def test_doctor_tries_the_joints_of_the_second_arm() -> None:
    tried = list(movement_trials("right_arm", pair().sections["right_arm"]))
    assert [trial.about for trial in tried] == ["shoulder", "elbow", "gripper"]
    assert tried[0].steps == ("nudge: {joint: shoulder, on: right_arm}",)
    assert "--robot ROBOT --arm right_arm" in tried[0].fix


def test_servo_commands_take_the_name_of_the_second_arm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, robot = written(tmp_path)
    wrong = command(capsys, "servo", "move", "gripper", "20 deg", "--robot", robot, "--simulate", "--arm", "rigth_arm")
    assert (wrong.code, "pair has no rigth_arm; --arm: did you mean 'right_arm'?" in wrong.err) == (2, True)
    found = command(capsys, "servo", "scan", "--ids", "1-4", "--robot", robot, "--simulate", "--arm", "right_arm")
    assert (found.code, "gripper" in found.out) == (0, True), found.out + found.err


def test_servo_import_adds_joints_to_the_named_arm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, robot = written(tmp_path)
    ros = tmp_path / "ros.yaml"
    ros.write_text(ROS)
    wrong = command(capsys, "servo", "import", str(ros), "--model", "AX-12A", "--into", robot, "--arm", "rigth_arm")
    assert (wrong.code, "pair has no rigth_arm; --arm: did you mean 'right_arm'?" in wrong.err) == (2, True), wrong.err
    (tmp_path / "pair.yaml").write_text(
        (ARMS + RIGHT).replace("driver: feetech", "driver: dynamixel").replace("id:", "model: AX-12A, id:")
    )
    added = command(capsys, "servo", "import", str(ros), "--into", robot, "--arm", "right_arm")
    assert added.code == 0, added.err
    config = load_robot(tmp_path / "pair.yaml")
    assert list(config.sections["right_arm"].keys.joints) == ["wing", "shoulder", "elbow", "gripper"]
    assert list(config.sections["arm"].keys.joints) == ["shoulder", "elbow"]
    told = command(capsys, "servo", "import", str(ros), "--arm", "left_arm")
    assert parse_robot(SourceText("new.yaml", told.out)).extra_parts == {"left_arm": "arm"}


def test_simulation_commands_turn_the_joints_of_either_arm() -> None:
    config = pair()
    simulation = Simulation(config, frozenset({"arm", "right_arm"}), SystemClock())
    simulation.open()
    try:
        hands = DeviceCommands(simulation, config)
        hands.run_command("turn right_arm.elbow 30 deg")
        hands.run_command("turn elbow -20 deg")
        chains: dict[str, Any] = {part: simulation.parts[part].device for part in ("arm", "right_arm")}
        angles = {part: chain.servo(2).angle for part, chain in chains.items()}
    finally:
        simulation.close()
    assert angles == pytest.approx({"arm": radians(-20), "right_arm": radians(30)}, abs=0.01)
