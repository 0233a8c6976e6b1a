"""What sets the variables of a mission: read before its steps, since an expression may stand above what sets it."""

from collections import defaultdict
from collections.abc import Iterator
from collections.abc import Mapping as Named

from behaviours.leaf import Leaf
from config.marked import Listing, Mapping, Node, Scalar
from missions.language.counts import COUNTS
from missions.language.nodes import BRANCHES, FOR_EACH, MISSION, MODIFIERS, SWITCHES

KNOWN = {*BRANCHES, *MODIFIERS, *COUNTS, "name", "with"}
"""The words besides those of leaves and ``as`` that mean something beside a behaviour."""

Leaves = Named[str, type[Leaf]]


def setters(node: Node, leaves: Leaves) -> dict[str, list[type[Leaf] | None]]:
    """Return the variables that anything below ``node`` sets, each with the leaves that ``as`` keeps something of.

    None stands for what may be anything: ``returns``, a leaf such as ``set``, or ``as`` beside a mission.
    """
    found = defaultdict(list)
    for name, leaf in _pairs(node, leaves):
        found[name].append(leaf)
    return dict(found)


def of_one_kind(found: Named[str, list[type[Leaf] | None]]) -> dict[str, type[Leaf]]:
    """Return the variables into which leaves alone put something, and all of them of one type; each with a leaf."""
    kinds = {name: {None if leaf is None else leaf.keeps for leaf in leaves} for name, leaves in found.items()}
    one = [name for name, types in kinds.items() if len(types) == 1 and None not in types]
    return {name: leaf for name in one if (leaf := found[name][0]) is not None}


def _pairs(node: Node, leaves: Leaves) -> Iterator[tuple[str, type[Leaf] | None]]:
    if isinstance(node, Listing):
        for item in node.items:
            yield from _pairs(item, leaves)
    elif isinstance(node, Mapping):
        for key, value in node.entries:
            yield from _beside(node, key.text, value, leaves)


def _beside(node: Mapping, word: str, value: Node, leaves: Leaves) -> Iterator[tuple[str, type[Leaf] | None]]:
    """Yield what one key of a node sets, or what is below it."""
    leaf = leaves.get(word)
    if word == "as" and isinstance(value, Scalar):
        yield value.text, next((leaves[key.text] for key, _ in node.entries if key.text in leaves), None)
    elif isinstance(value, Mapping) and ((leaf is not None and leaf.open_ended) or _is_returns(node, word)):
        yield from ((name.text, None) for name, _ in value.entries)
    elif word == FOR_EACH and isinstance(value, Mapping):
        names = (value.get("as"), value.get("number"))
        yield from ((name.text, None) for name in names if isinstance(name, Scalar))
        do = value.get("do")
        yield from () if do is None else _pairs(do, leaves)
    elif word in SWITCHES and isinstance(value, Mapping):
        cases = value.get("cases")
        branches = [case for _, case in cases.entries] if isinstance(cases, Mapping) else []
        for branch in (*branches, value.get("default")):
            if branch is not None:
                yield from _pairs(branch, leaves)
    elif isinstance(value, Listing):
        yield from _pairs(value, leaves)
    elif isinstance(value, Mapping) and leaf is None and word not in KNOWN:
        # A word that nobody knows: it may be meant for one that sets what is written below it.
        yield from ((name.text, None) for name, _ in value.entries)
        yield from _pairs(value, leaves)
    elif isinstance(value, Scalar) and leaf is None and value.text.isidentifier() and word not in KNOWN:
        yield value.text, None


def _is_returns(beside: Mapping, key: str) -> bool:
    return key == "returns" and beside.get(MISSION) is not None
