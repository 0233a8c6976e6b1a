"""The servos behind a simulated robot: those of its file, model by model."""

from pathlib import Path

import pytest

from config.robot import load_robot
from drivers.clock import ManualClock
from missions.assembly.simulation import Simulation

ROBOTS = Path(__file__).parent.parent.parent / "config" / "robots"


@pytest.mark.parametrize("name", ["turtlebot2_arm", "humanoid"])
def test_each_servo_is_of_the_model_that_the_robot_file_names(name: str) -> None:
    robot = load_robot(ROBOTS / f"{name}.yaml")
    assert robot.arm is not None
    simulation = Simulation(robot, frozenset({"arm"}), ManualClock())
    assert simulation.servos is not None
    for joint in robot.arm.joints.values():
        servo = simulation.servos.servo(joint.id)
        assert servo.model.name == joint.model
        assert servo.angle == joint.zero
    assert len(simulation.servos.servos) == len(robot.arm.joints)
