"""What can be varied in a world, by name, and how a world file changes by it."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from math import cos, radians, sin
from random import Random

from config.diagnostics import did_you_mean
from config.units import UNITS, quoted_value
from config.world_items import LOOKS
from missions.plugins.testing.sweep.people import PERSON_PARAMETERS, PlainMapping, start_pose
from missions.plugins.testing.sweep.variation import DrawnValue

NEAR_DISTANCE, FAR_DISTANCE, MAX_BEARING = 1.2, 3.0, 50.0
"""Metres between which they stand from the robot, and degrees to each side of it."""

PUSH_WINDOW = 3.0, 7.0
"""Seconds from the beginning between which a robot is pushed."""

ApplyValue = Callable[[PlainMapping, DrawnValue, Random], None]
"""Sets a value in a world's plain data; what else is drawn by chance, from this run's own. Raises ValueError."""


@dataclass(frozen=True, slots=True)
class SweepParameter:
    """One thing that can be varied: the ``kind`` of its values, what it is, and what sets it.

    ``rank`` sorts: what others build on is turned first.
    """

    kind: str
    help: str
    apply: ApplyValue
    rank: tuple[int, ...] = ()


def find_parameter(name: str) -> SweepParameter:
    """Return what ``name`` varies. Raises LookupError with what is near it, or all there is."""
    knobs = _world_parameters()
    if name in knobs:
        return knobs[name]
    found = re.fullmatch(r"person([1-9][0-9]{0,3})?\.(\w+)", name)
    if found is None or found[2] not in PERSON_PARAMETERS:
        known = parameter_names()
        raise LookupError(did_you_mean(name, known) or f"known are: {', '.join(known)}")
    number = int(found[1] or 1)
    kind, turn, words = PERSON_PARAMETERS[found[2]]

    def turn_person(world: PlainMapping, value: DrawnValue, random: Random) -> None:
        del random
        people = world.get("people") or []
        if number > len(people):
            raise ValueError(f"the world {quoted_value(world.get('world', ''))} has no person {number}")
        turn(world, people[number - 1], value)

    return SweepParameter(kind, words, turn_person, (1, number, list(PERSON_PARAMETERS).index(found[2])))


def parameter_names() -> list[str]:
    """Return all that can be varied, as a user writes it."""
    return [*_world_parameters(), *(f"person.{each}" for each in PERSON_PARAMETERS), "param.NAME"]


def _world_parameters() -> dict[str, SweepParameter]:
    return {
        "people": SweepParameter(
            "count", "how many people there are; those that the world lacks stand anywhere", _apply_people
        ),
        "light": _key_parameter("share", "the light, where 100 % is daylight", "light"),
        "noise": _key_parameter("number", "noise of the camera, in grey levels of 255", "noise", "camera"),
        "slip": _key_parameter("share", "how much of its way a wheel slips", "slip", "physics"),
        "lag": _key_parameter("duration", "how late the wheels follow", "lag", "physics"),
        "dropouts": _key_parameter("share", "how many of the base's reports are lost", "dropouts", "physics"),
        "friction": _key_parameter("number", "the friction of the floor, in physics", "friction", "physics"),
        "masses": _key_parameter(
            "share", "how far each mass of the robot is off at most, in physics", "masses", "physics"
        ),
        "servo_delay": _key_parameter(
            "duration", "how late servos hear of their goals, in physics", "servo_delay", "physics"
        ),
        "slope": SweepParameter("angle", "how steep the floor is, whichever way, in physics", _apply_slope, (2,)),
        "push": SweepParameter(
            "speed", "a push at the robot, whenever and whichever way, in physics", _apply_push, (2,)
        ),
    }


def _key_parameter(kind: str, words: str, key: str, section: str = "") -> SweepParameter:
    """Return what sets one key of a world, or of a section of it."""
    unit = next(iter(UNITS[kind])) if kind in UNITS else ""

    def turn(world: PlainMapping, value: DrawnValue, random: Random) -> None:
        del random
        world.pop(key, None)  # noise may stand at the top of the file as well
        mapping = world.setdefault(section, {}) if section else world
        mapping[key] = f"{value} {unit}" if unit else value

    return SweepParameter(kind, words, turn, (2,))


def _apply_slope(world: PlainMapping, value: DrawnValue, random: Random) -> None:
    """Have the floor rise by so much (degrees), whichever way."""
    way = radians(360 * random.random())
    world.setdefault("physics", {})["slope"] = [f"{float(value) * part(way):.4f} deg" for part in (cos, sin)]


def _apply_push(world: PlainMapping, value: DrawnValue, random: Random) -> None:
    """Push the robot so hard (m/s), once within ``PUSH_WINDOW`` seconds, whichever way."""
    at, way = PUSH_WINDOW[0] + (PUSH_WINDOW[1] - PUSH_WINDOW[0]) * random.random(), 360 * random.random()
    push = {"at": f"{at:.3f} s", "speed": f"{value} m/s", "towards": f"{way:.2f} deg"}
    world.setdefault("physics", {})["pushes"] = [push]


def _apply_people(world: PlainMapping, value: DrawnValue, random: Random) -> None:
    """Leave so many of the people, or have more come, each to a place drawn by chance."""
    people = world.setdefault("people", [])
    del people[int(value) :]
    x0, y0, heading = start_pose(world)
    for number in range(len(people) + 1, int(value) + 1):
        far = NEAR_DISTANCE + (FAR_DISTANCE - NEAR_DISTANCE) * random.random()
        angle = heading + radians(MAX_BEARING * (2 * random.random() - 1))
        at = [f"{round(place, 4):g} m" for place in (x0 + far * cos(angle), y0 + far * sin(angle))]
        people.append({"name": f"Guest {number}", "look": LOOKS[(number - 1) % len(LOOKS)], "at": at})
