"""A robot as a member of a fleet: it announces itself, publishes its state, and handles stops and releases."""

import secrets
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from random import uniform
from threading import Event, Thread
from types import TracebackType
from typing import Protocol, Self, TypeVar

from behaviours.run import log
from drivers.clock import Clock, SystemClock
from missions.codec import MAX_INTEGER
from missions.plugins.fleet.fleet_robot import FleetRobot
from missions.plugins.fleet.messages import (
    MAX_TEXT_LENGTH,
    Address,
    FleetAnswer,
    FleetRelease,
    FleetRequest,
    FleetStop,
    ListPeers,
    Peer,
    RobotState,
    TaskState,
    encode_message,
)
from missions.plugins.fleet.zenoh_transport import Reply, Roster, ZenohTransport
from missions.plugins.tasks.fleet_latch import FleetLatch

T = TypeVar("T")

BUSY_INTERVAL, IDLE_INTERVAL = 0.1, 0.5
"""Seconds between two rounds of the member's thread while services are busy, and while they are idle.

Each round wakes the processor: at ten a second, rounds are three quarters of the CPU time of an idle member.
"""

DISK_TIMEOUT = 0.1
"""Maximum seconds for which the confirmation of a stop waits for the disk that stores it; the robot stands by then."""

HEARTBEAT_INTERVAL = 5.0
"""Maximum seconds between two states that a robot publishes."""

STOP_QUIET_RANGE = 0.1, 0.5
"""Range (s) of the random pause before a robot publishes its state after a stop.

If all robots published at once, their states would delay the confirmations of the stop.
"""

MIN_MOVE, MIN_TURN = 0.1, 0.2
"""Movement in metres, and rotation in radians, from which a new state is published."""

MAX_PENDING_REQUESTS = 1000
"""Maximum number of requests that wait for the member's thread; a stop is handled at once, without waiting."""


@dataclass(frozen=True, slots=True)
class RobotActivity:
    """Activity of a robot in its fleet: ID and state of its fleet task, if any, and whether it accepts another task."""

    task: str = ""
    state: TaskState | None = None
    free: bool = True


class FleetService(Protocol):
    """A service of a fleet member, such as executing or allocating tasks; its methods run on the member's thread."""

    def answer(self, request: FleetRequest) -> FleetAnswer | None:
        """Return the answer to a request, or None if another service handles it."""
        ...

    def step(self, now: float) -> bool:
        """Do all work that is due at time ``now`` (s); return True if work is in progress.

        The next call is then due soon.
        """
        ...


@dataclass(frozen=True, slots=True)
class RobotInfo:
    """Constant data of a robot: address, name of its robot file, parts, and whether it is simulated."""

    address: Address
    robot: str
    parts: tuple[str, ...] = ()
    simulated: bool = False


