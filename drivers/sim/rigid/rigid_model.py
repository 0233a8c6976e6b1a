"""Physical model of a robot: links with masses and shapes, joined by servos; and the floor. SI units."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import radians

from drivers.servos.models import MotorPhysics

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class RigidShape:
    """A box with full side lengths ``size``, or a capsule from ``at`` to ``to``, in the axes of its link.

    A shape that is not ``solid`` has no mass and no contacts; it is only visible.
    """

    at: Vector
    size: Vector = (0.0, 0.0, 0.0)
    to: Vector | None = None
    radius: float = 0.0
    solid: bool = True


@dataclass(frozen=True, slots=True)
class RigidLink:
    """Link of a robot and its joint of the same ``name``, at ``offset`` from that of ``parent`` (empty: the trunk).

    At joint angle 0, all axes are those of the robot: x forward, y left, z up. ``centre`` is the position of the centre
    of mass from the joint. ``spread`` has the radius of gyration about each axis through the centre of mass.
    """

    name: str
    parent: str
    offset: Vector
    axis: Vector
    mass: float
    centre: Vector
    motor: MotorPhysics
    limits: tuple[float, float]
    shapes: Sequence[RigidShape] = ()
    spread: Vector = (0.03, 0.03, 0.03)


@dataclass(frozen=True, slots=True)
class RigidRobot:
    """Physical model of a robot: its trunk, and its links, each after its parent."""

    mass: float
    centre: Vector
    links: Sequence[RigidLink]
    shapes: Sequence[RigidShape] = ()
    spread: Vector = (0.06, 0.06, 0.06)


@dataclass(frozen=True, slots=True)
class TrunkPush:
    """A push on the trunk for ``duration`` seconds, beginning at time ``at``.

    The force would accelerate the robot to ``speed`` (m/s) if it were free to move. ``direction`` is an angle in the
    world frame, in radians.
    """

    at: float
    speed: float
    direction: float = 0.0
    duration: float = 0.1


@dataclass(frozen=True, slots=True)
class Floor:
    """Floor of a physics scene, and disturbances of the robot on it.

    ``friction`` is Coulomb's coefficient; ``slope`` (rad) is the rise ahead and to the left. Each mass of the robot is
    changed by a random share of at most ``mass_error``, which the scene's seed fixes. ``servo_delay`` (s) is the delay
    from a goal to the servo. ``pushes`` act on the trunk.
    """

    friction: float = 1.0
    slope: tuple[float, float] = (0.0, 0.0)
    mass_error: float = 0.0
    servo_delay: float = 0.0
    pushes: Sequence[TrunkPush] = field(default_factory=tuple)


# From a robot's links to MuJoCo's model format (MJCF), as text. It needs no MuJoCo.

TRUNK = "trunk"
"""Name of the root body of a robot. A joint must not have this name."""


def make_mjcf(figure: RigidRobot) -> str:
    """Return the model of a robot without a floor, in MuJoCo's format MJCF."""
    below: dict[str, list[RigidLink]] = {}
    for link in figure.links:
        below.setdefault(link.parent, []).append(link)
    trunk = _inertial_element(figure.mass, figure.centre, figure.spread)
    limbs = "".join(_link_element(each, below) for each in below.get("", ()))
    servos = "".join(
        f'<position name="{link.name}" joint="{link.name}" kp="{_format_number(link.motor.stiffness)}" '
        f'forcerange="{_format_number(-link.motor.torque)} {_format_number(link.motor.torque)}"/>'
        for link in figure.links
    )
    return (
        '<mujoco><compiler angle="radian" autolimits="true"/>'
        '<default><geom rgba="0.35 0.5 0.7 1"/></default>'
        f'<worldbody><body name="{TRUNK}"><freejoint/>{trunk}{_shape_elements(figure.shapes)}{limbs}</body></worldbody>'
        f"<actuator>{servos}</actuator></mujoco>"
    )


def _link_element(link: RigidLink, below: Mapping[str, Iterable[RigidLink]]) -> str:
    motor = link.motor
    low, high = (end + way * radians(3) for end, way in zip(link.limits, (-1, 1), strict=True))
    limbs = "".join(_link_element(each, below) for each in below.get(link.name, ()))
    return (
        f'<body name="{link.name}" pos="{_format_vector(link.offset)}">'
        f'<joint name="{link.name}" axis="{_format_vector(link.axis)}" '
        f'range="{_format_number(low)} {_format_number(high)}" damping="{_format_number(motor.damping)}" '
        f'armature="{_format_number(motor.inertia)}" frictionloss="{_format_number(motor.friction)}"/>'
        f"{_inertial_element(link.mass, link.centre, link.spread)}{_shape_elements(link.shapes)}{limbs}</body>"
    )


def _inertial_element(mass: float, centre: Vector, spread: Vector) -> str:
    moments = (mass * radius * radius for radius in spread)
    return (
        f'<inertial mass="{_format_number(mass)}" pos="{_format_vector(centre)}" '
        f'diaginertia="{_format_vector(moments)}"/>'
    )


def _shape_elements(shapes: Iterable[RigidShape]) -> str:
    """Return shapes in MJCF that touch the floor, but not each other.

    Collisions between limbs are not simulated; ``drivers.legs.gait_check`` finds gaits that would cause them.
    """
    return "".join(
        f"<geom {_shape_attributes(shape)} "
        + ('contype="2" conaffinity="1"' if shape.solid else 'contype="0" conaffinity="0"')
        + "/>"
        for shape in shapes
    )


def _shape_attributes(shape: RigidShape) -> str:
    if shape.to is None:
        return (
            f'type="box" pos="{_format_vector(shape.at)}" size="{_format_vector(length / 2 for length in shape.size)}"'
        )
    ends = f"{_format_vector(shape.at)} {_format_vector(shape.to)}"
    return f'type="capsule" size="{_format_number(shape.radius)}" fromto="{ends}"'


def _format_vector(values: Iterable[float]) -> str:
    return " ".join(map(_format_number, values))


def _format_number(value: float) -> str:
    return f"{value:.9g}"
