"""Decides a mission again: the tree of today is told what the recorded one was told, moment after moment.

Nothing moves, and no device is open. The first status that is another than then ends it: what the robot would have been
told from there on is nowhere recorded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Protocol, runtime_checkable

from behaviours.run import Run
from config.robot import RobotConfig
from drivers.clock import ManualClock
from missions.assembly.together import eye, groups, with_carriers
from missions.executive.answers import Answers
from missions.executive.asked import asked, robot_for
from missions.executive.build import Substitute, as_it_is, build
from missions.executive.events import Event, NodeChanged
from missions.executive.executive import Executive
from missions.executive.guard import Guard
from missions.executive.state import state_of
from missions.executive.stream import Stream
from missions.executive.tick_record import TickRecord
from missions.language.plan import Plan
from missions.records.replay.answering import answering
from missions.records.replay.compare import Comparison, Difference
from missions.records.replay.memory import Memory, Told
from missions.views.pictures.draw import drawing_of
from missions.views.pictures.drawing import Drawing


class Recorded(Protocol):
    """What a mission is decided again from: ``missions.records.recording.read.Record``, or the like of it in memory."""

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
