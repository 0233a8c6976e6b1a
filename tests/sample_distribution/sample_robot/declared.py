"""Declarations of the drivers: their keys in robot files, and the dotted names of their factories."""

from collections.abc import Iterator, Mapping

from drivers.api.driver import Driver
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.sections import ArmKeys, BaseKeys, HeadKeys, SerialKeys


@keys
class RoverKeys(BaseKeys, SerialKeys):
    """Keys of a rover."""

    baud: int = key(default=38_400, low=1, help="Baud rate of the port.")
    max_speed: float = key("speed", default=0.4, low=0.05, high=2.0, help="Maximum speed.")
    horn: bool = key(default=True, help="Whether it has a horn, for tones and tunes.")

    @property
    def capabilities(self) -> frozenset[str]:
        """The sounder, if there is a horn."""
        return frozenset({"sounds"} if self.horn else ())


@keys
class PeriscopeKeys(HeadKeys):
    """Keys of a periscope, which is two joints of the arm."""

    turned_by: str = key(help="Joint of the arm that turns it.")
    tilted_by: str = key(help="Joint of the arm that tilts it.")


def check_joints(periscope: PeriscopeKeys, others: Mapping[str, object]) -> Iterator[KeyDiagnostic]:
    """Yield joints that the arm does not have."""
    arm = others.get("arm")
    known = arm.limits if isinstance(arm, ArmKeys) else {}
    for word in ("turned_by", "tilted_by"):
        joint = getattr(periscope, word)
        if joint not in known:
            message = f"'{word}': the arm has no joint '{joint}'"
            yield KeyDiagnostic(message, (word,), unknown_word=joint, known_words=known)


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
    check=check_joints,
)
