"""A robot of rigid bodies: it stands, sinks under its weight, slides, falls, and does so the same each time."""

import sys
from dataclasses import replace
from math import radians
from pathlib import Path

import pytest

from drivers.api import Pose2D
from drivers.errors import BadRequest
from drivers.servos.joint import JointSpec
from drivers.servos.models import MODELS, motor_physics
from drivers.servos.rigid_twin import RigidServo
from drivers.sim.rigid import scene as scenes
from drivers.sim.rigid.rigid_model import Floor, TrunkPush, make_mjcf
from drivers.sim.rigid.scene import PhysicsScene
from tests.drivers.toy_humanoid import MOTOR, crouch, figure, scene


def test_servo_stiffness_matches_the_measured_one() -> None:
    measured = 21.1  # Nm/rad, of the XM430-W350 in the public model of the OP3
    assert motor_physics(MODELS["XM430-W350"]).stiffness == pytest.approx(measured, rel=0.15)


def test_unloaded_servo_reaches_its_free_speed() -> None:
    for model in MODELS.values():
        motor = motor_physics(model)
        assert motor.torque / motor.damping == pytest.approx(model.free_speed)


def test_body_stands_on_its_soles() -> None:
    robot = scene()
    robot.advance(2.0)
    assert not robot.has_fallen
    assert robot.proper_acceleration()[2] == pytest.approx(9.81, abs=0.1)
    assert abs(robot.pose().x) < 0.02
    assert abs(robot.lean()[0]) < 0.01


def test_weight_bends_the_knee_by_the_servo_compliance() -> None:
    robot = scene()
    crouch(robot, 1.0)
    robot.advance(3.0)
    behind = robot.angle("l_knee") - 1.0
    # Half the trunk's weight, at the arm that half a thigh has, over the servo's stiffness and its backlash.
    assert 0.02 < behind < 0.12
    torque = -(behind - MOTOR.backlash / 2) * MOTOR.stiffness
    assert robot.load("l_knee") == pytest.approx(torque / MOTOR.torque, abs=0.02)


def test_joint_turns_no_faster_than_commanded() -> None:
    robot = scene()
    robot.set_goal("l_hip_yaw", 0.5, 0.2)
    robot.advance(1.0)
    assert 0.1 < robot.angle("l_hip_yaw") <= 0.2  # the floor's friction keeps it back


def test_servo_load_is_a_share_of_the_stall_torque() -> None:
    weak = replace(MOTOR, torque=MOTOR.torque / 4)
    body = replace(figure(), links=[replace(link, motor=weak) for link in figure().links])
    robot = PhysicsScene(make_mjcf(body), dict.fromkeys([link.name for link in body.links], MOTOR.backlash), Floor())
    knee = RigidServo("l_knee", JointSpec(1, "XM430-W350"), robot)
    crouch(robot, 1.9, speed=5.0)
    robot.advance(0.3)
    assert knee.state(0.3).load == pytest.approx(robot.torque("l_knee") / MODELS["XM430-W350"].stall_torque)
    assert 0.2 < abs(knee.state(0.3).load) <= 0.25


def test_limp_body_falls() -> None:
    robot = scene()
    for joint in ("l_knee", "r_knee", "l_ank_pitch", "r_ank_pitch", "l_hip_pitch", "r_hip_pitch"):
        robot.switch_torque_off(joint)
    robot.advance(3.0)
    assert robot.has_fallen
    assert not robot.has_torque("l_knee")


def test_push_tilts_the_body_and_a_hard_push_topples() -> None:
    left, pushed = scene(), scene(Floor(pushes=(TrunkPush(0.5, 0.1),)))
    left.advance(0.65)
    pushed.advance(0.65)
    assert pushed.lean()[1] > left.lean()[1] + 0.005
    pushed.advance(3.0)
    assert not pushed.has_fallen
    thrown = scene(Floor(pushes=(TrunkPush(0.5, 1.5, radians(90)),)))
    thrown.advance(3.0)
    assert thrown.has_fallen
    assert thrown.pose().y > 0.03


def test_body_stands_on_a_slope_only_with_friction() -> None:
    slope = (0.0, radians(8))
    stands, slides = scene(Floor(friction=0.6, slope=slope)), scene(Floor(friction=0.05, slope=slope))
    stands.advance(1.0)
    slides.advance(1.0)
    assert abs(stands.pose().y) < 0.01
    assert slides.pose().y < -0.1  # down is to its right


def test_a_delay_keeps_the_goal_from_the_servo() -> None:
    late = scene(Floor(servo_delay=0.1))
    crouch(late, 1.0)
    late.advance(0.09)
    assert abs(late.angle("l_knee")) < 0.02
    late.advance(0.4)
    assert late.angle("l_knee") > 0.1


def test_runs_with_equal_seeds_are_bit_identical() -> None:
    one, other = (scene(Floor(mass_error=0.05, pushes=(TrunkPush(0.1, 0.1),)), seed=7) for _ in range(2))
    for robot in (one, other):
        crouch(robot, 0.7)
    one.advance(1.0)
    for tick in range(1001):
        other.advance(tick / 1000)
    assert (one.data.qpos == other.data.qpos).all()
    assert one.energy == other.energy > 0


def test_seeds_differ_in_the_masses() -> None:
    masses = [scene(Floor(mass_error=0.05), seed=seed).model.body_mass.sum() for seed in (1, 2)]
    assert masses[0] != masses[1]


def test_body_starts_at_the_given_pose() -> None:
    robot = scene()
    moved = PhysicsScene(MODEL.format(joint="l_knee"), {"l_knee": 0.0}, Floor(), start=Pose2D(1.0, 2.0, 0.5))
    assert (moved.pose().x, moved.pose().y) == (1.0, 2.0)
    assert moved.pose().heading == pytest.approx(0.5)
    assert robot.pose().x == 0


MODEL = """<mujoco><worldbody><body name="b"><freejoint/><geom size="0.1"/><body><joint name="{joint}"/>
<geom size="0.05" pos="0.2 0 0"/></body></body></worldbody>
<actuator><position joint="{joint}" kp="20" forcerange="-4 4"/></actuator></mujoco>"""


def test_user_model_is_loaded_from_its_file(tmp_path: Path) -> None:
    (tmp_path / "mine.xml").write_text(MODEL.format(joint="l_knee"))
    robot = PhysicsScene(tmp_path / "mine.xml", {"l_knee": 0.0}, Floor())
    robot.set_goal("l_knee", 0.3, 5.0)
    robot.advance(1.0)
    assert robot.angle("l_knee") == pytest.approx(0.3, abs=0.1)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco", "not a valid MuJoCo model"),
        ("<mujoco/>", "no body has a freejoint"),
        (MODEL.format(joint="elbow"), "has no joint 'l_knee'"),
        (MODEL.format(joint="l_knee").replace("position", "motor").replace('kp="20" ', ""), "no position actuator"),
    ],
)
def test_unsuitable_model_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "mine.xml").write_text(text)
    with pytest.raises(BadRequest, match=said) as refused:
        PhysicsScene(tmp_path / "mine.xml", {"l_knee": 0.0}, Floor())
    assert "mine.xml" in str(refused.value)


def test_missing_mujoco_gives_an_install_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(BadRequest) as refused:
        scenes.import_mujoco()
    assert refused.value.hint == "pip install 'missiontree[physics]'"
