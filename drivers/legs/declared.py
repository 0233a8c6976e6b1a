"""Driver declaration and robot-file keys of a walking base and its body.

The frame of the trunk has x forward, y left, z up, and its origin between the hips. At angle 0 of all joints the frame
of every link is parallel to that of the trunk. A robot file describes the left half of the body; the right half is its
mirror image.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Literal

from drivers.api.driver import Driver
from drivers.api.keys import KeyDiagnostic, inside, key, keys
from drivers.api.sections import ArmKeys, BaseKeys

Vector = tuple[float, float, float]

ORIGIN = (0.0, 0.0, 0.0)


@keys
class TrunkKeys:
    """The trunk, which carries the legs, the arms and the head."""

    mass: float = key("mass", low=0.001, help="Mass, with computer and batteries.")
    centre: Vector = key("length", help="Centre of mass: [x, y, z].")
    box: Vector = key("length", help="Length, width and height of its box.")
    middle: Vector = key("length", default=ORIGIN, help="The middle of that box.")


@keys
class LinkKeys:
    """A link, with the name of the joint that turns it."""

    parent: str = key(default="trunk", word="from", help="Parent link: `trunk`, or an earlier link.")
    offset: Vector = key("length", help="Its origin, on the joint's axis, from the parent's origin.")
    axis: Literal["x", "-x", "y", "-y", "z", "-z"] = key(help="Axis of positive rotation (anticlockwise).")
    mass: float = key("mass", default=0.0, low=0.0, help="Mass, with its servos.")
    centre: Vector = key("length", default=ORIGIN, help="Centre of mass, from its origin.")
    end: Vector = key("length", default=ORIGIN, help="Far end of its capsule, from its origin.")
    radius: float = key("length", default=0.0, low=0.0, help="Radius of the capsule; 0: no collisions.")
    tucked: float | None = key("angle", default=None, help="Angle of its joint in a fall, to draw in an arm.")


@keys
class FootKeys:
    """The left sole: a plate under the last joint of the leg."""

    length: float = key("length", low=0.01, help="Along x.")
    width: float = key("length", low=0.01, help="Along y.")
    thickness: float = key("length", default=0.008, low=0.001, help="Along z.")
    centre: Vector = key("length", help="The middle of its lower face, from the origin of the last joint of the leg.")


@keys
class BodyKeys:
    """The body of a humanoid: its links from joint to joint, with lengths and masses."""

    mirrored: Literal["same", "opposite"] = key(
        default="same", help="Right and left are mirror images at the same, or at opposite angles."
    )
    left: str = key(default="left_", help="Prefix of the joints of the left side.")
    right: str = key(default="right_", help="Prefix of the joints of the right side.")
    trunk: TrunkKeys = key(help="The trunk.")
    links: Mapping[str, Annotated[LinkKeys, inside(each="link")]] = key(
        help="The links of the left side and of the middle, by the names of their joints.",
    )
    leg: tuple[str, ...] = key(help="The joints of the left leg: hip turn, roll and pitch, knee, ankle pitch and roll.")
    foot: FootKeys = key(help="The left sole.")

    def mirror(self, name: str) -> str:
        """Return the name of the right joint for the left joint ``name``; a joint in the middle keeps its name."""
        return self.right + name.removeprefix(self.left) if name.startswith(self.left) else name

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of all joints: left and middle ones in the order of the robot file, then the right ones."""
        return (*self.links, *(self.mirror(name) for name in self.links if self.mirror(name) != name))

    @property
    def tucked_angles(self) -> Mapping[str, float]:
        """Angles (rad) to which joints move when the robot falls, by joint, for both sides."""
        image = -1.0 if self.mirrored == "opposite" else 1.0
        left = {name: link.tucked for name, link in self.links.items() if link.tucked is not None}
        return {self.mirror(name): image * angle for name, angle in left.items()} | left

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic for each link without a valid parent, and for invalid legs."""
        if not self.left or self.left == self.right:
            yield KeyDiagnostic("'left' and 'right' must differ", ("left",), ("right",), about=(("left",), ("right",)))
        before = ["trunk"]
        for name, link in self.links.items():
            at = ("links", name, "from")
            if link.parent not in before:
                message = f"link '{name}' has the parent '{link.parent}', which is no link before it"
                yield KeyDiagnostic(
                    message, at, ("links", name), unknown_word=link.parent, known_words=before, about=(at,)
                )
            before.append(name)
            if (image := self.mirror(name)) != name and image in self.links:
                message = f"link '{image}' is the mirror image of '{name}': write only that one"
                yield KeyDiagnostic(message, ("links", image), about=(("links", image),))
        yield from self._leg_chain_mistakes()
        if len(self.leg) == 6 and {*self.leg} <= {*self.links}:
            yield from self._leg_axis_mistakes()

    def _leg_chain_mistakes(self) -> Iterator[KeyDiagnostic]:
        """Yield diagnostics if the joints of ``leg`` are not one chain of six on the left."""
        if len(self.leg) != 6:
            yield KeyDiagnostic("'leg' needs 6 joints, from the hip to the foot", ("leg",), about=(("leg",),))
        for place, name in enumerate(self.leg):
            at = ("leg", place)
            if name not in self.links:
                yield KeyDiagnostic(
                    f"'leg': there is no link '{name}'",
                    at,
                    unknown_word=name,
                    known_words=self.links,
                    about=(("leg",),),
                )
            elif not name.startswith(self.left):
                yield KeyDiagnostic(
                    f"'leg': '{name}' does not begin with '{self.left}'", at, about=(("leg",), ("left",))
                )
            elif place and self.leg[place - 1] in self.links and self.links[name].parent != self.leg[place - 1]:
                message = f"'leg': '{name}' is not carried by '{self.leg[place - 1]}'"
                yield KeyDiagnostic(message, at, about=(("leg",), ("links", name, "from")))

    def _leg_axis_mistakes(self) -> Iterator[KeyDiagnostic]:
        """Yield diagnostics for axes of the leg for which its angles cannot be computed in closed form."""
        links = [self.links[name] for name in self.leg]
        for name, link, axis in zip(self.leg, links, "zxyyyx", strict=True):
            if link.axis[-1] != axis:
                at = ("links", name, "axis")
                yield KeyDiagnostic(f"'{name}' must turn about {axis}, or -{axis}", at, about=(at, ("leg",)))
        for name, link, along, where in (
            (self.leg[1], links[1], (0, 2), "above or below, or ahead of, the joint before it"),
            (self.leg[5], links[5], (0, 1), "ahead of, or beside, the joint before it"),
        ):
            if any(abs(link.offset[axis]) > 1e-9 for axis in range(3) if axis not in along):
                at = ("links", name, "offset")
                yield KeyDiagnostic(
                    f"'{name}' must lie {where}: its axis has to meet that one's", at, about=(at, ("leg",))
                )


@keys
class StrideKeys:
    """Parameters of the walk."""

    period: float = key("duration", default=0.8, low=0.3, high=5.0, help="The time of two steps.")
    double_support: float = key("share", default=0.25, low=0.05, high=0.8, help="Share of a step on both feet.")
    rise: float = key("length", default=0.03, low=0.0, high=0.3, help="How high a foot is lifted.")
    height: float = key("length", low=0.05, high=2.0, help="Height of the trunk's origin above the soles.")
    feet: float | None = key(
        "length", default=None, low=0.01, help="Distance between the soles; by default that at angle 0."
    )
    inset: float = key("length", default=0.0, help="Distance of the pressure inwards from a sole's middle.")
    sway: float | None = key(
        "length", default=None, low=0.0, high=0.2, help="Sway of the body to either side; by default from `inset`."
    )
    lean: float = key("angle", default=0.0, low=-0.6, high=0.6, help="Forward lean of the trunk.")
    sit: float | None = key(
        "length", default=None, low=0.05, help="The height when it sits; by default 70 % of `height`."
    )
    longest: float = key("length", default=0.08, low=0.001, help="The longest step: from one foot to the other.")
    widest: float = key("length", default=0.04, low=0.0, help="The widest step to the side.")
    most_turn: float = key("angle", default=0.35, low=0.0, high=1.0, help="Maximum turn of a step.")


@keys
class LegsKeys(BaseKeys):
    """The ``base`` section of a robot that walks on two legs, whose joints are those of its arm section."""

    body: BodyKeys = key(help="Its body.")
    stride: StrideKeys = key(help="Parameters of the walk.")
    max_speed: float = key("speed", default=0.2, low=0.01, high=5.0, help="The highest speed.")
    max_turn: float = key("turn rate", default=0.6, low=0.01, high=12.0, help="The highest turn rate.")
    model: str = key(
        default="", help="MuJoCo model for `--physics`, relative to this file; by default it is made from the body."
    )
    at_fall: Literal["relax", "hold"] = key(
        default="relax", help="After a fall it switches its torque off, or keeps it."
    )

    @property
    def capabilities(self) -> frozenset[str]:
        """Optional capabilities of a walking base: only legs."""
        return frozenset({"legs"})


def check_leg_joints(keys: LegsKeys, others: Mapping[str, object]) -> Iterator[KeyDiagnostic]:
    """Yield a diagnostic for each joint of the body that is missing in the arm section of the robot file."""
    arm = others.get("arm")
    if not isinstance(arm, ArmKeys):
        message = "legs are joints of the arm section: this robot has none"
        yield KeyDiagnostic(message, ("body",), about=(("body",),))
        return
    known = arm.limits
    for name in keys.body.links:
        at = ("body", "links", name)
        for joint in dict.fromkeys((name, keys.body.mirror(name))):
            if joint not in known:
                message = f"body: there is no joint '{joint}' in 'arm'"
                yield KeyDiagnostic(message, at, marks_key=True, unknown_word=joint, known_words=known, about=(at,))


LEGS = Driver(
    "legs",
    "base",
    "Two legs that walk: joints of the robot's arm section.",
    LegsKeys,
    make="drivers.legs.make:make",
    twin="drivers.legs.twin:make",
    virtual="drivers.legs.virtual:make",
    needs=("arm", "imu"),
    check=check_leg_joints,
)
