"""State of the robot for expressions: ``battery.percent``, ``face.seen``, ``base.bumper``.

A value of an unseen object is None, so that a comparison with it fails with a reason. A part that does not report
raises SensorSilent, which suspends the node.
"""

from collections.abc import Callable, Mapping, Sequence
from math import radians
from typing import TypeVar

from behaviours.condition import UnmeasuredError
from behaviours.robot import Robot
from drivers.api import Base, BaseState, HeadPose, RangeScan, Reading
from drivers.clock import Clock
from drivers.errors import NotConnected, SensorSilent
from missions.executive.guard import BaseGuard
from missions.language.expressions import ExpressionError, Value, format_value, parse
from missions.language.robot_state import state_value
from perception.api import Face

T = TypeVar("T")

MAX_FACE_AGE = 0.5
"""Maximum age in seconds of a face that counts as seen."""

AHEAD_SECTOR = radians(60)
"""Full angle in radians of the sector, centred straight ahead, in which ``range.ahead`` is the nearest distance."""


ValueReader = Callable[[], object]
"""Function that returns the present value of the robot's state for one name, such as ``base.bumper``."""


class PartValues:
    """Values of one part for expressions: each attribute, such as ``percent`` of ``battery``, is read on access."""

    def __init__(self, values: Mapping[str, ValueReader]) -> None:
        self._values = values

    def __getattr__(self, name: str) -> object:
        read = self.__dict__.get("_values", {}).get(name)  # a copy has no values yet
        if read is None:
            raise AttributeError(name)
        return read()


BASE: Mapping[str, Callable[[BaseState], object]] = {
    "x": lambda state: state.pose.x,
    "y": lambda state: state.pose.y,
    "heading": lambda state: state.pose.heading,
    "reckoned": lambda state: state.reckoned,
    "bumper": lambda state: bool(state.bumper),
    "cliff": lambda state: bool(state.cliff),
    "wheel_drop": lambda state: bool(state.wheel_drop),
    "button": lambda state: min(state.buttons, default=None),
    "docked": lambda state: state.docked,
}
BATTERY: Mapping[str, Callable[[BaseState], object]] = {
    "percent": lambda state: state.battery_percent,
    "voltage": lambda state: state.battery_voltage,
    "charging": lambda state: state.charging,
}
FACE: Mapping[str, Callable[[Sequence[Face]], object]] = {
    "seen": bool,
    "count": len,
    "id": lambda faces: faces[0].id if faces else None,
    "name": lambda faces: faces[0].name if faces else None,
    "undecided": lambda faces: any(not face.name for face in faces),
    "distance": lambda faces: faces[0].distance if faces else None,
    "bearing": lambda faces: faces[0].bearing if faces else None,
}
HEAD: Mapping[str, Callable[[HeadPose], object]] = {"pan": lambda pose: pose.pan, "tilt": lambda pose: pose.tilt}
RANGE: Mapping[str, Callable[[RangeScan], object]] = {
    "nearest": lambda scan: min(scan.nearest(), scan.most),
    "ahead": lambda scan: min(scan.nearest(0.0, AHEAD_SECTOR), scan.most),
}


def _make_readers(
    sample: Callable[[], T | None], getters: Mapping[str, Callable[[T], object]]
) -> dict[str, ValueReader]:
    """Return a reader for each name in ``getters``: it samples the part and gets the value from the sample.

    It returns None if ``sample`` does, because there is nothing to see.
    """

    def reader(way: Callable[[T], object]) -> ValueReader:
        return lambda: None if (found := sample()) is None else way(found)

    return {name: reader(way) for name, way in getters.items()}


def require_fresh(reading: Reading[T], part: str) -> T:
    """Return the value of a reading of ``part``. Raises SensorSilent if the reading is missing or not recent."""
    if reading.value is None or not reading.good:
        raise SensorSilent(f"the {part} does not report")
    return reading.value


