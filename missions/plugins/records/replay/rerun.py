"""Repeat the decisions of a mission: the current tree gets the recorded inputs, tick by tick.

Nothing moves, and no device is opened. The rerun ends at the first different status, since the inputs of a robot that
behaves differently are not recorded.
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

# A robot without devices that replies from a record.

JointGroups = Mapping[str, tuple[str, ...]]
"""Names of the joints in each joint group of an arm, by the name of the group."""

NO_PARTS: Mapping[str, tuple[str, JointGroups]] = MappingProxyType({})

SECONDS_PER_LETTER = 0.06
"""Estimated speaking time of a letter, for speech that is not recorded."""

SOUND_DURATION = 1.0
"""Estimated duration in seconds of a sound whose playback is not recorded."""


def recorded_robot(
    parts: Collection[str],
    answers: RecordedAnswers,
    now: Callable[[], float],
    *,
    eye: tuple[float, float, float],
    groups: JointGroups,
    other_parts: Mapping[str, tuple[str, JointGroups]] = NO_PARTS,
) -> Robot:
    """Return a robot whose ``parts`` reply from ``answers``; ``now`` returns the time of the record (s).

    ``eye`` is the position of the camera (m), ``groups`` are the joint groups of the arm. ``other_parts`` has the kind
    of each additional part (such as a second arm) by name, with the joint groups of an arm.
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
    """A part of the robot that has the methods of ``protocol``, and replies from the recorded ``answers``.

    ``part`` is its name in the record. If a command differs from the record, there is no recorded reply to it. It then
    gets the reply that the protocol declares: for a velocity, the limited velocity (``drivers.api.marks``).
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
        """Do nothing: a replayed part has no device."""

    def close(self) -> None:
        """Do nothing: a replayed part has no device."""

    def __getattr__(self, name: str) -> Any:
        """Return the recorded value of the part's property ``name``. Raises AttributeError if the protocol lacks it."""
        if name not in self._properties:
            raise AttributeError(f"{self.name} has no {name}")
        return self._answers.answer(self._part, name)

    def _command(self, what: str, otherwise: Callable[..., object], *given: object, **named: object) -> Any:
        """Return the recorded result of a command, or the result of ``otherwise`` if the record has another command.

        ``what`` is the name of the command. The proxy passes all its arguments, in the order of the protocol.
        """
        arguments = (*given, *named.values())
        return self._answers.command(self._part, what, partial(otherwise, self, *arguments), *arguments)


class ReplayedVoice(ReplayedPart):
    """A voice that is silent, and whose utterances take as long as in the record."""

    def __init__(self, answers: RecordedAnswers, now: Callable[[], float]) -> None:
        super().__init__("voice", Device, answers, "voice")
        self._now = now

    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """Say nothing; return an utterance with the recorded duration, or an estimated one if there is none."""
        return self._utterance(
            self._command("say", reply_none, text, *non_default_manner(manner, priority)),
            SECONDS_PER_LETTER * len(text),
        )

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Play nothing; return an utterance with the recorded duration, or an estimated one if there is none."""
        _, otherwise = non_default_manner(DEFAULT_STYLE, priority)
        return self._utterance(self._command("play", reply_none, str(path), otherwise), SOUND_DURATION)

    def speaking(self) -> Utterance | None:
        """Return the utterance that is in progress by the record; None if the voice is silent."""
        number: int | None = self._answers.answer("voice", "speaking")
        return None if number is None else _RecordedUtterance(self._answers, number)

    def _utterance(self, number: int | None, seconds: float) -> Utterance:
        return _EstimatedUtterance(self._now, seconds) if number is None else _RecordedUtterance(self._answers, number)


class _RecordedUtterance:
    """An utterance of the recorded run, identified by its number in the record."""

    def __init__(self, answers: RecordedAnswers, number: int) -> None:
        self._number = number
        self._ask = partial(answers.answer, "voice")
        self._answers = answers

    def done(self) -> bool:
        return bool(self._ask("done", self._number))

    def cancel(self) -> None:
        self._answers.command("voice", "cancel", reply_none, self._number)

    @property
    def cancelled(self) -> bool:
        return bool(self._ask("cancelled", self._number))

    @property
    def started(self) -> float | None:
        found: float | None = self._ask("started", self._number)
        return found

    @property
    def mouth(self) -> Sequence[MouthShape]:
        found: Sequence[MouthShape] = self._ask("mouth", self._number)
        return found


class _EstimatedUtterance:
    """An utterance that the record lacks: it starts at once, and ends after ``seconds``."""

    mouth: Sequence[MouthShape] = ()
    cancelled = False

    def __init__(self, now: Callable[[], float], seconds: float) -> None:
        self.started: float | None = now()
        self._now = now
        self._until = now() + seconds

    def done(self) -> bool:
        return self._now() >= self._until

    def cancel(self) -> None:
        self.cancelled = self.cancelled or not self.done()
        self._until = self._now()


class RerunSource(Protocol):
    """Record to rerun: a ``missions.plugins.records.recording.run_record.RunRecord``, or a record kept in memory."""

    @property
    def is_complete(self) -> bool:
        """Whether the record was closed; otherwise its last tick may be incomplete."""
        ...

    @property
    def tick_records(self) -> Sequence[TickRecord]:
        """All tick records, with the recorded replies of the robot's parts."""
        ...

    @property
    def events(self) -> Sequence[Event]:
        """All events of the recorded run."""
        ...


