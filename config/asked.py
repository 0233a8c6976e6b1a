"""What readers ask of a file: each key with what it takes, from which the JSON Schemas of files are made.

As with config.reading, nobody hands a list down: who wants to know listens around the whole, in its own thread.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from config.marked import Node


@dataclass(frozen=True, slots=True)
class Key:
    """What a key takes: a ``kind`` of value ("text", "quantity"), of a ``dimension``, ``among`` words, in a range.

    The bounds are in SI units. ``any`` is the kind of what its reader looks at itself.
    """

    kind: str = "any"
    required: bool = False
    dimension: str = ""
    among: tuple[str, ...] = ()
    low: float | None = None
    high: float | None = None


@dataclass(slots=True)
class Asked:
    """The keys that were asked of one mapping; ``free`` where others are names that the file chooses."""

    node: Node
    keys: dict[str, Key] = field(default_factory=dict)
    free: bool = False


_ASKED: ContextVar[dict[int, Asked] | None] = ContextVar("asked", default=None)


@contextmanager
def keys_asked() -> Iterator[dict[int, Asked]]:
    """Collect what is asked of each mapping that is read within, by the id of its node, the outermost first."""
    found: dict[int, Asked] = {}
    token = _ASKED.set(found)
    try:
        yield found
    finally:
        _ASKED.reset(token)


def note_key(node: Node, name: str, key: Key) -> None:
    """Note what was asked, where somebody collects; what is known of a key goes before that it was looked at."""
    collected = _ASKED.get()
    if collected is not None:
        keys = collected.setdefault(id(node), Asked(node)).keys
        if key.kind != "any" or name not in keys:
            keys[name] = key


def note_free(node: Node) -> None:
    """Note that a mapping's keys are names, where somebody collects."""
    collected = _ASKED.get()
    if collected is not None:
        collected.setdefault(id(node), Asked(node)).free = True
