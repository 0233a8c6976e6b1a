"""A checked mission: a tree of steps, each with its place in the file."""

from collections.abc import Iterator, Mapping
from dataclasses import field
from functools import cached_property

from behaviours.leaf import Leaf
from config.diagnostics import Mark, SourceText
from drivers.api.fast_dataclass import dataclass
from missions.language.expressions import NameReference, Value, reads_failure
from missions.language.nodes import COMPOSITES, IN_TURN, IN_TURN_SELECTOR, MISSION, CompositeKind
from missions.language.robot_state import ROBOT_STATE, state_value


@dataclass(frozen=True)
class Step:
    """A node of a checked mission: a leaf, a composite, a sub-mission, or a modifier around its first child.

    - ``kind`` is the word of the node in the mission, ``name`` its label for people, ``source`` the mission file.
    - ``leaf`` is the class of a leaf, None for other nodes.
    - ``arguments`` depend on the kind: the arguments of a leaf, the params of a sub-mission, the ``on`` of a switch, or
      the one ``value`` of a modifier. The ``value`` of ``finally`` is its time limit.
    - ``children`` of ``retry`` and ``finally`` may have a second member: the recovery, or the cleanup.
    - ``cases`` of a switch belong to its children, in the same order; one more child is its default.
    - ``returns`` are the return values of a sub-mission, as expressions over its variables. ``hidden_results`` are
      results that its file declares, for which these expressions read a variable of the same name.
    - ``output_variable`` is the variable in which the node's result is stored.
    - ``binds`` are variables that the node may set in addition: member and number of a for_each, or all names that are
      set in a node that could not be read.
    - ``text`` is the value behind the word if it is a scalar.
    - ``arguments_as_written`` are the arguments as in the file, for pictures.

    ``variables``, ``claims`` and similar properties are cached, since each step above uses them again.
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
    hidden_results: tuple[str, ...] = field(default=(), compare=False)
    binds: tuple[str, ...] = ()
    text: str = ""
    arguments_as_written: Mapping[str, str] = field(default_factory=dict, compare=False)

    def walk(self) -> Iterator["Step"]:
        """Yield this step and all below it, in the order of the file."""
        waiting = [self]
        while waiting:
            step = waiting.pop()
            yield step
            waiting.extend(reversed(step.children))

    @property
    def word(self) -> str:
        """Word by which tests and properties name the step: its ``kind``, or the name of the mission that it runs."""
        return self.text if self.kind == MISSION else self.kind

    @cached_property
    def direct_variables(self) -> frozenset[str]:
        """Variables of its mission that the step itself sets."""
        found = {*self.binds, *(() if self.output_variable is None else (self.output_variable,))}
        if self.kind == MISSION and self.output_variable is None:
            found |= self.returns.keys()
        if self.leaf is not None and self.leaf.open_ended:
            found |= self.arguments.keys()
        return frozenset(found)

    @cached_property
    def variables(self) -> frozenset[str]:
        """Variables of its mission that the step, or a step below it, sets."""
        below = () if self.kind == MISSION else self.children
        return self.direct_variables.union(*(child.variables for child in below))

    @cached_property
    def claims(self) -> frozenset[str]:
        """Actuators that the step, or a step below it, drives."""
        own_parts = frozenset[str]() if self.leaf is None else self.leaf.drives
        return own_parts.union(*(child.claims for child in self.children))

    @cached_property
    def reads_failure(self) -> bool:
        """Whether the step, or a step of its mission below it, reads the reason of a failure."""
        below = () if self.kind == MISSION else self.children
        return any(map(reads_failure, self.arguments.values())) or any(child.reads_failure for child in below)

    @property
    def needs(self) -> frozenset[str]:
        """Parts that the step, or a step below it, requires: to act, and for its expressions."""
        return frozenset().union(*(step.direct_needs for step in self.walk()))

    @property
    def parts(self) -> frozenset[str]:
        """All parts that the step, or a step below it, uses: required, driven and optional ones."""
        uses = (step.leaf.optional_parts for step in self.walk() if step.leaf is not None)
        return frozenset().union(self.needs, self.claims, *uses)

    @property
    def senses(self) -> frozenset[str]:
        """Detectors that the step, or a step below it, uses."""
        return frozenset().union(*(step.direct_senses for step in self.walk()))

    @property
    def direct_senses(self) -> frozenset[str]:
        """Detectors that the step itself uses: by its leaf, and by its expressions."""
        parts = {ROBOT_STATE[read.name].sense for read in self._reads if read.name in ROBOT_STATE}
        values = (state_value(read.name, read.member) for read in self._reads)
        senses = frozenset(filter(None, parts | {value.sense for value in values if value is not None}))
        if self.leaf is None or "camera" not in self.leaf.needs:
            return senses
        names = (name for name, value in self.arguments.items() if value.template is not None or value.constant)
        return senses | self.leaf.senses_for(frozenset(names))

    @property
    def named_parts(self) -> Mapping[str, str]:
        """Names of additional parts (such as a second arm) that the leaf uses instead of the main part, by kind."""
        return {} if self.leaf is None else self.leaf.named_parts

    @property
    def parts_beside(self) -> Mapping[str, str]:
        """Kinds of additional parts that the leaf uses beside another part of the same kind, by name."""
        return {} if self.leaf is None else self.leaf.additional_parts

    @property
    def direct_needs(self) -> frozenset[str]:
        """Parts that the step itself requires."""
        known = frozenset(ROBOT_STATE[read.name].part for read in self._reads if read.name in ROBOT_STATE)
        return known | (self.leaf.needs if self.leaf is not None else frozenset())

    @property
    def _reads(self) -> Iterator[NameReference]:
        values = (value.template for value in (*self.arguments.values(), *self.returns.values()))
        return (read for template in values if template is not None for read in template.reads)


class PlaceholderLeaf(Leaf):
    """Leaf in place of a node that could not be read, so that the rest can be checked; it may end in any way.

    ``binds`` of its step are the variables that the unread node may set.
    """


def composite_kind(step: Step) -> CompositeKind | None:
    """Return the kind of a composite with a list of children; None for other steps.

    A ``selector`` with ``in_turn`` has a kind of its own.
    """
    kind = COMPOSITES.get(step.kind)
    return IN_TURN_SELECTOR if kind is not None and IN_TURN in step.arguments else kind


UNREAD_KIND = ""
"""Value of ``Step.kind`` for a node, or a key beside one, that could not be read; it may end in any way."""


@dataclass(frozen=True, slots=True)
class MissionProperty:
    """A claim about a mission, which ``mission verify`` proves.

    ``form`` is "while", "before", "after", "without", "stopped", "eventually" or "can". ``subject`` and ``other`` are
    names of behaviours, nodes or actuators, as in ``never: subject while other``. For "can", the subject is "succeed"
    or "fail". ``text`` is the claim as written.
    """

    form: str
    subject: str
    other: str
    text: str
    mark: Mark


@dataclass(frozen=True, slots=True)
class Plan:
    """A checked mission: its tree of steps, the values of its params for a run, and its ``returns``.

    ``if_interrupted`` (``retry``, ``give_up``, or empty) says what to do when the mission, run as a task, was
    interrupted. ``unread_params`` are the places of params that no expression of the mission reads, by name.
    ``missing_params`` are the params without a value: only the caller of the mission can set them.
    """

    mission: str
    summary: str
    params: Mapping[str, object]
    tree: Step
    source: SourceText
    returns: Mapping[str, Value] = field(default_factory=dict)
    properties: tuple[MissionProperty, ...] = ()
    if_interrupted: str = ""
    unread_params: Mapping[str, Mark] = field(default_factory=dict)
    missing_params: frozenset[str] = frozenset()
