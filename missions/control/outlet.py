"""What a run tells its clients: all that is so far, and then what is new, in few messages."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isfinite
from threading import Lock

from behaviours.robot import Robot
from drivers.api import JointState, Reading
from drivers.api.joints import joint_called
from drivers.clock import Clock, SystemClock
from missions.executive.events import CommandSent, Ended, Event, NodeChanged, PerceptSeen, Ticked, VariableSet
from missions.executive.parts import PartsWatch
from missions.runner import Runner
from missions.trees.feed import Feed
from missions.trees.words import in_words

PLACE_EVERY = 0.25
"""Seconds from one place of the base to the next."""

MOST_PLACES = 2000
"""Places of the way that are kept; of a longer one it is every second one, again and again."""

MOST_VALUES = 60
"""Values of each variable that are kept."""


class Past:
    """A listener that keeps what a page shows of before, however many watch; told from another thread."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._placed = float("-inf")
        self._way: list[tuple[float, float]] = []
        self._values: dict[str, deque[VariableSet]] = {}
        self._lock = Lock()

    def __call__(self, event: Event) -> None:
        """Keep an event."""
        if isinstance(event, VariableSet):
            with self._lock:
                name = f"{event.scope} {event.name}".lstrip()
                self._values.setdefault(name, deque(maxlen=MOST_VALUES)).append(event)
        elif isinstance(event, Ticked) and event.t - self._placed >= PLACE_EVERY and self._robot.base_part is not None:
            self._placed = event.t
            base = self._robot.base_part.state().value
            if base is not None and (place := (round(base.pose.x, 2), round(base.pose.y, 2))) not in self._way[-1:]:
                with self._lock:
                    self._way = [*self._way[:: 1 + (len(self._way) >= MOST_PLACES)], place]

    def told(self) -> dict[str, object]:
        """Return it as a scene has it."""
        with self._lock:
            way, values = self._way, {name: list(events) for name, events in self._values.items()}
        past = {
            name: [[each.t, None if each.value is None else in_words(each.value)] for each in events]
            for name, events in values.items()
        }
        return {"way": way, "past": past}


Json = dict[str, object]

UNWRITTEN = (Ticked, NodeChanged, VariableSet, PerceptSeen, CommandSent)
"""Events that are no lines of a log."""

SPOKEN = ("voice", "screen")
"""The parts whose commands are worth a line all the same."""

MOST_LINES = 500
"""Lines of the log that are kept for who comes later, and that wait for a client that does not read."""

MOST_EVENTS = 5000
"""Events that wait for a client that does not read; older ones are lost to it."""

MOST_POINTS = 360
"""Points of a range finder's turn that are told."""

LOOK_EVERY = 0.04
"""Seconds from one look at where the robot is to the next, in simulated time."""


