"""From a robot's links to MuJoCo's model format (MJCF), as text. It needs no MuJoCo."""

from collections.abc import Iterable, Mapping
from math import radians

from drivers.sim.rigid.links import Figure, Link, Shape, Vector

TRUNK = "trunk"
"""The body that everything hangs on; whose name no joint may have."""


def mjcf(figure: Figure) -> str:
    """Return the model of a robot, without a floor."""
    below: dict[str, list[Link]] = {}
    for link in figure.links:
        below.setdefault(link.parent, []).append(link)
    trunk = _inertial(figure.mass, figure.centre, figure.spread)
    limbs = "".join(_link(each, below) for each in below.get("", ()))
    servos = "".join(
        f'<position name="{link.name}" joint="{link.name}" kp="{_n(link.motor.stiffness)}" '
        f'forcerange="{_n(-link.motor.torque)} {_n(link.motor.torque)}"/>'
        for link in figure.links
    )
    return (
        '<mujoco><compiler angle="radian" autolimits="true"/>'
        '<default><geom rgba="0.35 0.5 0.7 1"/></default>'
        f'<worldbody><body name="{TRUNK}"><freejoint/>{trunk}{_shapes(figure.shapes)}{limbs}</body></worldbody>'
        f"<actuator>{servos}</actuator></mujoco>"
    )


def _link(link: Link, below: Mapping[str, Iterable[Link]]) -> str:
    motor = link.motor
    low, high = (end + way * radians(3) for end, way in zip(link.limits, (-1, 1), strict=True))
    limbs = "".join(_link(each, below) for each in below.get(link.name, ()))
    return (
        f'<body name="{link.name}" pos="{_v(link.offset)}">'
        f'<joint name="{link.name}" axis="{_v(link.axis)}" range="{_n(low)} {_n(high)}" damping="{_n(motor.damping)}" '
        f'armature="{_n(motor.inertia)}" frictionloss="{_n(motor.friction)}"/>'
        f"{_inertial(link.mass, link.centre, link.spread)}{_shapes(link.shapes)}{limbs}</body>"
    )


def _inertial(mass: float, centre: Vector, spread: Vector) -> str:
    moments = (mass * radius * radius for radius in spread)
    return f'<inertial mass="{_n(mass)}" pos="{_v(centre)}" diaginertia="{_v(moments)}"/>'


def _shapes(shapes: Iterable[Shape]) -> str:
    """Return shapes that touch the floor, and not each other: limbs that would hit are what gaits are checked for."""
    return "".join(
        f"<geom {_form(shape)} "
        + ('contype="2" conaffinity="1"' if shape.solid else 'contype="0" conaffinity="0"')
        + "/>"
        for shape in shapes
    )


def _form(shape: Shape) -> str:
    if shape.to is None:
        return f'type="box" pos="{_v(shape.at)}" size="{_v(length / 2 for length in shape.size)}"'
    return f'type="capsule" size="{_n(shape.radius)}" fromto="{_v(shape.at)} {_v(shape.to)}"'


def _v(values: Iterable[float]) -> str:
    return " ".join(map(_n, values))


def _n(value: float) -> str:
    return f"{value:.9g}"
