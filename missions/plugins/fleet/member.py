"""A robot in a fleet: it announces itself, tells how it is, and is stopped and released from afar."""

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
from missions.plugins.fleet.body import Body
from missions.plugins.fleet.line import Reply, Roster, ZenohLine
from missions.plugins.fleet.words import (
    MAX_TEXT_LENGTH,
    Address,
    Answer,
    Ask,
    Met,
    MetRobot,
    Release,
    RobotState,
    Stop,
    TaskState,
    as_bytes,
)
from missions.plugins.tasks.fleet_latch import FleetLatch

T = TypeVar("T")

PERIOD, IDLE = 0.1, 0.5
"""Seconds from one look at what is to be done to the next, and where there is nothing; what is asked is done at once.

A processor that sleeps is woken by each: ten a second are three quarters of what an idle robot's fleet costs.
"""

DISK = 0.1
"""Seconds for which the confirmation of a stop waits for the disk; the robot stands still before that."""

HEARTBEAT = 5.0
"""Seconds after which a robot tells how it is, though nothing has changed."""

SPREAD = 0.1, 0.5
"""Seconds after a stop in which a robot tells how it is: all at once, many would hold up each other's confirmations."""

STEP, TURN = 0.1, 0.2
"""Metres, and radians, that a robot has to move by for that to be told."""

MOST_WAITING = 1000
"""Questions that wait to be answered, at most; a stop never waits."""


@dataclass(frozen=True, slots=True)
class Doing:
    """What a robot is busy with: the ID and state of the fleet's task, if it has one, and whether it takes another."""

    task: str = ""
    state: TaskState | None = None
    free: bool = True


class Worker(Protocol):
    """What does or keeps the tasks of a fleet; on the member's thread."""

    def asked(self, ask: Ask) -> Answer | None:
        """Answer a question; None for one that is somebody else's."""
        ...

    def step(self, now: float) -> bool:
        """Do what is due; say whether more is under way."""
        ...


@dataclass(frozen=True, slots=True)
class Own:
    """What a robot is: its address, the name of its robot file, its parts, and whether it is simulated."""

    address: Address
    robot: str
    parts: tuple[str, ...] = ()
    simulated: bool = False


