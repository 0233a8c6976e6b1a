"""Body of a humanoid as arrays, for kinematics, gaits and physics.

Lengths in metres, masses in kilograms, in frames with x forward, y left, z up; (N, 3) arrays have a row per joint.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from drivers.legs.declared import BodyKeys, LinkKeys

Floats = npt.NDArray[np.float64]
Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")

AXES: Mapping[str, tuple[float, float, float]] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

MIRROR_SIGNS = np.array([1.0, -1.0, 1.0])
"""Factors that mirror a position, left to right."""


@dataclass(frozen=True)
class Trunk:
    """The trunk: its mass, its centre of mass, and the box that it fills around its ``middle``."""

    mass: float
    centre: Floats
    box: Floats
    middle: Floats


@dataclass(frozen=True)
class Leg:
    """A leg: indices of its six joints, hip turn to ankle roll, and its sole.

    ``sole`` is the position of the middle of the sole's lower face, relative to the origin of the last joint.
    """

    joints: tuple[int, ...]
    sole: Floats
    length: float
    width: float
    thickness: float


@dataclass(frozen=True, eq=False)
class LeggedBody:
    """A body of N joints, each of which turns one link, parents before children; parent -1 is the trunk.

    ``offset`` is the vector from the origin of the parent link to the origin of the link, which is on the joint's
    ``axis``. ``centre`` and ``end`` are the link's centre of mass and the far end of its capsule, from the origin of
    the link. The mirror image of a pose ``q`` is ``sign * q[swap]``.
    """

    joints: tuple[str, ...]
    parent: tuple[int, ...]
    offset: Floats
    axis: Floats
    mass: Floats
    centre: Floats
    end: Floats
    radius: Floats
    trunk: Trunk
    legs: Mapping[Side, Leg]
    swap: npt.NDArray[np.intp]
    sign: Floats

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Index of each joint, by name."""
        return {name: place for place, name in enumerate(self.joints)}

    @cached_property
    def total_mass(self) -> float:
        """Mass of the whole body."""
        return self.trunk.mass + float(self.mass.sum())

    @cached_property
    def leg_joints(self) -> tuple[str, ...]:
        """Names of the joints of both legs, the left ones first."""
        return tuple(self.joints[place] for side in SIDES for place in self.legs[side].joints)

    @cached_property
    def leg_indices(self) -> npt.NDArray[np.intp]:
        """Indices of the joints of both legs, the left ones first."""
        return np.array([place for side in SIDES for place in self.legs[side].joints])

    def pose(self, angles: Mapping[str, float]) -> Floats:
        """Return the angles (N) of a pose by name; other joints are at 0."""
        return np.array([angles.get(name, 0.0) for name in self.joints])

    def mirror(self, q: Floats) -> Floats:
        """Return the mirror image of poses (..., N)."""
        image: Floats = self.sign * q[..., self.swap]
        return image


def body_of(keys: BodyKeys) -> LeggedBody:
    """Return the body of a robot file, with the right half mirrored from the left one."""
    names = keys.joints
    place = {name: at for at, name in enumerate(names)}
    written = [(name, keys.links[name], False) for name in keys.links]
    mirrored = [(keys.mirror(n), keys.links[n], True) for n in keys.links if keys.mirror(n) != n]
    links = written + mirrored

    def row(get: str) -> Floats:
        return np.array([MIRROR_SIGNS * getattr(link, get) if flip else getattr(link, get) for _, link, flip in links])

    def parent(link: LinkKeys, *, flip: bool) -> int:
        name = keys.mirror(link.parent) if flip else link.parent
        return place.get(name, -1)

    image = {name: keys.mirror(name) for name in keys.links} | {keys.mirror(name): name for name in keys.links}
    swap = np.array([place[image[name]] for name in names])
    turned = -1.0 if keys.mirrored == "opposite" else 1.0
    foot = keys.foot
    middle = [name for name in names if image[name] == name]

    def leg(side: Side) -> Leg:
        joints = tuple(place[name if side == "left" else keys.mirror(name)] for name in keys.leg)
        centre = np.array(foot.centre) * (1.0 if side == "left" else MIRROR_SIGNS)
        return Leg(joints, centre, foot.length, foot.width, foot.thickness)

    sign = np.array([_mirror_sign(keys.links[name]) if name in middle else turned for name in names])
    trunk = keys.trunk
    return LeggedBody(
        names,
        tuple(parent(link, flip=flip) for _, link, flip in links),
        row("offset"),
        np.array([_axis(link, flip=flip, turned=turned) for _, link, flip in links]),
        np.array([link.mass for _, link, _ in links]),
        row("centre"),
        row("end"),
        np.array([link.radius for _, link, _ in links]),
        Trunk(trunk.mass, np.array(trunk.centre), np.array(trunk.box), np.array(trunk.middle)),
        {side: leg(side) for side in SIDES},
        swap,
        sign,
    )


def _axis(link: LinkKeys, *, flip: bool, turned: float) -> Floats:
    """Return the axis of a joint; with ``flip`` that of its mirror image, in which turns about x and z are reversed."""
    axis = np.array(AXES[link.axis[-1]]) * (-1.0 if link.axis.startswith("-") else 1.0)
    return -turned * MIRROR_SIGNS * axis if flip else axis


def _mirror_sign(link: LinkKeys) -> float:
    """Return the factor by which a mirror image multiplies the angle of a joint in the middle of the body.

    It is -1 for turn and roll, else 1.
    """
    return 1.0 if link.axis[-1] == "y" else -1.0
