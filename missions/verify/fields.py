"""What of a node decides its future: the attributes that its methods set, and that a method reads again.

Read from the source of the node classes, so that a class that keeps something new is explored rightly without a list
of its attributes here. An attribute that is set only where a node starts means nothing while it does not run.
"""

import ast
import inspect
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from types import FunctionType

from behaviours.node import Node

OURS = ("behaviours.", "missions.")
"""The packages whose classes are read: py_trees' own methods are not called."""

STARTS = frozenset({"start", "begin", "initialise"})
"""The methods by which a node forgets an earlier run of it."""

IGNORED = frozenset(
    {
        "status",  # kept for every node
        "feedback_message",  # words for people
        "values",  # used up in the tick in which they are set
        "_halt_tick",  # compared within a tick only
        "_since",  # how long a leaf has run, which no stand-in asks
    }
)


@dataclass
class Use:
    """What the methods of a class do with the attributes of ``self``, and what they read of other objects."""

    stored: set[str] = field(default_factory=set)
    begun: set[str] = field(default_factory=set)
    read: set[str] = field(default_factory=set)
    read_elsewhere: set[str] = field(default_factory=set)


@dataclass(frozen=True, slots=True)
class Fields:
    """The attributes of a node that count: all of them while it runs, ``lasting`` ones at any time."""

    names: tuple[str, ...]
    lasting: frozenset[str]


def fields_of(nodes: Sequence[Node]) -> dict[type[Node], Fields]:
    """Return what counts of each class among ``nodes``."""
    classes = dict.fromkeys(type(node) for node in nodes)
    bases = dict.fromkeys(base for cls in classes for base in cls.__mro__ if base.__module__.startswith(OURS))
    ours = {base: _use(base) for base in bases}
    shared = set().union(*(use.read_elsewhere for use in ours.values()))
    found = {}
    for cls in classes:
        uses = [ours[base] for base in cls.__mro__ if base in ours]
        read = shared.union(*(use.read for use in uses))
        names = set().union(*(use.stored for use in uses)) & read - IGNORED
        found[cls] = Fields(tuple(sorted(names)), frozenset(names.difference(*(use.begun for use in uses))))
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


def always_true(function: object) -> bool:
    """Say whether all that a method ever returns is a plain true, as far as its source shows that."""
    if not isinstance(function, FunctionType):
        return False
    try:
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    except (OSError, SyntaxError):
        return False
    returns = [node.value for node in ast.walk(body) if isinstance(node, ast.Return)]
    ends = isinstance(body, ast.FunctionDef) and isinstance(body.body[-1], ast.Return)
    return ends and all(isinstance(value, ast.Constant) and value.value is True for value in returns)
