"""ROBOTIS' OP3 as physics know it, by the figures of its public model; and what is sent to its servos."""

from drivers.servos.models import MODELS, motor_physics
from drivers.sim.rigid.rigid_model import Floor, RigidLink, RigidRobot, RigidShape, make_mjcf
from drivers.sim.rigid.scene import PhysicsScene

MOTOR = motor_physics(MODELS["XM430-W350"])

_LEFT = """
l_hip_yaw    .            0      0.035  0        z  0.012 -0.002  0     -0.008
l_hip_roll   l_hip_yaw   -0.024  0     -0.0285   x  0.179  0.004  0     -0.012
l_hip_pitch  l_hip_roll   0.0241 0.019  0        y  0.115  0.001 -0.019 -0.084
l_knee       l_hip_pitch  0      0     -0.11015  y  0.040  0     -0.022 -0.055
l_ank_pitch  l_knee       0      0     -0.110    y  0.179 -0.020 -0.019  0.012
l_ank_roll   l_ank_pitch -0.0241 -0.019 0        x  0.069  0.024  0.010 -0.028
"""
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def figure() -> RigidRobot:
    """Its trunk with the head and arms that do not move, and its legs."""
    links = []
    for side, sign in (("l", 1.0), ("r", -1.0)):
        for row in _LEFT.split("\n")[1:-1]:
            name, parent, *numbers = row.split()
            x, y, z, mass, *centre = (float(word) for word in numbers if word not in _AXES)
            sole = RigidShape((0.024, sign * 0.013, -0.0265), (0.127, 0.067, 0.008))
            links.append(
                RigidLink(
                    name.replace("l_", f"{side}_", 1),
                    "" if parent == "." else parent.replace("l_", f"{side}_", 1),
                    (x, sign * y, z),
                    _AXES[numbers[3]],
                    mass,
                    (centre[0], sign * centre[1], centre[2]),
                    MOTOR,
                    (-2.0, 2.0),
                    (sole,) if "ank_roll" in name else (),
                )
            )
    return RigidRobot(1.96, (-0.01, 0.0, 0.08), links, (RigidShape((-0.015, 0.0, 0.066), (0.08, 0.12, 0.14)),))


def scene(floor: Floor | None = None, seed: int = 0) -> PhysicsScene:
    """It stands on a floor, at the origin."""
    return PhysicsScene(
        make_mjcf(figure()), {link.name: MOTOR.backlash for link in figure().links}, floor or Floor(), seed=seed
    )


def crouch(on: PhysicsScene, knee: float, speed: float = 2.0) -> None:
    """Send both legs to a crouch, with level feet."""
    for side in "lr":
        for joint, angle in (("hip_pitch", -knee / 2), ("knee", knee), ("ank_pitch", -knee / 2)):
            on.set_goal(f"{side}_{joint}", angle, speed)
