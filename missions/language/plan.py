"""A checked mission: a tree of steps, each of which knows where in the file it stands."""

from collections.abc import Iterator, Mapping
from dataclasses import field
from functools import cached_property

from behaviours.leaf import Leaf
from config.diagnostics import Mark, SourceText
from drivers.api.fast_dataclass import dataclass
from missions.language.expressions import NameReference, Value
from missions.language.nodes import MISSION
from missions.language.robot_state import ROBOT_STATE, state_value


@dataclass(frozen=True)
class Step:
    """One node of the tree to be: a leaf, a composite, a sub-mission, or a modifier around its one child.

    ``kind`` is the word in the mission, ``name`` what a person sees, ``source`` the file in which it stands. A leaf has
    its class in ``leaf``. ``arguments`` are a leaf's, the one ``value`` of a modifier, the ``on`` of a switch, or the
    params of a sub-mission. ``cases`` of a switch belong to its children in order; one more child is its default.
    ``returns`` are computed among a sub-mission's own variables, ``output_variable`` names the variable that keeps a result.
    ``binds`` are the variables that a for_each gives values to for its child: for the member, and for its number; and
    those that a hole may set.
    ``text`` is what stands behind the word, where that is one value. ``arguments_as_written`` are the arguments by name, as the file
    has them and in its order, for pictures.

    What a whole subtree sets or claims is computed once for each step: each level above asks for it again.
    """

    kind: str
    name: str
    mark: Mark
    source: SourceText
    children: tuple["Step", ...] = ()
    leaf: type[Leaf] | None = None
    arguments: Mapping[str, Value] = field(default_factory=dict)
    output_variable: str | None = None
    cases: tuple[object, ...] = ()
    case_marks: tuple[Mark, ...] = field(default=(), compare=False)
    returns: Mapping[str, Value] = field(default_factory=dict)
    binds: tuple[str, ...] = ()
    text: str = ""
    arguments_as_written: Mapping[str, str] = field(default_factory=dict, compare=False)

    def walk(self) -> Iterator["Step"]:
        """This step and all below it, in the order of the file."""
        waiting = [self]
        while waiting:
            step = waiting.pop()
            yield step
            waiting.extend(reversed(step.children))

    @cached_property
    def direct_variables(self) -> frozenset[str]:
        """The variables of its mission that it sets itself, not those that something below it does."""
        found = {*self.binds, *(() if self.output_variable is None else (self.output_variable,))}
        if self.kind == MISSION and self.output_variable is None:
            found |= self.returns.keys()
        if self.leaf is not None and self.leaf.open_ended:
            found |= self.arguments.keys()
        return frozenset(found)

    @cached_property
    def variables(self) -> frozenset[str]:
        """The variables of its mission that it sets, or that something below it does."""
        below = () if self.kind == MISSION else self.children
        return self.direct_variables.union(*(child.variables for child in below))

    @cached_property
    def claims(self) -> frozenset[str]:
        """The actuators that it drives, or that something below it does."""
        own = frozenset[str]() if self.leaf is None else self.leaf.drives
        return own.union(*(child.claims for child in self.children))

    @property
    def needs(self) -> frozenset[str]:
        """The parts of a robot that it cannot do without: to act, and to know what its expressions read."""
        return frozenset().union(*(step.direct_needs for step in self.walk()))

    @property
    def parts(self) -> frozenset[str]:
        """All parts of a robot that it has to do with: what it needs and drives, and what it could do without."""
        uses = (step.leaf.optional_parts for step in self.walk() if step.leaf is not None)
        return frozenset().union(self.needs, self.claims, *uses)

    @property
    def senses(self) -> frozenset[str]:
        """What it, or something below it, looks for with the camera."""
        return frozenset().union(*(step.direct_senses for step in self.walk()))

    @property
    def direct_senses(self) -> frozenset[str]:
        """What it looks for itself: as its leaf declares, and what its expressions read."""
        parts = {ROBOT_STATE[read.name].sense for read in self._reads if read.name in ROBOT_STATE}
        values = (state_value(read.name, read.member) for read in self._reads)
        asked = frozenset(filter(None, parts | {value.sense for value in values if value is not None}))
        if self.leaf is None or "camera" not in self.leaf.needs:
            return asked
        given = (name for name, value in self.arguments.items() if value.template is not None or value.constant)
        return asked | self.leaf.senses_for(frozenset(given))

    @property
    def named_parts(self) -> Mapping[str, str]:
        """The further parts that it names, by their kinds."""
        return {} if self.leaf is None else self.leaf.named_parts

    @property
    def parts_beside(self) -> Mapping[str, str]:
        """The kinds of the parts that it names beside one of the same kind, by their names."""
        return {} if self.leaf is None else self.leaf.additional_parts

    @property
    def direct_needs(self) -> frozenset[str]:
        """The parts that it needs itself, not those of what is below it."""
        known = frozenset(ROBOT_STATE[read.name].part for read in self._reads if read.name in ROBOT_STATE)
        return known | (self.leaf.needs if self.leaf is not None else frozenset())

    @property
    def _reads(self) -> Iterator[NameReference]:
        """What its expressions read."""
        values = (value.template for value in (*self.arguments.values(), *self.returns.values()))
        return (read for template in values if template is not None for read in template.reads)


class PlaceholderLeaf(Leaf):
    """Stands in the tree for what could not be read, so that the rest can be checked around it: it may end anyhow.

    It ``binds`` the variables that may be set there.
    """


UNREAD_KIND = ""
"""The kind of a hole, and of what stands beside a behaviour and could not be read: that may change any end."""


@dataclass(frozen=True, slots=True)
class MissionProperty:
    """What a mission promises of itself, for ``mission verify`` to prove.

    ``form`` is "while", "before", "after", "without", "stopped", "eventually" or "can". ``subject`` and ``other`` name
    behaviours, nodes or actuators; of "can" the subject is the end. ``text`` is the whole of it as it is written.
    """

    form: str
    subject: str
    other: str
    text: str
    mark: Mark


@dataclass(frozen=True, slots=True)
class Plan:
    """A whole mission, checked. ``params`` hold this run's values, ``returns`` what it tells in the end.

    ``if_interrupted`` (``retry``, ``give_up``; empty where it says nothing) is for the mission as a task.
    """

    mission: str
    summary: str
    params: Mapping[str, object]
    tree: Step
    source: SourceText
    returns: Mapping[str, Value] = field(default_factory=dict)
    properties: tuple[MissionProperty, ...] = ()
    if_interrupted: str = ""
