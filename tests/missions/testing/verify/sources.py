"""The attributes of a node that decide what it does next, found in the source of its class.

They are those that a method sets, and a method reads again. One that is set only where the node starts means nothing
while it does not run.
"""

import ast
import inspect
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from types import FunctionType

from behaviours.node import Node

OURS = ("behaviours.", "missions.", "tests.")
"""The packages whose classes are read: py_trees' own methods are not called."""

STARTS = frozenset({"on_start", "begin", "initialise"})
"""The methods by which a node forgets an earlier run of it."""

IGNORED = frozenset(
    {
        "status",  # kept for every node
        "feedback_message",  # words for people
        "values",  # used up in the tick in which they are set
        "_halt_tick",  # compared within a tick only
        "_cleanup_tick",  # as that
        "suspension",  # used up in the tick in which it is set; for other ticks it is kept by another name
        "_unticked",  # as the next two: when actuators come to rest, which a stand-in does not have
        "_unticked_since",
        "_paused",
        "_started_at",  # how long a leaf has run, which no stand-in asks
    }
)


@dataclass
class Use:
    """What the methods of a class do with the attributes of ``self``, and what they read of other objects."""

    stored: set[str] = field(default_factory=set)
    begun: set[str] = field(default_factory=set)
    read: set[str] = field(default_factory=set)
    read_elsewhere: set[str] = field(default_factory=set)


def state_in_source(classes: Sequence[type[Node]]) -> dict[type[Node], tuple[frozenset[str], frozenset[str]]]:
    """Return for each class the attributes that count while it runs, and those of them that count at any time."""
    bases = dict.fromkeys(base for cls in classes for base in cls.__mro__ if base.__module__.startswith(OURS))
    ours = {base: _use(base) for base in bases}
    shared = set().union(*(use.read_elsewhere for use in ours.values()))
    found = {}
    for cls in classes:
        uses = [ours[base] for base in cls.__mro__ if base in ours]
        read = shared.union(*(use.read for use in uses))
        names = set().union(*(use.stored for use in uses)) & read - IGNORED
        found[cls] = frozenset(names), frozenset(names.difference(*(use.begun for use in uses)))
    return found


def _use(cls: type) -> Use:
    """Read the methods that one class defines itself."""
    use = Use()
    for name, function in _methods(cls):
        _note(use, name, function)
    return use


def _methods(cls: type) -> Iterator[tuple[str, FunctionType]]:
    """Return the methods and properties that a class defines itself; what a constructor sets is the beginning."""
    for name, found in vars(cls).items():
        function = found.fget if isinstance(found, property) else found
        if isinstance(function, FunctionType) and not name.startswith("__"):
            yield name, function


def _note(use: Use, name: str, function: FunctionType) -> None:
    for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function)))):
        if not isinstance(node, ast.Attribute):
            continue
        own = isinstance(node.value, ast.Name) and node.value.id == "self"
        if own and isinstance(node.ctx, ast.Store):
            use.stored.add(node.attr)
            if name in STARTS:
                use.begun.add(node.attr)
        elif own:
            use.read.add(node.attr)
        else:
            use.read_elsewhere.add(node.attr)
