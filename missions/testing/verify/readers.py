"""Which nodes read variables that must have been set, so that a run that comes to them too early is found."""

from collections.abc import Iterator, Mapping, Sequence

from behaviours.node import Node
from missions.language.nodes import MISSION
from missions.language.plan import Step
from missions.language.reading import surely_read
from missions.language.unset import catches
from missions.testing.verify.abstract import TIMES


def readers(tree: Step, nodes: Sequence[Node]) -> Mapping[Node, frozenset[str]]:
    """Return for each node the variables that it reads when it starts, as far as something in its mission sets them.

    Those whose failure does no harm are left out.
    """
    read = dict(_reads(tree, "1", tree.names))
    return {node: names for node in nodes if (names := read.get(node.key))}


def _reads(step: Step, key: str, names: frozenset[str]) -> Iterator[tuple[str, frozenset[str]]]:
    """Yield the variables by the keys of their nodes."""
    if step.kind not in TIMES:
        yield key, frozenset[str]().union(*map(surely_read, step.arguments.values())) & names
    inner = step.children[0].names if step.kind == MISSION else names
    for place, child in enumerate(step.children, start=1):
        if not catches(step, child):
            yield from _reads(child, f"{key}.{place}", inner)
