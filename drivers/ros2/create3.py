"""What a Create 3 (TurtleBot 4) and a TurtleBot 3 say and take besides velocities: contacts, docks, lights, sounds."""

from collections.abc import Iterable
from typing import Any

from drivers.api import Lamp, Sides, Tune
from drivers.api.quick import dataclass
from drivers.base import hazards

BACKUP_LIMIT, BUMP, CLIFF, STALL, WHEEL_DROP, OBJECT_PROXIMITY = range(6)
"""Types of hazards, as irobot_create_msgs numbers them."""

_NAMES = {BACKUP_LIMIT: hazards.BACKUP_LIMIT, STALL: hazards.STALL, OBJECT_PROXIMITY: hazards.OBJECT_NEAR}
"""Names of the hazards that are no contacts."""

COLOURS = {Lamp.OFF: (0, 0, 0), Lamp.RED: (255, 0, 0), Lamp.GREEN: (0, 255, 0), Lamp.ORANGE: (255, 120, 0)}
"""What its ring of lights shows for each colour."""

TUNES: dict[Tune, tuple[int, ...]] = {
    Tune.ON: (523, 659, 784),
    Tune.OFF: (784, 659, 523),
    Tune.RECHARGE: (440, 523),
    Tune.BUTTON: (880,),
    Tune.ERROR: (220, 220),
    Tune.CLEANING_START: (523, 784),
    Tune.CLEANING_END: (784, 523),
}
"""The tunes of a base, as tones in hertz, each for a fifth of a second."""


@dataclass(frozen=True, slots=True)
class HazardReport:
    """Contacts, and the names of all other hazards, as ``BaseState`` has them."""

    bumper: Sides = Sides()
    cliff: Sides = Sides()
    wheel_drop: Sides = Sides()
    others: frozenset[str] = frozenset()

    def __or__(self, other: "HazardReport") -> "HazardReport":
        """Return all hazards that are in one of the two."""
        return HazardReport(
            _either(self.bumper, other.bumper),
            _either(self.cliff, other.cliff),
            _either(self.wheel_drop, other.wheel_drop),
            self.others | other.others,
        )


def report_of(detections: Iterable[Any]) -> HazardReport:
    """Return the contacts and hazards of a Create 3's detections, whose frames name the sides."""
    found: dict[int, set[str]] = {BUMP: set(), CLIFF: set(), WHEEL_DROP: set()}
    others = set()
    for each in detections:
        frame = each.header.frame_id.rpartition("/")[2]  # before that is the name of the robot
        if each.type not in found:
            others.add(_name(each.type, frame))
            continue
        centre = "center" in frame or ("left" not in frame and "right" not in frame)
        found[each.type].add("centre" if centre else "left" if "left" in frame else "right")
    bumper, cliff, drop = (Sides("left" in it, "centre" in it, "right" in it) for it in found.values())
    if cliff and not cliff.centre and cliff.left and cliff.right:
        cliff = Sides(centre=True)  # it has four floor sensors, none in the middle
    return HazardReport(bumper, cliff, drop, frozenset(others))


def _name(kind: int, frame: str) -> str:
    """Return the name of a hazard that is no contact, also of a type of a newer firmware."""
    if kind not in _NAMES:
        return f"{hazards.UNKNOWN} {kind}" + (f" ({frame:.40})" if frame else "")
    side = "" if kind == BACKUP_LIMIT else next((side for side in ("left", "right") if side in frame), "")
    return f"{_NAMES[kind]} {side}".rstrip()


def _either(one: Sides, other: Sides) -> Sides:
    return Sides(one.left or other.left, one.centre or other.centre, one.right or other.right)


def ring(first: Lamp, second: Lamp) -> dict[str, object]:
    """Return what its ring of lights is told: the left half is light 1, the right half light 2."""
    leds = [dict(zip(("red", "green", "blue"), COLOURS[each], strict=True)) for each in (first, second)]
    shown = [leds[0]] * 3 + [leds[1]] * 3
    return {"leds": shown, "override_system": (first, second) != (Lamp.OFF, Lamp.OFF)}


def notes(tones: Iterable[int], seconds: float) -> dict[str, object]:
    """Return what its sounder is told: these tones (Hz), each for so long."""
    runtime = {"sec": int(seconds), "nanosec": round(seconds % 1 * 1e9)}
    return {"notes": [{"frequency": each, "max_runtime": runtime} for each in tones]}
