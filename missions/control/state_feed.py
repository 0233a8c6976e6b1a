"""The state of a run for its clients: the complete state, and the changes since the last message."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isfinite
from threading import Lock

from behaviours.robot import Robot
from drivers.api import JointState, Reading
from drivers.api.joints import qualified_joint_name
from drivers.clock import Clock, SystemClock
from missions.executive.events import CommandSent, Ended, Event, NodeChanged, PerceptSeen, Ticked, VariableSet
from missions.executive.parts import PartsMonitor
from missions.runner import Runner
from missions.trees.feed import ViewFeed
from missions.trees.value_text import value_text

POSITION_INTERVAL = 0.25
"""Seconds between two stored positions of the base."""

MAX_POSITIONS = 2000
"""Maximum number of stored positions of the base; when they are full, every second one is dropped."""

MAX_VALUES = 60
"""Maximum number of stored values of each variable of a mission."""


class RunHistory:
    """Listener that stores the path of the base and the values of variables, for clients that connect later.

    Thread-safe.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._position_at = float("-inf")
        self._positions: list[tuple[float, float]] = []
        self._values: dict[str, deque[VariableSet]] = {}
        self._lock = Lock()

    def __call__(self, event: Event) -> None:
        if isinstance(event, VariableSet):
            with self._lock:
                name = f"{event.scope} {event.name}".lstrip()
                self._values.setdefault(name, deque(maxlen=MAX_VALUES)).append(event)
        elif (
            isinstance(event, Ticked)
            and event.t - self._position_at >= POSITION_INTERVAL
            and self._robot.base_part is not None
        ):
            self._position_at = event.t
            base = self._robot.base_part.state().value
            if (
                base is not None
                and (place := (round(base.pose.x, 2), round(base.pose.y, 2))) not in self._positions[-1:]
            ):
                with self._lock:
                    self._positions = [*self._positions[:: 1 + (len(self._positions) >= MAX_POSITIONS)], place]

    def as_dict(self) -> dict[str, object]:
        """Return the history as members of a scene, the message with the complete state that a new client gets."""
        with self._lock:
            way, values = self._positions, {name: list(events) for name, events in self._values.items()}
        past = {
            name: [[each.t, None if each.value is None else value_text(each.value)] for each in events]
            for name, events in values.items()
        }
        return {"way": way, "past": past}


Json = dict[str, object]

UNLOGGED_EVENTS = (Ticked, NodeChanged, VariableSet, PerceptSeen, CommandSent)
"""Events that are not lines of the run's log."""

LOGGED_PARTS = ("voice", "screen")
"""Parts of the robot whose commands are lines of the run's log."""

MAX_LOG_LINES = 500
"""Maximum number of log lines that are stored for new clients, and queued for slow ones."""

MAX_QUEUED_EVENTS = 5000
"""Maximum number of events queued for a slow client; older ones are dropped."""

MAX_SCAN_POINTS = 360
"""Maximum number of points that are sent of one revolution of a range finder."""

POSE_INTERVAL = 0.04
"""Seconds between two reads of the pose in simulated time."""