@runtime_checkable
class TreeSource(Protocol):
    """A record that contains the tree of its run.

    A record kept in memory has no tree, and is compared with the current plan.
    """

    def drawing(self) -> TreeDrawing:
        """Return the recorded tree."""
        ...


@dataclass(frozen=True, slots=True)
class CommandDifference:
    """A command to a part that differs between rerun and record; one of the two is None if it is missing there.

    ``place`` is the leaf that sent the command.
    """

    tick: int
    t: float
    part: str
    recorded: RecordedCommand | None
    current: RecordedCommand | None
    place: str


@dataclass(frozen=True, slots=True)
class RerunResult:
    """Result of a rerun over ``ticks`` ticks.

    ``difference`` is the first different status, ``command`` the first different command. ``unanswered`` is the first
    query without a recorded reply, with tick and leaf. ``reworded_count`` is the number of equal statuses with
    different reasons; ``first_reworded`` is the first of these. ``nodes`` is the number of compared nodes.
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
        """Whether all decisions are as recorded."""
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
    """Repeat the decisions of ``record`` with ``plan``, on a robot of ``config``, up to the first difference.

    ``seed`` is the random seed of the recorded run, ``lag`` its delay of the base (s). ``substitute`` replaces leaves
    by the mocks of the recorded run.
    """
    again = _Rerun(record, plan, config, seed, lag, substitute)
    ticks = [list(moments) for _, moments in groupby(record.tick_records, key=lambda moment: moment.tick)]
    for moments in ticks if record.is_complete else ticks[:-1]:
        again.repeat_tick(moments)
        if again.is_over:
            break
    return again.result


class _Rerun:
    """The tree of a rerun, with the comparison of its statuses and commands with the recorded ones."""

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
        """Whether the rerun cannot go on: a status differs, or a query has no recorded reply."""
        return self.result.difference is not None or bool(self.result.unanswered)

    def repeat_tick(self, tick_records: Sequence[TickRecord]) -> None:
        """Repeat one tick with its recorded inputs, and compare the statuses.

        A tick usually has one tick record; checks of the base while the mission was paused add more.
        """
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
        """Store the first query without a recorded reply."""
        if not self.result.unanswered:
            by = "" if self._run.active_leaf is None else f"{self._run.active_leaf.label} queries "
            when = f"in tick {self._run.tick}, at {self._run.now():.2f} s"
            self.result = replace(self.result, unanswered=f"{when}, {by}{query}")

    def _note_command(self, part: str, recorded: RecordedCommand | None, current: RecordedCommand | None) -> None:
        """Store the first command that differs from the record, with the leaf that sends it."""
        if self.result.command is None:
            leaf, tick, time = self._run.active_leaf, self._run.tick, self._run.now()
            by = "" if leaf is None or current is None else leaf.label
            self.result = replace(self.result, command=CommandDifference(tick, time, part, recorded, current, by))


def _ignore_command(*_: object) -> None:
    """Ignore a command event: ``RecordedAnswers`` compares the commands."""
