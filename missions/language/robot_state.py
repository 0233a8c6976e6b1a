"""The robot's state that expressions read: the one declaration for checker, expressions, runs, verify and docs."""

from collections.abc import Mapping

from drivers.api.fast_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class StateValue:
    """One value: its kind (a dimension, "percent", "flag" or "text") and its meaning.

    ``options`` are all its values where they are few: verify tries each. ``sense`` is what the camera has to look for.
    ``is_always_known`` marks a value that is known while its part does not report, and ``is_dead_reckoned`` one that is dead reckoning
    where nothing measures how the base moves.
    """

    kind: str
    help: str
    options: tuple[bool | int | str | None, ...] = ()
    sense: str = ""
    is_always_known: bool = False
    is_dead_reckoned: bool = False


@dataclass(frozen=True, slots=True)
class StatePart:
    """Values of one part of the robot; ``sensor`` is the name of the part in messages."""

    part: str
    sensor: str
    values: Mapping[str, StateValue]
    sense: str = ""


def _flag(text: str, *, first: bool = False, sense: str = "", is_always_known: bool = False) -> StateValue:
    """Return a flag; verify tries its value ``first`` before the other."""
    return StateValue("flag", text, (first, not first), sense, is_always_known)


ROBOT_STATE: Mapping[str, StatePart] = {
    "base": StatePart("base", "base", {
        "x": StateValue("length", "Metres ahead of where it started.", is_dead_reckoned=True),
        "y": StateValue("length", "Metres to the left of where it started.", is_dead_reckoned=True),
        "heading": StateValue("angle", "Radians since it started, positive to the left.", is_dead_reckoned=True),
        "reckoned": StateValue(
            "flag",
            "True where nothing measures how it moves: its place is dead reckoning, on which no condition may rest.",
        ),
        "bumper": _flag("True while a bumper is pressed."),
        "cliff": _flag("True while a cliff sensor sees no floor."),
        "wheel_drop": _flag("True while a wheel hangs."),
        "button": StateValue(
            "number",
            "The number of the button that is pressed, the lowest of several; none, while none is.",
            (None, 0, 1, 2),
        ),
        "docked": _flag("True while it stands on the contacts of its dock."),
        "stopped": _flag("True while it is stopped until somebody enables it.", is_always_known=True),
        "driver": StateValue(
            "text",
            "Who commands it: `mission`, `teleop` or `safety`; an empty text while nobody does.",
            ("mission", "teleop", "safety", ""),
            is_always_known=True,
        ),
    }),
    "battery": StatePart("base", "base", {
        "percent": StateValue("percent", "How full it is, 0..100."),
        "voltage": StateValue("voltage", "In volts."),
        "charging": _flag("True while it charges."),
        "low": _flag("True when it is below what the robot file calls low, and was so two seconds ago."),
        "critical": _flag(
            "True when it is below what the robot file calls critical, and was so two seconds ago: the mission ends."
        ),
    }),
    "face": StatePart("camera", "camera", {
        "seen": _flag("True when a face was seen within the last half second.", first=True),
        "count": StateValue("number", "How many faces were seen within the last half second."),
        "id": StateValue("number", "The id of the largest face."),
        "name": StateValue(
            "text",
            "Whose it is: a name, `unknown` for a stranger, an empty text while that is not decided.",
            sense="names",
        ),
        "undecided": _flag("True while a face is seen of which it is not decided whose it is.", sense="names"),
        "distance": StateValue("length", "How far away it is, in metres, guessed from its size."),
        "bearing": StateValue("angle", "How far it is from the camera's axis, in radians, positive to the left."),
    }, sense="faces"),
    "head": StatePart("head", "head", {
        "pan": StateValue("angle", "Radians, positive to the left."),
        "tilt": StateValue("angle", "Radians, positive down."),
    }),
    "range": StatePart("range", "range finder", {
        "nearest": StateValue("length", "Metres to the nearest thing around."),
        "ahead": StateValue(
            "length", "Metres to the nearest thing within 30 degrees left and right of straight ahead."
        ),
    }),
}  # fmt: skip
"""What expressions read, as ``battery.percent``."""


def state_value(part: str, name: str) -> StateValue | None:
    """Return the declaration of ``part.name``; None for a name of something else."""
    found = ROBOT_STATE.get(part)
    return None if found is None else found.values.get(name)
