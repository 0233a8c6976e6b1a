"""The frozen tick: while the executive ticks, time stands still and every question has one answer.

What behaviours have stored in variables by then is told as it changes.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy

from behaviours.node import Node
from behaviours.run import Run
from config.units import Quantity
from drivers.api import JointState, Reading
from missions.executive.answers import Answers
from missions.executive.events import VariableSet
from missions.executive.stream import Stream
from missions.executive.submission import Submission
from missions.executive.tick_record import Answer, Kind, TickRecord
from missions.language.kinds import STATE

Variables = dict[str, object]

_CHANGEABLE = frozenset({list, dict, set})
"""Kinds of values that may be others by the time they are told."""

_SIMPLE = frozenset({bool, int, float, str, Quantity})
"""Kinds of values that say the same when they are equal. With others, only one and the same is surely no news."""


class Changes:
    """Tells the ``stream`` what is new in the variables of a mission and of those inside it.

    To be asked after what may have stored something; in between it costs nothing. A list that a behaviour alters,
    instead of storing another, is no news.
    """

    def __init__(self, root: Node, run: Run, stream: Stream) -> None:
        self._run = run
        self._stream = stream
        inner = {node.key: node.inner for node in root.iterate() if isinstance(node, Submission)}
        self._scopes: list[tuple[str, Variables, Variables]] = [
            (key, variables, {}) for key, variables in ({"": run.variables} | inner).items()
        ]

    def tell(self) -> None:
        """Tell all that is new, if anybody wants to know."""
        if not self._stream.wanted:
            return
        time, tick = self._run.clock.now(), self._run.tick
        for scope, variables, told in self._scopes:
            for name, value in _news(variables, told):
                dimension = value.dimension if isinstance(value, Quantity) else None
                self._stream.emit(VariableSet(time, tick, scope, name, value, dimension))


def _news(variables: Variables, told: Variables) -> Iterator[tuple[str, object]]:
    """Yield what is new in ``variables`` since it was ``told``, and tell it there; what is gone is None."""
    for name, value in variables.items():
        if name not in STATE and not (name in told and _same(value, told[name])):
            told[name] = value
            yield name, copy(value) if type(value) in _CHANGEABLE else value
    for name in [name for name in told if name not in variables]:
        del told[name]
        yield name, None


def _same(one: object, other: object) -> bool:
    if isinstance(one, Quantity) and isinstance(other, Quantity) and one.dimension != other.dimension:
        return False
    return one is other or (type(one) is type(other) and type(one) in _SIMPLE and one == other)


SAMPLE_EVERY = 10
"""Ticks from one look at the parts of the robot that a mission does not ask, to the next."""

MOVING_EVERY = 3
"""Ticks from one look at joints to the next while some are on the move: a leg makes a step in less than a second.

Not 2 or 4: a walk of 0.8 s would be looked at in the same phases of its cycle all along, and its peaks be missed.
"""

JOINTS = "states"
"""The question that joints are looked at by."""

OnMoment = Callable[[TickRecord], None]
"""Told of each frozen tick, on the thread that ticks, right after it: it must neither wait nor raise."""


class FrozenTick:
    """Begins and ends the frozen ticks of a ``run``, and hands on the record of each, with its ``answers``."""

    def __init__(self, run: Run, answers: Answers, changes: Changes) -> None:
        self._run = run
        self._answers = answers
        self._changes = changes
        self._observers: tuple[OnMoment, ...] = ()
        self._begun_at = 0.0
        self._moving = False

    def observe(self, on_moment: OnMoment) -> None:
        """Call ``on_moment`` with the record of each frozen tick."""
        self._observers += (on_moment,)
        self._answers.kept = True

    def tell_changes(self) -> None:
        """Tell what variables have changed."""
        self._run.stored = False
        self._changes.tell()

    def begin(self) -> None:
        """Let time stand still."""
        if self._observers:
            self._begun_at = self._run.wall.now()
        self._answers.open = True
        self._run.held = self._run.clock.now()

    def end(self, kind: Kind, late: float = 0.0) -> None:
        """Let time go on, and hand over what the tick has brought."""
        run = self._run
        time, run.held = run.held or 0.0, None
        if kind == "tick":
            run.ticked_at = time
        if run.stored:
            self.tell_changes()
        if not self._observers:
            self._answers.close()
            return
        looked = run.tick % SAMPLE_EVERY == 1
        if looked or (self._moving and run.tick % MOVING_EVERY == 1):
            self._answers.sample("" if looked else JOINTS)
        answers, spent = self._answers.take(), run.wall.now() - self._begun_at
        if looked:
            self._moving = moving(answers)
        overheld, run.overstayed = run.overstayed, None
        record = TickRecord(kind, run.tick, time, late, spent, answers, overheld)
        for on_moment in self._observers:
            on_moment(record)


def moving(answers: Sequence[Answer]) -> bool:
    """Say whether joints that were looked at are on the move."""
    looks = [value for _, what, _, value in answers if what == JOINTS]
    return any(
        isinstance(reading, Reading) and isinstance(reading.value, JointState) and reading.value.moving
        for look in looks
        if isinstance(look, Mapping)
        for reading in look.values()
    )
