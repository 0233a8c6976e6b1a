"""What a robot is to physics: links with masses and shapes, joined by servos; and the floor beneath it. SI units."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import radians

from drivers.servos.models import Motor

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Shape:
    """A box (full sizes), or a capsule from ``at`` to ``to`` of a ``radius``, in the axes of its link.

    A shape that is not ``solid`` weighs nothing and touches nothing: it is seen.
    """

    at: Vector
    size: Vector = (0.0, 0.0, 0.0)
    to: Vector | None = None
    radius: float = 0.0
    solid: bool = True


@dataclass(frozen=True, slots=True)
class Link:
    """What turns about one joint: named after it, ``offset`` from its parent's joint (empty: the trunk).

    At zero all axes are the robot's: x forward, y left, z up. ``centre`` is the centre of mass from the joint, and
    ``spread`` the radius of gyration about it along each axis.
    """

    name: str
    parent: str
    offset: Vector
    axis: Vector
    mass: float
    centre: Vector
    motor: Motor
    limits: tuple[float, float]
    shapes: Sequence[Shape] = ()
    spread: Vector = (0.03, 0.03, 0.03)


@dataclass(frozen=True, slots=True)
class Figure:
    """A robot: its trunk, and the links upon it, each after its parent."""

    mass: float
    centre: Vector
    links: Sequence[Link]
    shapes: Sequence[Shape] = ()
    spread: Vector = (0.06, 0.06, 0.06)


@dataclass(frozen=True, slots=True)
class Push:
    """A push at the trunk: for ``time`` seconds from ``at`` on, such that the robot alone would go at ``speed`` (m/s).

    ``towards`` (rad) is which way, in the world.
    """

    at: float
    speed: float
    towards: float = 0.0
    time: float = 0.1


@dataclass(frozen=True, slots=True)
class Floor:
    """The floor, and what disturbs who stands on it.

    ``friction`` is Coulomb's; ``slope`` (rad) how far the floor rises ahead and to the left. ``masses`` is the share by
    which each mass may be off, drawn by the seed; ``delay`` (s) is from a goal to the servo that hears it.
    """

    friction: float = 1.0
    slope: tuple[float, float] = (0.0, 0.0)
    masses: float = 0.0
    delay: float = 0.0
    pushes: Sequence[Push] = field(default_factory=tuple)


# From a robot's links to MuJoCo's model format (MJCF), as text. It needs no MuJoCo.

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
