"""Decides a mission again: the tree of today is told what the recorded one was told, moment after moment.

Nothing moves, and no device is open. The first status that is another than then ends it: what the robot would have been
told from there on is nowhere recorded.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol, runtime_checkable

from behaviours.robot import Other, Robot
from behaviours.run import Run
from config.robot import RobotConfig
from drivers.api import (
    AS_USUAL,
    Device,
    Manner,
    MouthShape,
    Priority,
    Utterance,
)
from drivers.api.kinds import KINDS
from drivers.api.marks import members, no_answer
from drivers.clock import ManualClock
from missions.assembly.together import eye, groups, with_carriers
from missions.executive.answers import Answers
from missions.executive.asked import asked, protocol_of, robot_for, unusual
from missions.executive.build import Substitute, as_it_is, build
from missions.executive.events import Event, NodeChanged
from missions.executive.executive import Executive
from missions.executive.guard import Guard
from missions.executive.state import state_of
from missions.executive.stream import Stream
from missions.executive.tick_record import TickRecord
from missions.language.plan import Plan
from missions.plugins.records.replay.compare import Comparison, Difference
from missions.plugins.records.replay.memory import Memory, Told
from missions.trees.draw import drawing_of
from missions.trees.drawing import Drawing

# A robot that answers out of a record: no device is behind it, and nothing moves.

Groups = Mapping[str, tuple[str, ...]]
"""Groups of joints."""

NOTHING: Mapping[str, tuple[str, Groups]] = MappingProxyType({})

LETTER_TIME = 0.06
"""Seconds that a letter takes to say, where nobody knows how long it took."""

SOUND_TIME = 1.0
"""The same for a sound."""


def answering(
    parts: Collection[str],
    memory: Memory,
    now: Callable[[], float],
    *,
    eye: tuple[float, float, float],
    groups: Groups,
    others: Mapping[str, tuple[str, Groups]] = NOTHING,
) -> Robot:
    """Return a robot of these parts that answers out of ``memory``; ``now`` tells the time of the record.

    ``others`` are the kinds of further parts, with the groups of the joints of those that are arms.
    """
    fields: dict[str, Any] = {}
    further = {
        name: Other(kind, Answering(name, protocol_of(kind), memory, name), its)
        for name, (kind, its) in others.items()
        if name in parts
    }
    for kind in KINDS.values():
        if kind.name == "voice" and kind.name in parts:
            fields["voice_part"] = AnsweringVoice(memory, now)
        elif kind.name in parts:
            fields[f"{kind.field}_part"] = Answering(kind.name, protocol_of(kind.field), memory, kind.field)
    return Robot(**fields, eye=eye, groups=groups, others=further)


class Answering:
    """A part with any ``protocol`` that answers out of ``memory``, behind its proxy; see ``drivers.api.marks``.

    A command that is not as it was then is answered as its mark says: of a velocity, with what is within the limits.
    ``part`` is its name in answers.
    """

    def __init__(self, name: str, protocol: type, memory: Memory, part: str) -> None:
        self.name = name
        self._part = part
        self._memory = memory
        self._properties = {each.name for each in members(protocol).values() if each.kind == "property"}
        for each in members(protocol).values():
            match each.kind:
                case "reading" | "question":
                    setattr(self, each.name, partial(memory.ask, self._part, each.name))
                case "capability" if each.protocol is not None:
                    setattr(self, each.name, Answering(name, each.protocol, memory, part))
                case "command" if each.command is not None:
                    setattr(self, each.name, partial(self._do, each.name, each.command.otherwise))

    def open(self) -> None:
        """Do nothing: there is nothing to open."""

    def close(self) -> None:
        """Do nothing: there is nothing to close."""

    def __getattr__(self, name: str) -> Any:
        """Return a property as it was then."""
        if name not in self._properties:
            raise AttributeError(f"{self.name} has no {name}")
        return self._memory.ask(self._part, name)

    def _do(self, what: str, otherwise: Callable[..., object], *given: object, **named: object) -> Any:
        """Return what came of a command then; a proxy gives all its arguments, in the protocol's order."""
        arguments = (*given, *named.values())
        return self._memory.command(self._part, what, partial(otherwise, self, *arguments), *arguments)