class Outlet:
    """A listener that gathers what happens in a run; ``news`` says what is new, ``all`` what is so. From two threads.

    ``wake`` is called, from the thread of the events, when there is something to be told and somebody ``watched``.
    """

    def __init__(self, runner: Runner, *, wall: Clock | None = None) -> None:
        executive, assembled = runner.executive, runner.assembled
        self._robot = assembled.robot
        self._wall = wall or SystemClock()
        looked = None if assembled.eyes is None else assembled.eyes.looked
        self._parts = PartsWatch(assembled.devices, assembled.robot, looked)
        self._in_tick = runner.twins is not None
        self._feed = Feed(
            executive,
            self._wall,
            look=lambda: self._parts.look(executive.time()),
            lines=lambda _: (),
            in_tick=self._in_tick,
        )
        self.past = Past(assembled.robot)
        self._place: Json = {}
        self._looked = float("-inf")
        self._scanned = -1
        self._percept: PerceptSeen | None = None
        self._commands: dict[str, Event] = {}
        self._lines: deque[Event] = deque(maxlen=MOST_LINES)
        self._events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self._told = self._taken = 0  # events in all, and those that were handed out
        self._lock = Lock()
        self._all: Json = {}
        self.log: deque[Mapping[str, object]] = deque(maxlen=MOST_LINES)
        self.end: Ended | None = None
        self.watched = self.listened = False
        self.wake: Callable[[], None] = lambda: None

    def __call__(self, event: Event) -> None:
        """Keep an event."""
        self._parts.take(event)
        self._feed(event)
        self.past(event)
        with self._lock:
            match event:
                case PerceptSeen():
                    self._percept = event
                case CommandSent():
                    self._commands[event.to] = event
                case Ended():
                    self.end = event
                case _:
                    pass
            if not isinstance(event, UNWRITTEN) or (isinstance(event, CommandSent) and event.to in SPOKEN):
                self._lines.append(event)
            if self.listened:
                self._events.append(event)
                self._told += 1
        if isinstance(event, Ticked | Ended):
            self._look()

    def look(self) -> None:
        """Look how the robot is: time has passed without a tick. For the thread of the ticks, in simulated time."""
        self._feed.look()
        self._look()

    def _look(self) -> None:
        if self._in_tick and self.watched and self._wall.now() - self._looked >= LOOK_EVERY:
            self._looked = self._wall.now()
            self._place = self._where()
        if self.watched:
            self.wake()

    def news(self, more: Mapping[str, object]) -> Json:
        """Return what is new since it was asked last, with ``more``: what a `state` has beside ``say`` and ``run``."""
        told: Json = {**self._feed.news(), **more}
        told.pop("log", None)
        place = self._place if self._in_tick else self._where()
        place = {**place, "visited": self._feed.visited()}
        told |= {name: value for name, value in place.items() if value != self._all.get(name)}
        with self._lock:
            lines = [line.as_dict() for line in self._lines]
            self._lines.clear()
            percept, self._percept = self._percept, None
            commands, self._commands = self._commands, {}
        if percept is not None:
            told["percept"] = percept.as_dict()
        if commands:
            told["commands"] = {to: event.as_dict() for to, event in commands.items()}
        self._all = merged(self._all, told)
        if lines:
            told["log"] = lines
            self.log.extend(lines)
        return told

    @property
    def all(self) -> Json:
        """All that is so, as of the last ``news``; the log apart."""
        return self._all

    def events(self) -> tuple[list[Mapping[str, object]], int]:
        """Return the events since it was asked last, and how many before them are lost."""
        with self._lock:
            found, count = list(self._events), self._told - self._taken
            self._events.clear()
            self._taken = self._told
        return [event.as_dict() for event in found], count - len(found)

    def _where(self) -> Json:
        """Return where the robot is, and what its arm and its range finder tell."""
        told: Json = {}
        robot = self._robot
        if robot.base_part is not None and (base := robot.base_part.state().value) is not None:
            told["pose"] = [round(base.pose.x, 4), round(base.pose.y, 4), round(base.pose.heading, 4)]
        if joints := {
            name: [round(state.position, 3), round(state.load, 3), state.temperature]
            for name, reading in _joints(robot)
            if (state := reading.value) is not None
        }:
            told["joints"] = joints
        points = self._scan(robot)
        if points is not None:
            told["scan"] = points
        return told

    def _scan(self, robot: Robot) -> list[Sequence[float]] | None:
        """Return a new turn of the range finder as points on the robot; None where there is none."""
        import numpy as np  # noqa: PLC0415 - most runs have no range finder

        scan = None if robot.ranger_part is None else robot.ranger_part.scan().value
        if robot.ranger_part is None or scan is None or scan.number == self._scanned:
            return None
        self._scanned = scan.number
        every = max(1, len(scan.ranges) // MOST_POINTS)
        ranges, bearings = scan.ranges[::every], scan.bearings()[::every]
        known = np.isfinite(ranges)
        x, y, _ = robot.ranger_part.place
        across = np.stack([x + ranges * np.cos(bearings), y + ranges * np.sin(bearings)], axis=1)[known]
        return [[float(a), float(b)] for a, b in np.round(across, 3)]


def _joints(robot: Robot) -> Iterator[tuple[str, Reading[JointState]]]:
    """Yield the joints of all arms; those of further ones after the arm's name: `right_arm.elbow`."""
    if robot.arm_part is not None:
        yield from robot.arm_part.states().items()
    for name, other in robot.others.items():
        if other.kind == "arm":
            yield from ((joint_called(name, joint), reading) for joint, reading in other.part.states().items())


def merged(old: Mapping[str, object], new: Mapping[str, object]) -> Json:
    """Return what both together say, where the newest of each holds."""
    found = {**old, **new}
    for name in ("changed", "variables", "commands"):
        before, after = old.get(name), new.get(name)
        if isinstance(before, dict) and isinstance(after, dict):
            found[name] = before | after
    before, after = old.get("log"), new.get("log")
    if isinstance(before, list) and isinstance(after, list):
        lines = before + after
        lost = old.get("lost", 0)
        found["log"] = lines[-MOST_LINES:]
        found["lost"] = (lost if isinstance(lost, int) else 0) + max(0, len(lines) - MOST_LINES)
    return found


def scene_of(runner: Runner) -> Json:
    """Return what does not change of a run while it goes on."""
    from missions.trees.draw import drawing_of, first_values  # noqa: PLC0415 - a run that nobody watches draws nothing
    from missions.trees.drawing import to_json  # noqa: PLC0415

    plan, assembled = runner.plan, runner.assembled
    base = assembled.robot.base_part
    limits = None if base is None else {"speed": base.limits.speed, "turn": base.limits.turn}
    return {
        "mission": plan.mission,
        "robot": assembled.name,
        "file": plan.source.name,
        "params": {name: in_words(value) for name, value in plan.params.items()},
        "drawing": to_json(drawing_of(plan)),
        "first": {name: in_words(value) for name, value in first_values(plan).items()},
        "parts": sorted(assembled.devices),
        "limits": limits if limits is None or all(map(isfinite, limits.values())) else None,
    }
