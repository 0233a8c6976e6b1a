"""A checked mission: a tree of steps, each of which knows where in the file it stands."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from behaviours.leaf import Leaf
from config.faults import Mark, Source
from missions.language.values import Value

COMPOSITES = {
    "sequence": "does one after another; fails at the first failure",
    "reactive_sequence": "a sequence that asks again from the first at every tick",
    "selector": "tries one after another until one succeeds",
    "reactive_selector": "a selector that asks again from the first at every tick",
    "parallel": "does all at once; succeeds when all have",
    "race": "does all at once; ends with the first that ends",
}
"""The composites, and what each does."""


@dataclass(frozen=True, slots=True)
class Step:
    """One node of the tree to be: a leaf, a composite, or a modifier around its one child.

    ``kind`` is the word in the mission, ``name`` what a person sees. A leaf has its class in ``leaf``; ``arguments``
    are a leaf's, or the one ``value`` of a modifier.
    """

    kind: str
    name: str
    mark: Mark
    children: tuple["Step", ...] = ()
    leaf: type[Leaf] | None = None
    arguments: Mapping[str, Value] = field(default_factory=dict)
    keep_as: str | None = None

    def walk(self) -> Iterator["Step"]:
        """This step and all below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def claims(self) -> frozenset[str]:
        """The actuators that it drives, or that something below it does."""
        return frozenset().union(*(step.leaf.drives for step in self.walk() if step.leaf is not None))

    @property
    def needs(self) -> frozenset[str]:
        """The parts of a robot that it cannot do without."""
        return frozenset().union(*(step.leaf.needs for step in self.walk() if step.leaf is not None))


@dataclass(frozen=True, slots=True)
class Plan:
    """A whole mission, checked. ``params`` hold this run's values."""

    mission: str
    summary: str
    params: Mapping[str, object]
    tree: Step
    source: Source