class StateFeed:
    """Listener that collects the state of a run for its clients. Used from the event thread and the control thread.

    ``take_changes`` returns the changes since its last call, ``state`` the complete state. ``wake`` is called from the
    event thread when the state has changed and a client watches it.
    """

    def __init__(self, runner: Runner, *, wall: Clock | None = None) -> None:
        executive, assembled = runner.executive, runner.assembled_robot
        self._robot = assembled.robot
        self._wall = wall or SystemClock()
        looked = None if assembled.eyes is None else assembled.eyes.looked
        self._parts = PartsMonitor(assembled.devices, assembled.robot, looked)
        self._in_tick = runner.twins is not None
        self._feed = ViewFeed(
            executive,
            self._wall,
            look=lambda: self._parts.check(executive.time()),
            lines=lambda _: (),
            in_tick=self._in_tick,
        )
        self.history = RunHistory(assembled.robot)
        self._pose_state: Json = {}
        self._pose_at = float("-inf")
        self._scan_number = -1
        self._percept: PerceptSeen | None = None
        self._commands: dict[str, Event] = {}
        self._lines: deque[Event] = deque(maxlen=MAX_LOG_LINES)
        self._events: deque[Event] = deque(maxlen=MAX_QUEUED_EVENTS)
        self._event_count = self._taken_count = 0  # number of all events, and of those that were sent
        self._lock = Lock()
        self._state: Json = {}
        self.log: deque[Mapping[str, object]] = deque(maxlen=MAX_LOG_LINES)
        self.end: Ended | None = None
        self.is_watched = self.has_event_listeners = False
        self.wake: Callable[[], None] = lambda: None

    def __call__(self, event: Event) -> None:
        self._parts.on_event(event)
        self._feed(event)
        self.history(event)
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
            if not isinstance(event, UNLOGGED_EVENTS) or (isinstance(event, CommandSent) and event.to in LOGGED_PARTS):
                self._lines.append(event)
            if self.has_event_listeners:
                self._events.append(event)
                self._event_count += 1
        if isinstance(event, Ticked | Ended):
            self._update_pose()

    def update(self) -> None:
        """Read the robot's state between ticks, while the mission is paused.

        Called only in simulated time, on the thread that ticks.
        """
        self._feed.poll_parts()
        self._update_pose()

    def _update_pose(self) -> None:
        if self._in_tick and self.is_watched and self._wall.now() - self._pose_at >= POSE_INTERVAL:
            self._pose_at = self._wall.now()
            self._pose_state = self._read_pose_state()
        if self.is_watched:
            self.wake()

    def take_changes(self, more: Mapping[str, object]) -> Json:
        """Return the changes since the last call as members of a `state` message; ``more`` are added to them."""
        changes: Json = {**self._feed.take_changes(), **more}
        changes.pop("log", None)
        place = self._pose_state if self._in_tick else self._read_pose_state()
        place = {**place, "visited": self._feed.visited_keys()}
        changes |= {name: value for name, value in place.items() if value != self._state.get(name)}
        with self._lock:
            lines = [line.as_dict() for line in self._lines]
            self._lines.clear()
            percept, self._percept = self._percept, None
            commands, self._commands = self._commands, {}
        if percept is not None:
            changes["percept"] = percept.as_dict()
        if commands:
            changes["commands"] = {to: event.as_dict() for to, event in commands.items()}
        self._state = merge_states(self._state, changes)
        if lines:
            changes["log"] = lines
            self.log.extend(lines)
        return changes

    @property
    def state(self) -> Json:
        """Complete state of the run when ``take_changes`` was last called, without the log."""
        return self._state

    def take_events(self) -> tuple[list[Mapping[str, object]], int]:
        """Return the events since the last call, and the number of dropped events before them."""
        with self._lock:
            found, count = list(self._events), self._event_count - self._taken_count
            self._events.clear()
            self._taken_count = self._event_count
        return [event.as_dict() for event in found], count - len(found)

    def _read_pose_state(self) -> Json:
        """Return the members ``pose`` and ``joints`` of a state, and ``scan`` if the range finder has a new one."""
        pose_state: Json = {}
        robot = self._robot
        if robot.base_part is not None and (base := robot.base_part.state().value) is not None:
            pose_state["pose"] = [round(base.pose.x, 4), round(base.pose.y, 4), round(base.pose.heading, 4)]
        if joints := {
            name: [round(state.position, 3), round(state.load, 3), state.temperature]
            for name, reading in _joints(robot)
            if (state := reading.value) is not None
        }:
            pose_state["joints"] = joints
        points = self._new_scan_points(robot)
        if points is not None:
            pose_state["scan"] = points
        return pose_state

    def _new_scan_points(self, robot: Robot) -> list[Sequence[float]] | None:
        """Return a new revolution of the range finder as points in the robot frame (m); None if there is none."""
        import numpy as np  # noqa: PLC0415 - most runs have no range finder

        scan = None if robot.ranger_part is None else robot.ranger_part.scan().value
        if robot.ranger_part is None or scan is None or scan.number == self._scan_number:
            return None
        self._scan_number = scan.number
        every = max(1, len(scan.ranges) // MAX_SCAN_POINTS)
        ranges, bearings = scan.ranges[::every], scan.bearings()[::every]
        known = np.isfinite(ranges)
        x, y, _ = robot.ranger_part.place
        across = np.stack([x + ranges * np.cos(bearings), y + ranges * np.sin(bearings)], axis=1)[known]
        return [[float(a), float(b)] for a, b in np.round(across, 3)]


def _joints(robot: Robot) -> Iterator[tuple[str, Reading[JointState]]]:
    """Yield each joint of each arm with its reading; of additional arms as ``right_arm.elbow``."""
    if robot.arm_part is not None:
        yield from robot.arm_part.states().items()
    for name, other in robot.extra_parts.items():
        if other.kind == "arm":
            yield from ((qualified_joint_name(name, joint), reading) for joint, reading in other.part.states().items())


def merge_states(old: Mapping[str, object], new: Mapping[str, object]) -> Json:
    """Return two states as one; a member that is in both has its value from ``new``."""
    found = {**old, **new}
    for name in ("changed", "variables", "commands"):
        before, after = old.get(name), new.get(name)
        if isinstance(before, dict) and isinstance(after, dict):
            found[name] = before | after
    before, after = old.get("log"), new.get("log")
    if isinstance(before, list) and isinstance(after, list):
        lines = before + after
        lost = old.get("lost", 0)
        found["log"] = lines[-MAX_LOG_LINES:]
        found["lost"] = (lost if isinstance(lost, int) else 0) + max(0, len(lines) - MAX_LOG_LINES)
    return found


def scene_of(runner: Runner) -> Json:
    """Return the members of a scene that do not change during the run; a scene is the first message to a new client."""
    from missions.trees.drawing import to_json  # noqa: PLC0415
    from missions.trees.drawing_builder import drawing_of, first_values  # noqa: PLC0415 - a run that nobody watches draws nothing

    plan, assembled = runner.plan, runner.assembled_robot
    base = assembled.robot.base_part
    limits = None if base is None else {"speed": base.limits.speed, "turn": base.limits.turn}
    return {
        "mission": plan.mission,
        "robot": assembled.name,
        "file": plan.source.name,
        "params": {name: value_text(value) for name, value in plan.params.items()},
        "drawing": to_json(drawing_of(plan)),
        "first": {name: value_text(value) for name, value in first_values(plan).items()},
        "parts": sorted(assembled.devices),
        "limits": limits if limits is None or all(map(isfinite, limits.values())) else None,
    }
