"""Parameters that a sweep can vary, by name, and their effect on a world file."""

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
"""Times in seconds after the start of a run between which the robot is pushed once."""

ApplyValue = Callable[[PlainMapping, DrawnValue, Random], None]
"""Sets a value in the plain data of a world; ``Random`` makes further random choices of the run. Raises ValueError."""


@dataclass(frozen=True, slots=True)
class SweepParameter:
    """A parameter that a sweep can vary: the ``kind`` of its values, its description, and the function that applies it.

    ``rank`` sorts parameters: those on which others depend are applied first.
    """

    kind: str
    help: str
    apply: ApplyValue
    rank: tuple[int, ...] = ()


def find_parameter(name: str) -> SweepParameter:
    """Return the parameter ``name``. Raises LookupError with similar names, or all names."""
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
    """Return the names of all parameters, as a user writes them."""
    return [*_world_parameters(), *(f"person.{each}" for each in PERSON_PARAMETERS), "param.NAME"]


def _world_parameters() -> dict[str, SweepParameter]:
    return {
        "people": SweepParameter(
            "count", "number of people; additional people stand at random positions", _apply_people
        ),
        "light": _key_parameter("share", "brightness; 100 % is daylight", "light"),
        "noise": _key_parameter("number", "noise of the camera, in grey levels of 255", "noise", "camera"),
        "slip": _key_parameter("share", "share of its path that a wheel slips", "slip", "physics"),
        "lag": _key_parameter("duration", "lag of the wheels", "lag", "physics"),
        "dropouts": _key_parameter("share", "share of the base's reports that are lost", "dropouts", "physics"),
        "friction": _key_parameter("number", "friction of the floor, in physics", "friction", "physics"),
        "masses": _key_parameter("share", "largest error of the robot's masses, in physics", "masses", "physics"),
        "servo_delay": _key_parameter("duration", "delay of servo goals, in physics", "servo_delay", "physics"),
        "slope": SweepParameter("angle", "slope of the floor in a random direction, in physics", _apply_slope, (2,)),
        "push": SweepParameter(
            "speed", "speed of a push at a random time from a random direction, in physics", _apply_push, (2,)
        ),
    }


def _key_parameter(kind: str, words: str, key: str, section: str = "") -> SweepParameter:
    """Return the parameter that sets one key of a world, or of a section of it."""
    unit = next(iter(UNITS[kind])) if kind in UNITS else ""

    def turn(world: PlainMapping, value: DrawnValue, random: Random) -> None:
        del random
        world.pop(key, None)  # noise may also be a top-level key
        mapping = world.setdefault(section, {}) if section else world
        mapping[key] = f"{value} {unit}" if unit else value

    return SweepParameter(kind, words, turn, (2,))


def _apply_slope(world: PlainMapping, value: DrawnValue, random: Random) -> None:
    """Tilt the floor by ``value`` degrees in a random direction."""
    way = radians(360 * random.random())
    world.setdefault("physics", {})["slope"] = [f"{float(value) * part(way):.4f} deg" for part in (cos, sin)]


def _apply_push(world: PlainMapping, value: DrawnValue, random: Random) -> None:
    """Push the robot with ``value`` m/s, once within ``PUSH_WINDOW``, in a random direction."""
    at, way = PUSH_WINDOW[0] + (PUSH_WINDOW[1] - PUSH_WINDOW[0]) * random.random(), 360 * random.random()
    push = {"at": f"{at:.3f} s", "speed": f"{value} m/s", "towards": f"{way:.2f} deg"}
    world.setdefault("physics", {})["pushes"] = [push]


def _apply_people(world: PlainMapping, value: DrawnValue, random: Random) -> None:
    """Keep ``value`` of the people, or add people at random positions."""
    people = world.setdefault("people", [])
    del people[int(value) :]
    x0, y0, heading = start_pose(world)
    for number in range(len(people) + 1, int(value) + 1):
        far = NEAR_DISTANCE + (FAR_DISTANCE - NEAR_DISTANCE) * random.random()
        angle = heading + radians(MAX_BEARING * (2 * random.random() - 1))
        at = [f"{round(place, 4):g} m" for place in (x0 + far * cos(angle), y0 + far * sin(angle))]
        people.append({"name": f"Guest {number}", "look": LOOKS[(number - 1) % len(LOOKS)], "at": at})