class FleetMember:
    """The membership of a robot in a fleet, which lasts while the context is entered.

    ``services`` handle all requests but stops and releases. ``current_activity`` returns the task of the robot; it is
    called on the member's thread.
    """

    def __init__(
        self,
        info: RobotInfo,
        transport: ZenohTransport,
        roster: Roster,
        fleet_robot: FleetRobot,
        latch: FleetLatch,
        *,
        services: Sequence[FleetService] = (),
        current_activity: Callable[[], RobotActivity] = RobotActivity,
        clock: Clock | None = None,
    ) -> None:
        self.info, self.transport, self.roster, self.fleet_robot, self.latch = (
            info,
            transport,
            roster,
            fleet_robot,
            latch,
        )
        self.services = list(services)
        self.current_activity = current_activity
        self.clock = clock or SystemClock()
        self._requests: deque[tuple[FleetRequest, Reply]] = deque()
        self._wake, self._over = Event(), Event()
        self._state = RobotState(
            session=secrets.token_hex(4), number=0, robot=info.robot, parts=info.parts, simulated=info.simulated
        )
        self._published_at = 0.0
        self._last_press = ("", FleetAnswer())
        self._quiet_until = self._duplicate_until = float("-inf")
        self._thread = Thread(target=self._serve, name="fleet", daemon=True)

    def __enter__(self) -> Self:
        self.latch.load()
        if self.latch.is_latched:
            self.fleet_robot.stop(self.latch.by)
        self._state = self._current_state()
        self.transport.announce(
            self.info.address, self._handle_stop, self._queue_request, lambda: encode_message(self._state)
        )
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._wake.set()
        self._thread.join()
        self._publish(replace(self._state, farewell=True, free=False))
        self.transport.close()

    def wake(self) -> None:
        """Let the member's thread run ``run_once`` at once instead of at its next interval. Thread-safe."""
        self._wake.set()

    @property
    def is_duplicate(self) -> bool:
        """Whether a second robot announces the same address, as after an SD card was copied.

        While this is True, the robot neither runs nor allocates tasks.
        """
        return self.clock.now() < self._duplicate_until

    # --- threads of the wire ----------------------------------------------------------------------------------------

    def _handle_stop(self, ask: FleetRequest, reply: Reply) -> None:
        """Stop the robot at once, on the thread that received the request, before any other work."""
        if not isinstance(ask, FleetStop):
            reply(FleetAnswer(ok=False, reason=f"'{ask.word}' belongs to another address"))
            return
        press, answer = self._last_press
        if ask.press and ask.press == press:
            reply(answer)
            return
        if (now := self.clock.now()) > self._quiet_until + STOP_QUIET_RANGE[
            1
        ]:  # repeated stops must not silence it for good
            self._quiet_until = now + uniform(*STOP_QUIET_RANGE)  # noqa: S311 - no secret
        number, keep = self.latch.stop(ask.by)
        kept: list[str] = []
        try:
            good, words = self.fleet_robot.stop(ask.by)  # first: starting a thread is slow on a busy machine
        finally:
            keeping = Thread(target=lambda: kept.append(keep()), name="keep the stop")
            keeping.start()  # a slow disk must not delay the answer for long
        keeping.join(DISK_TIMEOUT)
        late = "; not stored for a restart yet"
        answer = FleetAnswer(ok=good, reason=words + (kept[0] if kept else late), data=({"stop": number},))
        self._last_press = (ask.press, answer)
        reply(answer)
        self.wake()

    def _queue_request(self, ask: FleetRequest, reply: Reply) -> None:
        if len(self._requests) >= MAX_PENDING_REQUESTS:
            reply(FleetAnswer(ok=False, reason="too many requests"))
            return
        self._requests.append((ask, reply))
        self.wake()

    # --- the thread of the member -----------------------------------------------------------------------------------

    def _serve(self) -> None:
        busy = True
        while not self._over.is_set():
            self._wake.wait(BUSY_INTERVAL if busy else IDLE_INTERVAL)
            self._wake.clear()
            busy = self.run_once()

    def run_once(self) -> bool:
        """Answer pending requests, run the services, and publish the robot's state if it has changed.

        Return True if a service has work in progress, so that the next call is due soon.
        """
        while self._requests:
            ask, reply = self._requests.popleft()
            answer = self._run_safely(partial(self._answer, ask)) or FleetAnswer(
                ok=False, reason="internal error of this robot"
            )
            self._run_safely(partial(reply, answer))  # the operator may be gone
        self._check_duplicate()
        busy = [self._run_safely(partial(worker.step, self.clock.now())) is not False for worker in self.services]
        if self.clock.now() < self._quiet_until:
            return True
        state = self._run_safely(self._current_state) or self._state
        if _is_significant(self._state, state) or self.clock.now() - self._published_at > HEARTBEAT_INTERVAL:
            self._publish(state)
        return any(busy)

    def _check_duplicate(self) -> None:
        there = self.roster.get(self.info.address)
        if there is None or there.state is None or there.state.session == self._state.session or there.state.farewell:
            return
        if not self.is_duplicate:
            what = "fleet: another robot has the same number %s (a copied SD card?): rm fleet_number on one of them"
            log.error(what, self.info.address.number)
        self._duplicate_until = self.clock.now() + 3 * HEARTBEAT_INTERVAL

    @staticmethod
    def _run_safely(work: Callable[[], T]) -> T | None:
        """Call a function and log its exception, so that an error such as a full disk does not end the membership."""
        try:
            return work()
        except Exception:
            log.exception("error in the fleet")
            return None

    def _answer(self, ask: FleetRequest) -> FleetAnswer:
        match ask:
            case FleetRelease():
                return self._release(ask)
            case ListPeers():
                met = self.roster.members().values()
                peers = (Peer(robot=str(each.address), connection=each.connection) for each in met)
                return FleetAnswer(data=tuple(asdict(each) for each in peers))
        for worker in self.services:
            if (answer := worker.answer(ask)) is not None:
                return answer
        return FleetAnswer(ok=False, reason=f"'{ask.word}' is not supported here")

    def _release(self, ask: FleetRelease) -> FleetAnswer:
        try:
            released = self.latch.release(ask.stop)
        except OSError as error:
            return FleetAnswer(
                ok=False, reason=f"it stays stopped, since the release cannot be stored: {error.strerror}"
            )
        if not released:
            last = (
                f"the last one is {self.latch.number}, by {self.latch.by}" if self.latch.is_latched else "there is none"
            )
            return FleetAnswer(ok=False, reason=f"stop {ask.stop} is not latched: {last}")
        good, words = self.fleet_robot.release(ask.by, resume=ask.resume)
        return FleetAnswer(ok=good, reason=words)

    def _current_state(self) -> RobotState:
        seen, doing = self.fleet_robot.read_telemetry(), self.current_activity()
        return replace(
            self._state,
            mission=_printable(seen.mission),
            task=doing.task,
            task_state=doing.state,
            free=doing.free
            and not self.latch.is_latched
            and not self.is_duplicate
            and not (seen.runs and not doing.task),
            stops=self.latch.number,
            stopped=_printable(self.latch.by or seen.stopped),
            battery=_valid_number(seen.battery),
            x=_valid_number(seen.x),
            y=_valid_number(seen.y),
            heading=_valid_number(seen.heading),
            age=_valid_number(seen.age),
        )

    def _publish(self, state: RobotState) -> None:
        self._state = replace(state, number=self._state.number + 1)
        self._published_at = self.clock.now()
        with suppress(Exception):  # the connection is closed; the sender will retry
            self.transport.publish_state(encode_message(self._state))


def _printable(text: str) -> str:
    """Return a text without unprintable characters, cut to ``MAX_TEXT_LENGTH``."""
    return "".join(each for each in text[:MAX_TEXT_LENGTH] if each.isprintable())


def _valid_number(value: object) -> float | None:
    """Return ``value`` if it is a number that a fleet message may contain, else None."""
    sound = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MAX_INTEGER
    return value if sound else None  # type: ignore[return-value]


def _is_significant(old: RobotState, new: RobotState) -> bool:
    """Return whether a new state must be published at once: another mission, task or stop, or a large movement."""
    moved = any(
        (getattr(old, name) is None) != (getattr(new, name) is None)
        or abs((getattr(old, name) or 0.0) - (getattr(new, name) or 0.0)) >= step
        for name, step in (("x", MIN_MOVE), ("y", MIN_MOVE), ("heading", MIN_TURN), ("battery", 0.01))
    )
    still = {"x": None, "y": None, "heading": None, "battery": None, "age": None, "number": 0}
    return moved or replace(old, **still) != replace(new, **still)  # type: ignore[arg-type]
