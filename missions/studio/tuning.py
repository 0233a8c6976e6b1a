"""What clients of a run change of its robot while it goes on: trims, speeds, and how far joints go."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from config.faults import did_you_mean
from config.robot import RobotConfig
from config.units import written
from drivers.api import Curbed, Device
from drivers.api.quick import dataclass
from drivers.api.sections import LARGEST_TRIM
from drivers.errors import DriverError
from drivers.pantilt import Trimmable
from missions.library.tuning import LIMITS, filed
from missions.studio.form import BadMessage

SLOWEST = 0.05
"""The share of its speed that a part keeps at least: slower it gets nowhere."""

FIELDS = {"max_speed": "speed", "max_turn": "turn"}
"""What the limits of a base call the keys of its file."""


@dataclass(slots=True)
class Knob:
    """One value: within which bounds it may be, how it is read and how it is set. ``tuned`` once somebody has."""

    dimension: str
    low: float
    high: float
    now: Callable[[], float]
    turn: Callable[[float], object]
    tuned: bool = False


class Tuning:
    """The values of a robot's parts by their names, as ``missions.library.tuning`` has them. For one thread."""

    def __init__(self, robot: RobotConfig, devices: Mapping[str, Device]) -> None:
        self._file = "" if robot.path is None else str(robot.path.resolve())
        self._knobs: dict[str, Knob] = {}
        for name, (_, dimension) in filed(robot).items():
            part, *keys = name.split(".")
            knob = _knob(devices.get(part), keys, dimension)
            if knob is not None:
                self._knobs[name] = knob

    def told(self) -> Mapping[str, object]:
        """Return what `tuning` is answered."""
        return {"file": self._file, "knobs": [_told(name, knob) for name, knob in self._knobs.items()]}

    def tune(self, name: str, value: float) -> Mapping[str, object]:
        """Set a value; return what holds. Raises BadMessage."""
        knob = self._knobs.get(name)
        if knob is None:
            raise BadMessage("bad_field", f"nothing is called '{name}'", did_you_mean(name, self._knobs))
        if not knob.low <= value <= knob.high:
            ends = " to ".join(written(end, knob.dimension) for end in (knob.low, knob.high))
            raise BadMessage("bad_field", f"{name}: {written(value, knob.dimension)} is not within {ends}")
        try:
            knob.turn(value)
        except DriverError as error:
            raise BadMessage("device", str(error), error.hint) from error
        knob.tuned = True
        return _told(name, knob)


def _told(name: str, knob: Knob) -> Mapping[str, object]:
    about = {"name": name, "dimension": knob.dimension, "low": knob.low, "high": knob.high}
    return {**about, "value": knob.now(), "tuned": knob.tuned}


def tuned_in_words(told: Mapping[str, Any]) -> str:
    """Return what a value is now, for the log: "head pan trim: 3 deg"."""
    return f"{told['name'].replace('.', ' ')}: {written(told['value'], told['dimension'])}"


def _knob(device: Any, keys: list[str], dimension: str) -> Knob | None:
    """Return how a value of a part is read and set; None where that part's driver does not let it."""
    match keys:
        case [axis, "trim"] if isinstance(device, Trimmable):
            at = ("pan", "tilt").index(axis)
            turn = partial(_trim, device, axis)
            return Knob(dimension, -LARGEST_TRIM, LARGEST_TRIM, lambda: device.trim()[at], turn)
        case ["joints", joint, end] if isinstance(device, Curbed):
            file = device.limits[joint]
            low, high = (file.lower, file.upper) if end in LIMITS else (SLOWEST * file.speed, file.speed)
            return Knob(
                dimension, low, high, lambda: getattr(device.limits[joint], end), partial(_bend, device, joint, end)
            )
        case [key] if isinstance(device, Curbed):
            field = FIELDS.get(key, key)
            high = getattr(device.limits, field)
            return Knob(
                dimension, SLOWEST * high, high, lambda: getattr(device.limits, field), partial(_curb, device, field)
            )
        case _:
            return None


def _trim(device: Trimmable, axis: str, value: float) -> None:
    device.trim(**{axis: value})


def _bend(device: Any, joint: str, end: str, value: float) -> None:
    device.curb({joint: replace(device.limits[joint], **{end: value})})


def _curb(device: Any, field: str, value: float) -> None:
    device.curb(replace(device.limits, **{field: value}))