class Member:
    """A robot of a fleet, while it is entered: over its ``line``, with a ``body``, stopped as ``latch`` says.

    ``busy`` says what it does, on the member's thread; ``workers`` do what else is asked of it.
    """

    def __init__(
        self,
        own: Own,
        line: ZenohLine,
        roster: Roster,
        body: Body,
        latch: FleetLatch,
        *,
        workers: Sequence[Worker] = (),
        busy: Callable[[], Doing] = Doing,
        clock: Clock | None = None,
    ) -> None:
        self.own, self.line, self.roster, self.body, self.latch = own, line, roster, body, latch
        self.workers = list(workers)
        self.busy = busy
        self.clock = clock or SystemClock()
        self._waiting: deque[tuple[Ask, Reply]] = deque()
        self._wake, self._over = Event(), Event()
        self._state = RobotState(
            session=secrets.token_hex(4), number=0, robot=own.robot, parts=own.parts, simulated=own.simulated
        )
        self._told_at = 0.0
        self._pressed = ("", Answer())
        self._quiet_until = self._copied_until = float("-inf")
        self._thread = Thread(target=self._serve, name="fleet", daemon=True)

    def __enter__(self) -> Self:
        self.latch.load()
        if self.latch.stopped:
            self.body.stop(self.latch.by)
        self._state = self._now()
        self.line.announce(self.own.address, self._stopped, self._asked, lambda: as_bytes(self._state))
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._wake.set()
        self._thread.join()
        self._tell(replace(self._state, farewell=True, free=False))
        self.line.close()

    def wake(self) -> None:
        """Look soon at what is to be done. From any thread."""
        self._wake.set()

    @property
    def copied(self) -> bool:
        """Whether another robot has this address, as after a card was copied: neither does or keeps tasks then."""
        return self.clock.now() < self._copied_until

    # --- threads of the wire ----------------------------------------------------------------------------------------

    def _stopped(self, ask: Ask, reply: Reply) -> None:
        """Stop now, on a thread of its own: nothing else is waited for."""
        if not isinstance(ask, Stop):
            reply(Answer(ok=False, why=f"'{ask.word}' is asked elsewhere"))
            return
        press, answer = self._pressed
        if ask.press and ask.press == press:
            reply(answer)
            return
        if (now := self.clock.now()) > self._quiet_until + SPREAD[1]:  # who stops without end does not silence it
            self._quiet_until = now + uniform(*SPREAD)  # noqa: S311 - no secret
        number, keep = self.latch.stop(ask.by)
        kept: list[str] = []
        try:
            good, words = self.body.stop(ask.by)  # first: to start a thread takes its time on a busy machine
        finally:
            keeping = Thread(target=lambda: kept.append(keep()), name="keep the stop")
            keeping.start()  # a disk may take its time: who asks does not wait for it for long
        keeping.join(DISK)
        late = "; not on the disk yet, for a restart"
        answer = Answer(ok=good, why=words + (kept[0] if kept else late), told=({"stop": number},))
        self._pressed = (ask.press, answer)
        reply(answer)
        self.wake()

    def _asked(self, ask: Ask, reply: Reply) -> None:
        if len(self._waiting) >= MOST_WAITING:
            reply(Answer(ok=False, why="more is asked than can be answered"))
            return
        self._waiting.append((ask, reply))
        self.wake()

    # --- the thread of the member -----------------------------------------------------------------------------------

    def _serve(self) -> None:
        busy = True
        while not self._over.is_set():
            self._wake.wait(PERIOD if busy else IDLE)
            self._wake.clear()
            busy = self.turn()

    def turn(self) -> bool:
        """Answer what was asked, do what is due, and tell what has changed; say whether more is under way."""
        while self._waiting:
            ask, reply = self._waiting.popleft()
            answer = self._guarded(partial(self._answer, ask)) or Answer(ok=False, why="a fault of this robot's")
            self._guarded(partial(reply, answer))  # who asks may be gone
        self._look_for_a_copy()
        busy = [self._guarded(partial(worker.step, self.clock.now())) is not False for worker in self.workers]
        if self.clock.now() < self._quiet_until:
            return True
        state = self._guarded(self._now) or self._state
        if _worth(self._state, state) or self.clock.now() - self._told_at > HEARTBEAT:
            self._tell(state)
        return any(busy)

    def _look_for_a_copy(self) -> None:
        there = self.roster.get(self.own.address)
        if there is None or there.state is None or there.state.session == self._state.session or there.state.farewell:
            return
        if not self.copied:
            what = "fleet: another robot has the number %s of this one: was its card copied? rm fleet_number at one"
            log.error(what, self.own.address.number)
        self._copied_until = self.clock.now() + 3 * HEARTBEAT

    @staticmethod
    def _guarded(work: Callable[[], T]) -> T | None:
        """Do something; whatever goes wrong with it, such as a full disk, the robot stays in the fleet."""
        try:
            return work()
        except Exception:
            log.exception("the fleet stumbled")
            return None

    def _answer(self, ask: Ask) -> Answer:
        match ask:
            case Release():
                return self._release(ask)
            case Met():
                met = self.roster.members().values()
                told = (MetRobot(robot=str(each.address), connection=each.connection) for each in met)
                return Answer(told=tuple(asdict(each) for each in told))
        for worker in self.workers:
            if (answer := worker.asked(ask)) is not None:
                return answer
        return Answer(ok=False, why=f"'{ask.word}' is not answered here")

    def _release(self, ask: Release) -> Answer:
        try:
            released = self.latch.release(ask.stop)
        except OSError as error:
            return Answer(ok=False, why=f"it stays stopped, for that cannot be kept: {error.strerror}")
        if not released:
            last = f"the last one is {self.latch.number}, by {self.latch.by}" if self.latch.stopped else "none is"
            return Answer(ok=False, why=f"stop {ask.stop} is not latched: {last}")
        good, words = self.body.release(ask.by, resume=ask.resume)
        return Answer(ok=good, why=words)

    def _now(self) -> RobotState:
        """Return how the robot is now."""
        seen, doing = self.body.look(), self.busy()
        return replace(
            self._state,
            mission=_clean(seen.mission),
            task=doing.task,
            task_state=doing.state,
            free=doing.free and not self.latch.stopped and not self.copied and not (seen.runs and not doing.task),
            stops=self.latch.number,
            stopped=_clean(self.latch.by or seen.stopped),
            battery=_known(seen.battery),
            x=_known(seen.x),
            y=_known(seen.y),
            heading=_known(seen.heading),
            age=_known(seen.age),
        )

    def _tell(self, state: RobotState) -> None:
        self._state = replace(state, number=self._state.number + 1)
        self._told_at = self.clock.now()
        with suppress(Exception):  # the wire is closed: who is not reached asks again
            self.line.tell(as_bytes(self._state))


def _clean(text: str) -> str:
    """Return a text as others read it."""
    return "".join(each for each in text[:MAX_TEXT_LENGTH] if each.isprintable())


def _known(value: object) -> float | None:
    """Return a number that others read; what a run tells may be none."""
    sound = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MAX_INTEGER
    return value if sound else None  # type: ignore[return-value]


def _worth(old: RobotState, new: RobotState) -> bool:
    """Say whether a change is worth telling at once: another mission, task, stop; or a step of its way."""
    moved = any(
        (getattr(old, name) is None) != (getattr(new, name) is None)
        or abs((getattr(old, name) or 0.0) - (getattr(new, name) or 0.0)) >= step
        for name, step in (("x", STEP), ("y", STEP), ("heading", TURN), ("battery", 0.01))
    )
    still = {"x": None, "y": None, "heading": None, "battery": None, "age": None, "number": 0}
    return moved or replace(old, **still) != replace(new, **still)  # type: ignore[arg-type]
