"""Conversion of a robot file's body into links of the physics engine."""

from collections.abc import Mapping
from math import sqrt

import numpy as np

from drivers.legs.body import SIDES, Floats, LeggedBody
from drivers.servos.models import MotorPhysics
from drivers.sim.rigid.rigid_model import RigidLink, RigidRobot, RigidShape, Vector

MIN_GYRATION_RADIUS = 0.015
"""Minimum radius of gyration of a link, in metres."""


def figure_of(
    body: LeggedBody, motors: Mapping[str, MotorPhysics], limits: Mapping[str, tuple[float, float]]
) -> RigidRobot:
    """Return a body with its servos and joint limits (rad) for the physics engine."""
    feet = {body.legs[side].joints[-1]: _sole(body, place) for place, side in enumerate(SIDES)}
    links = []
    for place, name in enumerate(body.joints):
        parent, end, radius = body.parent[place], body.end[place], float(body.radius[place])
        reach = max(float(np.linalg.norm(end)) / sqrt(12), radius / sqrt(2), MIN_GYRATION_RADIUS)
        capsule = (RigidShape((0.0, 0.0, 0.0), to=_v(end), radius=radius),) if radius and end.any() else ()
        links.append(
            RigidLink(
                name,
                "" if parent < 0 else body.joints[parent],
                _v(body.offset[place]),
                _v(body.axis[place]),
                float(body.mass[place]),
                _v(body.centre[place]),
                motors[name],
                limits[name],
                (feet[place],) if place in feet else capsule,
                (reach, reach, reach),
            )
        )
    trunk = body.trunk
    x, y, z = trunk.box**2 / 12
    spread = (sqrt(y + z), sqrt(x + z), sqrt(x + y))
    box = RigidShape(_v(trunk.middle), size=_v(trunk.box))
    return RigidRobot(trunk.mass, _v(trunk.centre), links, (box,), spread)


def _sole(body: LeggedBody, place: int) -> RigidShape:
    leg = body.legs[SIDES[place]]
    middle = leg.sole + np.array([0.0, 0.0, leg.thickness / 2])
    return RigidShape(_v(middle), size=(leg.length, leg.width, leg.thickness))


def _v(values: Floats) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
