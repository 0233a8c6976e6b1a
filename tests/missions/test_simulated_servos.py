"""The servos behind a simulated robot: those of its file, model by model."""

from pathlib import Path

import pytest

from drivers.clock import ManualClock
from drivers.servos.declared import DynamixelKeys
from drivers.servos.virtual.chain import VirtualServoBus
from missions.assembly.simulation import Simulation
from missions.library.drivers import load_robot

ROBOTS = Path(__file__).parent.parent.parent / "config" / "robots"


@pytest.mark.parametrize("name", ["turtlebot2_arm", "humanoid"])
def test_simulated_servos_have_the_models_of_the_robot_file(name: str) -> None:
    robot = load_robot(ROBOTS / f"{name}.yaml")
    arm = robot.keys(DynamixelKeys)
    assert arm is not None
    simulation = Simulation(robot, frozenset({"arm"}), ManualClock())
    bus = simulation.device(VirtualServoBus)
    assert bus is not None
    for joint in arm.joints.values():
        servo = bus.servo(joint.id)
        assert servo.model.name == joint.model
        assert servo.angle == joint.zero
    assert len(bus.servos) == len(arm.joints)
