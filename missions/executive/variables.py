"""What behaviours have stored in the variables of a run, told as it changes."""

from collections.abc import Iterator
from copy import copy

from behaviours.node import Node
from behaviours.run import Run
from config.units import Quantity
from missions.executive.events import Stream, VariableSet
from missions.executive.submission import Submission
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
                self._stream.emit(VariableSet(time, tick, scope, name, value))


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