class AnsweringVoice(Answering):
    """A voice that is as long about its words as it was then."""

    def __init__(self, memory: Memory, now: Callable[[], float]) -> None:
        super().__init__("voice", Device, memory, "voice")
        self._now = now

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """Say nothing; what comes back is done when it was then, or after about the time that other words take."""
        return self._said(self._do("say", no_answer, text, *unusual(manner, priority)), LETTER_TIME * len(text))

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Play nothing, as ``say`` does."""
        _, otherwise = unusual(AS_USUAL, priority)
        return self._said(self._do("play", no_answer, str(path), otherwise), SOUND_TIME)

    def speaking(self) -> Utterance | None:
        """What was heard then."""
        number: int | None = self._memory.ask("voice", "speaking")
        return None if number is None else _Recalled(self._memory, number)

    def _said(self, number: int | None, seconds: float) -> Utterance:
        return _Guessed(self._now, seconds) if number is None else _Recalled(self._memory, number)


class _Recalled:
    """Words that were said then, by their number."""

    def __init__(self, memory: Memory, number: int) -> None:
        self._number = number
        self._ask = partial(memory.ask, "voice")
        self._memory = memory

    def done(self) -> bool:
        """See drivers.api.Utterance."""
        return bool(self._ask("done", self._number))

    def cancel(self) -> None:
        """See drivers.api.Utterance."""
        self._memory.command("voice", "cancel", no_answer, self._number)

    @property
    def cancelled(self) -> bool:
        """See drivers.api.Utterance."""
        return bool(self._ask("cancelled", self._number))

    @property
    def started(self) -> float | None:
        """See drivers.api.Utterance."""
        found: float | None = self._ask("started", self._number)
        return found

    @property
    def mouth(self) -> Sequence[MouthShape]:
        """See drivers.api.Utterance."""
        found: Sequence[MouthShape] = self._ask("mouth", self._number)
        return found


class _Guessed:
    """Words that nobody said: they begin at once, and are done after some ``seconds``."""

    mouth: Sequence[MouthShape] = ()
    cancelled = False

    def __init__(self, now: Callable[[], float], seconds: float) -> None:
        self.started: float | None = now()
        self._now = now
        self._until = now() + seconds

    def done(self) -> bool:
        """See drivers.api.Utterance."""
        return self._now() >= self._until

    def cancel(self) -> None:
        """See drivers.api.Utterance."""
        self.cancelled = self.cancelled or not self.done()
        self._until = self._now()


class Recorded(Protocol):
    """What a mission is decided again from: ``missions.plugins.records.recording.read.Record``, or one in memory."""

    @property
    def whole(self) -> bool:
        """Whether it was brought to its end; else the last tick may be there in part."""
        ...

    @property
    def moments(self) -> Sequence[TickRecord]:
        """Every moment, with the answers that were given in it."""
        ...

    @property
    def events(self) -> Sequence[Event]:
        """All that happened."""
        ...


@runtime_checkable
class Drawn(Protocol):
    """A record that holds the tree of then, which today's may differ from; one in memory is of today's plan."""

    def drawing(self) -> Drawing:
        """Return the tree as it was then."""
        ...


@dataclass(frozen=True, slots=True)
class OtherCommand:
    """A command that is not as it was then: ``then`` or ``now`` is None where there is none. ``by`` is who gives it."""

    tick: int
    t: float
    part: str
    then: Told | None
    now: Told | None
    by: str


@dataclass(frozen=True, slots=True)
class Rerun:
    """How the decisions of today compare with those of then, in so many ``ticks``.

    ``difference`` is the first status that is another one, ``command`` the first command that is. ``unheard`` says what
    was asked that the record has no answer to, and by whom. ``words`` counts statuses that are the same for a reason
    in other words, of which ``reworded`` is the first. ``nodes`` says how many nodes were compared.
    """

    ticks: int
    nodes: int
    difference: Difference | None = None
    command: OtherCommand | None = None
    unheard: str = ""
    words: int = 0
    reworded: Difference | None = None

    @property
    def same(self) -> bool:
        """Whether all was decided as it was then."""
        return self.difference is None and self.command is None and not self.unheard


def rerun(
    record: Recorded,
    plan: Plan,
    config: RobotConfig,
    *,
    seed: int = 0,
    lag: float | None = None,
    substitute: Substitute = as_it_is,
) -> Rerun:
    """Decide ``plan`` again as on the record, on a robot of ``config``, until the first difference.

    ``substitute`` puts mocks in the place of leaves, as when it was recorded; ``lag`` is what was known of the base's.
    """
    again = _Again(record, plan, config, seed, lag, substitute)
    ticks = [list(moments) for _, moments in groupby(record.moments, key=lambda moment: moment.tick)]
    for moments in ticks if record.whole else ticks[:-1]:
        again.tick(moments)
        if again.over:
            break
    return again.result


class _Again:
    """The tree of today, and who compares what it does."""

    def __init__(
        self,
        record: Recorded,
        plan: Plan,
        config: RobotConfig,
        seed: int,
        lag: float | None,
        substitute: Substitute,
    ) -> None:
        self._clock = ManualClock()
        self._run = run = Run(self._clock, seed=seed)
        run.sensor_timeout = config.sensor_timeout
        self._memory = Memory(unheard=self._note_unheard, otherwise=self._note_command, others=config.others)
        answers, stream = Answers(), Stream()
        robot = asked(
            answering(
                with_carriers(config, plan.tree.parts),
                self._memory,
                run.now,
                eye=eye(config),
                groups=groups(config),
                others={name: (kind, groups(config, name)) for name, kind in config.others.items()},
            ),
            answers,
        )
        if lag is not None:
            robot.lag.believe(lag, learnt=True)
        guard = None
        if robot.base_part is not None and config.base is not None:
            guard = Guard(robot.base_part, config.base.reflexes, run, stream)
        run.variables.update(state_of(robot, run, guard))
        root = build(plan, run, lambda leaf: robot_for(leaf, robot, _untold), substitute=substitute)
        self._executive = Executive(
            root, run, stream, rate=config.rate, mission=plan.mission, guard=guard, answers=answers
        )
        changes = [event for event in record.events if isinstance(event, NodeChanged)]
        now = drawing_of(plan)
        self._comparison = Comparison(changes, record.drawing() if isinstance(record, Drawn) else now, now, root)
        stream.listeners.append(self._comparison)
        self.result = Rerun(0, len(self._comparison.pairs))

    @property
    def over(self) -> bool:
        """Whether there is nothing more to be known."""
        return self.result.difference is not None or bool(self.result.unheard)

    def tick(self, moments: Sequence[TickRecord]) -> None:
        """Do again what was done at the moments of one tick."""
        for moment in moments:
            self._clock.reach(moment.t)
            self._memory.begin(moment.answers)
            self._executive.repeat(moment)
            self._memory.end()
        newest = moments[-1]
        difference = self._comparison.after(newest.tick, newest.t)
        self.result = replace(
            self.result,
            ticks=self.result.ticks + 1,
            difference=None if self.result.unheard else difference,
            words=self._comparison.words,
            reworded=self._comparison.reworded,
        )

    def _note_unheard(self, question: str) -> None:
        """Note the first question that the record has no answer to."""
        if not self.result.unheard:
            by = "" if self._run.working is None else f"{self._run.working.place} asks for "
            when = f"in tick {self._run.tick}, at {self._run.now():.2f} s"
            self.result = replace(self.result, unheard=f"{when}, {by}{question}")

    def _note_command(self, part: str, then: Told | None, now: Told | None) -> None:
        """Note the first command that is another one."""
        if self.result.command is None:
            leaf, tick, time = self._run.working, self._run.tick, self._run.now()
            by = "" if leaf is None or now is None else leaf.place
            self.result = replace(self.result, command=OtherCommand(tick, time, part, then, now, by))


def _untold(*_: object) -> None:
    """Tell nobody of a command: the memory knows of it."""
