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

from behaviours.robot import ExtraPart, Robot
from behaviours.run import RunState
from config.robot import RobotConfig
from drivers.api import (
    DEFAULT_STYLE,
    Device,
    MouthShape,
    Priority,
    SpeechStyle,
    Utterance,
)
from drivers.api.kinds import KINDS
from drivers.api.marks import members, reply_none
from drivers.clock import ManualClock
from missions.assembly.part_factory import camera_position, joint_groups, with_carriers
from missions.executive.build import Substitute, build, keep_leaf
from missions.executive.events import Event, NodeChanged
from missions.executive.executive import Executive
from missions.executive.guard import BaseGuard
from missions.executive.proxied_robot import non_default_manner, resolve_protocol, robot_for, with_proxies
from missions.executive.state import state_of
from missions.executive.stream import EventStream
from missions.executive.tick_cache import TickCache
from missions.executive.tick_record import TickRecord
from missions.language.plan import Plan
from missions.plugins.records.replay.recorded_answers import RecordedAnswers, RecordedCommand
from missions.plugins.records.replay.status_comparison import StatusComparison, StatusDifference
from missions.trees.drawing import TreeDrawing
from missions.trees.drawing_builder import drawing_of

# A robot that answers out of a record: no device is behind it, and nothing moves.

JointGroups = Mapping[str, tuple[str, ...]]
"""Groups of joints."""

NO_PARTS: Mapping[str, tuple[str, JointGroups]] = MappingProxyType({})

SECONDS_PER_LETTER = 0.06
"""Seconds that a letter takes to say, where nobody knows how long it took."""

SOUND_DURATION = 1.0
"""The same for a sound."""


def recorded_robot(
    parts: Collection[str],
    answers: RecordedAnswers,
    now: Callable[[], float],
    *,
    eye: tuple[float, float, float],
    groups: JointGroups,
    other_parts: Mapping[str, tuple[str, JointGroups]] = NO_PARTS,
) -> Robot:
    """Return a robot of these parts that answers out of ``memory``; ``current`` tells the time of the record.

    ``others`` are the kinds of further parts, with the groups of the joints of those that are arms.
    """
    fields: dict[str, Any] = {}
    further = {
        name: ExtraPart(kind, ReplayedPart(name, resolve_protocol(kind), answers, name), its)
        for name, (kind, its) in other_parts.items()
        if name in parts
    }
    for kind in KINDS.values():
        if kind.name == "voice" and kind.name in parts:
            fields["voice_part"] = ReplayedVoice(answers, now)
        elif kind.name in parts:
            fields[f"{kind.field}_part"] = ReplayedPart(kind.name, resolve_protocol(kind.field), answers, kind.field)
    return Robot(**fields, camera_position=eye, groups=groups, extra_parts=further)


class ReplayedPart:
    """A part with any ``protocol`` that answers out of ``memory``, behind its proxy; see ``drivers.api.marks``.

    A command that is not as it was then is answered as its mark says: of a velocity, with what is within the limits.
    ``part`` is its name in answers.
    """

    def __init__(self, name: str, protocol: type, answers: RecordedAnswers, part: str) -> None:
        self.name = name
        self._part = part
        self._answers = answers
        self._properties = {each.name for each in members(protocol).values() if each.kind == "property"}
        for each in members(protocol).values():
            match each.kind:
                case "reading" | "question":
                    setattr(self, each.name, partial(answers.answer, self._part, each.name))
                case "capability" if each.protocol is not None:
                    setattr(self, each.name, ReplayedPart(name, each.protocol, answers, part))
                case "command" if each.command is not None:
                    setattr(self, each.name, partial(self._command, each.name, each.command.default_reply))

    def open(self) -> None:
        """Do nothing: there is nothing to open."""

    def close(self) -> None:
        """Do nothing: there is nothing to close."""

    def __getattr__(self, name: str) -> Any:
        """Return a property as it was then."""
        if name not in self._properties:
            raise AttributeError(f"{self.name} has no {name}")
        return self._answers.answer(self._part, name)

    def _command(self, what: str, otherwise: Callable[..., object], *given: object, **named: object) -> Any:
        """Return what came of a command then; a proxy gives all its arguments, in the protocol's order."""
        arguments = (*given, *named.values())
        return self._answers.command(self._part, what, partial(otherwise, self, *arguments), *arguments)