def _fresh_faces(robot: Robot, clock: Clock) -> list[Face]:
    """Return the faces of the last half second, the largest first. Raises SensorSilent."""
    sight = robot.sight_part
    if sight is None:
        return []
    faces, looked, oldest = sight.faces(), sight.looked(), clock.now() - MAX_FACE_AGE
    if looked is None or looked < oldest:
        raise SensorSilent("the camera does not report")
    return [face for face in faces if face.stamp >= oldest]


def state_of(robot: Robot, clock: Clock, guard: BaseGuard | None = None) -> dict[str, PartValues]:
    """Return the state of ``robot`` by part, from which expressions such as ``battery.percent`` read.

    The ``guard`` provides the battery levels ``low`` and ``critical``. The names are declared in
    ``missions.language.robot_state``.
    """

    def report() -> BaseState | None:
        return None if robot.base_part is None else require_fresh(robot.base_part.state(), "base")

    def pose() -> HeadPose | None:
        return None if robot.head_part is None else require_fresh(robot.head_part.pose(), "head")

    def scan() -> RangeScan | None:
        return None if robot.ranger_part is None else require_fresh(robot.ranger_part.scan(), "range finder")

    def get_base() -> Base | None:
        return robot.base_part

    watch = None if guard is None else guard.battery
    levels: Mapping[str, Callable[[BaseState], object]] = {
        "low": lambda _: None if watch is None else watch.low,
        "critical": lambda _: None if watch is None else watch.critical,
    }
    commanded: Mapping[str, Callable[[Base], object]] = {
        "stopped": lambda base: bool(base.latched),
        "driver": lambda base: str(base.steering().source or ""),
    }
    return {
        "face": PartValues(_make_readers(lambda: _fresh_faces(robot, clock), FACE)),
        "base": PartValues(_make_readers(report, BASE) | _make_readers(get_base, commanded)),
        "battery": PartValues(_make_readers(report, BATTERY) | _make_readers(report, levels)),
        "head": PartValues(_make_readers(pose, HEAD)),
        "range": PartValues(_make_readers(scan, RANGE)),
    }


class BoundCondition:
    """Condition of a mission with the ``scope`` of its variables; ``text`` is the condition as written."""

    def __init__(self, value: Value, text: str, scope: Mapping[str, object]) -> None:
        self._value = value
        self._text = text
        self._scope = scope

    def is_true(self) -> bool:
        """Evaluate the condition. Raises UnmeasuredError, SensorSilent and ValueError."""
        problem = unmeasured_reason(self._value, self._scope)
        if problem:
            raise UnmeasuredError(problem)
        return bool(self._value.resolve(self._scope))

    def false_reason(self) -> str:
        """Return "not true: EXPRESSION (NAME is VALUE)" with the values of all names in the expression.

        The value is left out if the expression is only a name.
        """
        reads = () if self._value.template is None else self._value.template.reads
        values = {read.dotted: self._value_text(read.dotted) for read in reads if read.dotted != self._text}
        listed = ", ".join(f"{name} is {value}" for name, value in values.items() if value)
        return f"not true: {self._text}" + (f" ({listed})" if listed else "")

    def _value_text(self, name: str) -> str:
        """Return the present value of a name as text; empty for a value that is not plain or not reported."""
        try:
            value = parse(name).evaluate(self._scope)
        except (ExpressionError, NotConnected):
            return ""
        if isinstance(value, bool):
            return str(value).lower()
        return format_value(value) if value is None or isinstance(value, str | int | float) else ""


def unmeasured_reason(condition: Value, scope: Mapping[str, object]) -> str:
    """Return why ``condition`` fails: it uses a position from dead reckoning; empty if it uses none.

    Raises SensorSilent.
    """
    reads = () if condition.template is None else condition.template.reads
    values = ((read.dotted, state_value(read.name, read.member)) for read in reads)
    place = next((name for name, value in values if value is not None and value.is_dead_reckoned), "")
    base = scope.get("base")
    if place and isinstance(base, PartValues) and base.reckoned:
        return f"{place} is dead reckoning, which no condition may use: this base does not measure its motion"
    return ""
