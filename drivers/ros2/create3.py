"""What a Create 3 (TurtleBot 4) and a TurtleBot 3 say and take besides velocities: contacts, docks, lights, sounds."""

from collections.abc import Iterable
from typing import Any

from drivers.api import Lamp, Sides, Tune

BUMP, CLIFF, WHEEL_DROP = 1, 2, 4
"""Types of hazards, as irobot_create_msgs numbers them."""

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


def felt(hazards: Iterable[Any]) -> tuple[Sides, Sides, Sides]:
    """Return bumper, cliff and wheel drop of a Create 3's hazards, whose frames say on which side they are."""
    found: dict[int, set[str]] = {BUMP: set(), CLIFF: set(), WHEEL_DROP: set()}
    for each in hazards:
        if each.type in found:
            frame = each.header.frame_id.rpartition("/")[2]  # before that is the name of the robot
            centre = "center" in frame or ("left" not in frame and "right" not in frame)
            found[each.type].add("centre" if centre else "left" if "left" in frame else "right")
    bumper, cliff, drop = (Sides("left" in it, "centre" in it, "right" in it) for it in found.values())
    if cliff and not cliff.centre and cliff.left and cliff.right:
        cliff = Sides(centre=True)  # it has four floor sensors, none in the middle
    return bumper, cliff, drop


def ring(first: Lamp, second: Lamp) -> dict[str, object]:
    """Return what its ring of lights is told: the left half is light 1, the right half light 2."""
    leds = [dict(zip(("red", "green", "blue"), COLOURS[each], strict=True)) for each in (first, second)]
    shown = [leds[0]] * 3 + [leds[1]] * 3
    return {"leds": shown, "override_system": (first, second) != (Lamp.OFF, Lamp.OFF)}


def notes(tones: Iterable[int], seconds: float) -> dict[str, object]:
    """Return what its sounder is told: these tones (Hz), each for so long."""
    runtime = {"sec": int(seconds), "nanosec": round(seconds % 1 * 1e9)}
    return {"notes": [{"frequency": each, "max_runtime": runtime} for each in tones]}