class ReplayedVoice(ReplayedPart):
    """A voice that is as long about its words as it was then."""

    def __init__(self, answers: RecordedAnswers, now: Callable[[], float]) -> None:
        super().__init__("voice", Device, answers, "voice")
        self._now = now

    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """Say nothing; what comes back is done when it was then, or after about the time that other words take."""
        return self._utterance(
            self._command("say", reply_none, text, *non_default_manner(manner, priority)),
            SECONDS_PER_LETTER * len(text),
        )

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Play nothing, as ``say`` does."""
        _, otherwise = non_default_manner(DEFAULT_STYLE, priority)
        return self._utterance(self._command("play", reply_none, str(path), otherwise), SOUND_DURATION)

    def speaking(self) -> Utterance | None:
        """What was heard then."""
        number: int | None = self._answers.answer("voice", "speaking")
        return None if number is None else _RecordedUtterance(self._answers, number)

    def _utterance(self, number: int | None, seconds: float) -> Utterance:
        return _EstimatedUtterance(self._now, seconds) if number is None else _RecordedUtterance(self._answers, number)


class _RecordedUtterance:
    """Words that were said then, by their number."""

    def __init__(self, answers: RecordedAnswers, number: int) -> None:
        self._number = number
        self._ask = partial(answers.answer, "voice")
        self._answers = answers

    def done(self) -> bool:
        """See drivers.api.Utterance."""
        return bool(self._ask("done", self._number))

    def cancel(self) -> None:
        """See drivers.api.Utterance."""
        self._answers.command("voice", "cancel", reply_none, self._number)

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


class _EstimatedUtterance:
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


class RerunSource(Protocol):
    """What a mission is decided again from: ``missions.plugins.records.recording.run_record.RunRecord``, or one in memory."""

    @property
    def is_complete(self) -> bool:
        """Whether it was brought to its end; else the last tick may be there in part."""
        ...

    @property
    def tick_records(self) -> Sequence[TickRecord]:
        """Every moment, with the answers that were given in it."""
        ...

    @property
    def events(self) -> Sequence[Event]:
        """All that happened."""
        ...


@runtime_checkable
class TreeSource(Protocol):
    """A record that holds the tree of then, which today's may differ from; one in memory is of today's plan."""

    def drawing(self) -> TreeDrawing:
        """Return the tree as it was then."""
        ...


@dataclass(frozen=True, slots=True)
class CommandDifference:
    """A command that is not as it was then: ``recorded`` or ``current`` is None where there is none. ``place`` is who gives it."""

    tick: int
    t: float
    part: str
    recorded: RecordedCommand | None
    current: RecordedCommand | None
    place: str


@dataclass(frozen=True, slots=True)
class RerunResult:
    """How the decisions of today compare with those of then, in so many ``ticks``.

    ``difference`` is the first status that is another one, ``command`` the first command that is. ``unanswered`` says what
    was asked that the record has no answer to, and by whom. ``reworded_count`` counts statuses that are the same for a reason
    in other words, of which ``first_reworded`` is the first. ``nodes`` says how many nodes were compared.
    """

    ticks: int
    nodes: int
    difference: StatusDifference | None = None
    command: CommandDifference | None = None
    unanswered: str = ""
    reworded_count: int = 0
    first_reworded: StatusDifference | None = None

    @property
    def is_identical(self) -> bool:
        """Whether all was decided as it was then."""
        return self.difference is None and self.command is None and not self.unanswered


def rerun(
    record: RerunSource,
    plan: Plan,
    config: RobotConfig,
    *,
    seed: int = 0,
    lag: float | None = None,
    substitute: Substitute = keep_leaf,
) -> RerunResult:
    """Decide ``plan`` again as on the record, on a robot of ``config``, until the first difference.

    ``substitute`` puts mocks in the place of leaves, as when it was recorded; ``lag`` is what was known of the base's.
    """
    again = _Rerun(record, plan, config, seed, lag, substitute)
    ticks = [list(moments) for _, moments in groupby(record.tick_records, key=lambda moment: moment.tick)]
    for moments in ticks if record.is_complete else ticks[:-1]:
        again.repeat_tick(moments)
        if again.is_over:
            break
    return again.result


class _Rerun:
    """The tree of today, and who compares what it does."""

    def __init__(
        self,
        record: RerunSource,
        plan: Plan,
        config: RobotConfig,
        seed: int,
        lag: float | None,
        substitute: Substitute,
    ) -> None:
        self._clock = ManualClock()
        self._run = run = RunState(self._clock, seed=seed)
        run.sensor_timeout = config.sensor_timeout
        self._answers = RecordedAnswers(
            on_unanswered=self._note_unanswered, on_different_command=self._note_command, other_kinds=config.extra_parts
        )
        answers, stream = TickCache(), EventStream()
        robot = with_proxies(
            recorded_robot(
                with_carriers(config, plan.tree.parts),
                self._answers,
                run.now,
                eye=camera_position(config),
                groups=joint_groups(config),
                other_parts={name: (kind, joint_groups(config, name)) for name, kind in config.extra_parts.items()},
            ),
            answers,
        )
        if lag is not None:
            robot.lag.set_prior(lag, learnt=True)
        guard = None
        if robot.base_part is not None and config.base is not None:
            guard = BaseGuard(robot.base_part, config.base.reflexes, run, stream)
        run.variables.update(state_of(robot, run, guard))
        root = build(plan, run, lambda leaf: robot_for(leaf, robot, _ignore_command), substitute=substitute)
        self._executive = Executive(
            root, run, stream, rate=config.rate, mission=plan.mission, guard=guard, cache=answers
        )
        changes = [event for event in record.events if isinstance(event, NodeChanged)]
        now = drawing_of(plan)
        self._comparison = StatusComparison(
            changes, record.drawing() if isinstance(record, TreeSource) else now, now, root
        )
        stream.listeners.append(self._comparison)
        self.result = RerunResult(0, len(self._comparison.pairs))

    @property
    def is_over(self) -> bool:
        """Whether there is nothing more to be known."""
        return self.result.difference is not None or bool(self.result.unanswered)

    def repeat_tick(self, tick_records: Sequence[TickRecord]) -> None:
        """Do again what was done at the moments of one tick."""
        for moment in tick_records:
            self._clock.advance_to(moment.t)
            self._answers.begin_tick(moment.answers)
            self._executive.replay_tick(moment)
            self._answers.end_tick()
        newest = tick_records[-1]
        difference = self._comparison.finish_tick(newest.tick, newest.t)
        self.result = replace(
            self.result,
            ticks=self.result.ticks + 1,
            difference=None if self.result.unanswered else difference,
            reworded_count=self._comparison.reworded_count,
            first_reworded=self._comparison.first_reworded,
        )

    def _note_unanswered(self, query: str) -> None:
        """Note the first question that the record has no answer to."""
        if not self.result.unanswered:
            by = "" if self._run.active_leaf is None else f"{self._run.active_leaf.label} asks for "
            when = f"in tick {self._run.tick}, at {self._run.now():.2f} s"
            self.result = replace(self.result, unanswered=f"{when}, {by}{query}")

    def _note_command(self, part: str, recorded: RecordedCommand | None, current: RecordedCommand | None) -> None:
        """Note the first command that is another one."""
        if self.result.command is None:
            leaf, tick, time = self._run.active_leaf, self._run.tick, self._run.now()
            by = "" if leaf is None or current is None else leaf.label
            self.result = replace(self.result, command=CommandDifference(tick, time, part, recorded, current, by))


def _ignore_command(*_: object) -> None:
    """Tell nobody of a command: the memory knows of it."""
