"""What a robot is to physics: links with masses and shapes, joined by servos; and the floor beneath it. SI units."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from drivers.dynamixel.motor import Motor

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
