"""What is declared of the drivers: their keys in robot files, and where the code is that makes them."""

from collections.abc import Iterator, Mapping

from drivers.api.driver import Driver
from drivers.api.keys import Mistake, key, keys
from drivers.api.sections import ArmKeys, BaseKeys, HeadKeys, SerialKeys


@keys
class RoverKeys(BaseKeys, SerialKeys):
    """The ``base`` section of a robot on a rover."""

    baud: int = key(default=38_400, low=1, help="The rate of the port, in bits per second.")
    max_speed: float = key("speed", default=0.4, low=0.05, high=2.0, help="The highest speed.")
    horn: bool = key(default=True, help="Whether it has a horn, for tones and tunes.")

    @property
    def capabilities(self) -> frozenset[str]:
        """A horn is a sounder."""
        return frozenset({"sounds"} if self.horn else ())


@keys
class PeriscopeKeys(HeadKeys):
    """The ``head`` section of a robot whose periscope is two joints of its arm."""

    turned_by: str = key(help="The joint of the arm that turns it.")
    tilted_by: str = key(help="The joint of the arm that tilts it.")


def joints_are_there(periscope: PeriscopeKeys, others: Mapping[str, object]) -> Iterator[Mistake]:
    """Yield joints that the arm lacks."""
    arm = others.get("arm")
    known = arm.limits if isinstance(arm, ArmKeys) else {}
    for word in ("turned_by", "tilted_by"):
        joint = getattr(periscope, word)
        if joint not in known:
            yield Mistake(f"'{word}': the arm has no joint '{joint}'", (word,), seen=joint, known=known)


ROVER = Driver(
    "rover",
    "base",
    "A rover that talks in lines of text.",
    RoverKeys,
    make="sample_robot.rover:make",
    twin="sample_robot.twins:rover",
    virtual="sample_robot.virtual:rover",
    probe="sample_robot.probe:rover",
    checkup="sample_robot.checkup:rover",
)

PERISCOPE = Driver(
    "periscope",
    "head",
    "A periscope of two joints of the arm.",
    PeriscopeKeys,
    make="sample_robot.periscope:make",
    twin="sample_robot.twins:periscope",
    virtual="sample_robot.virtual:periscope",
    needs=("arm",),
    check=joints_are_there,
)
