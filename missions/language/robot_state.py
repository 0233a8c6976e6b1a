"""The robot's state in expressions, declared once for checker, runs, verify and docs."""

from collections.abc import Mapping

from drivers.api.fast_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class StateValue:
    """Value of a robot's part that expressions read: its kind (a dimension, "percent", "flag" or "text") and help.

    ``options`` are all its values if they are few; ``mission verify`` tries each. ``sense`` is the detector that it
    needs. ``is_always_known`` is true if the value is known even while its part does not report. ``is_dead_reckoned``
    is true for a value that a base without odometry computes by dead reckoning.
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
    """Return a state value that is true or false; ``mission verify`` tries the value ``first`` before the other."""
    return StateValue("flag", text, (first, not first), sense, is_always_known)


ROBOT_STATE: Mapping[str, StatePart] = {
    "base": StatePart("base", "base", {
        "x": StateValue("length", "Position ahead of the start, in metres.", is_dead_reckoned=True),
        "y": StateValue("length", "Position to the left of the start, in metres.", is_dead_reckoned=True),
        "heading": StateValue(
            "angle", "Heading relative to the start, in radians, positive to the left.", is_dead_reckoned=True
        ),
        "reckoned": StateValue(
            "flag",
            "True if the base does not measure its motion: its pose is dead reckoning, which no condition may use.",
        ),
        "bumper": _flag("True while a bumper is pressed."),
        "cliff": _flag("True while a cliff sensor sees no floor."),
        "wheel_drop": _flag("True while a wheel hangs."),
        "button": StateValue(
            "number",
            "Number of the pressed button, the lowest of several; none if no button is pressed.",
            (None, 0, 1, 2),
        ),
        "docked": _flag("True while the base is on the contacts of its dock."),
        "stopped": _flag("True while the base is latched: stopped until a person enables it.", is_always_known=True),
        "driver": StateValue(
            "text",
            "Source of its commands: `mission`, `teleop` or `safety`; an empty text if there is none.",
            ("mission", "teleop", "safety", ""),
            is_always_known=True,
        ),
    }),
    "battery": StatePart("base", "base", {
        "percent": StateValue("percent", "Charge in percent, 0..100."),
        "voltage": StateValue("voltage", "Voltage in volts."),
        "charging": _flag("True while it charges."),
        "low": _flag("True if the charge has been below the low threshold of the robot file for two seconds."),
        "critical": _flag(
            "True if the charge has been below the critical threshold of the robot file for two seconds: "
            "the mission ends."
        ),
    }),
    "face": StatePart("camera", "camera", {
        "seen": _flag("True if a face was seen within the last half second.", first=True),
        "count": StateValue("number", "Number of faces seen within the last half second."),
        "id": StateValue("number", "Id of the largest face."),
        "name": StateValue(
            "text",
            "Name of its person, `unknown` for a stranger, an empty text while undecided.",
            sense="names",
        ),
        "undecided": _flag("True while a face is seen whose person is undecided.", sense="names"),
        "distance": StateValue("length", "Distance in metres, estimated from its size."),
        "bearing": StateValue("angle", "Angle from the camera's axis, in radians, positive to the left."),
    }, sense="faces"),
    "head": StatePart("head", "head", {
        "pan": StateValue("angle", "Radians, positive to the left."),
        "tilt": StateValue("angle", "Radians, positive down."),
    }),
    "range": StatePart("range", "range finder", {
        "nearest": StateValue("length", "Distance to the nearest obstacle, in metres."),
        "ahead": StateValue(
            "length", "Distance to the nearest obstacle within 30 degrees left and right of straight ahead, in metres."
        ),
    }),
}  # fmt: skip
"""The robot's state by part, as in ``battery.percent``."""


def state_value(part: str, name: str) -> StateValue | None:
    """Return the declaration of ``part.name``; None if there is none."""
    found = ROBOT_STATE.get(part)
    return None if found is None else found.values.get(name)
