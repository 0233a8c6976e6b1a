"""What the checker knows while it reads one mission, and the faults that it has found."""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from pathlib import Path
from typing import get_origin

from behaviours.leaf import Leaf
from config.diagnostics import Diagnostic, Mark, SourceText, add_diagnostic, closest, suggest_from, to_snake_case
from config.units import quoted_value, with_article
from config.yaml_nodes import Node, Scalar
from drivers.api.fast_dataclass import dataclass
from missions.language.expressions import (
    INVALID_VALUE,
    Convert,
    Expression,
    ExpressionError,
    NameReference,
    Template,
    Value,
    template,
)
from missions.language.inference import ExpressionLocation, find_mismatches
from missions.language.kinds import CONSTANTS, RESERVED_WORDS, STATE_KINDS, Kind, kind_of_value, members_of
from missions.language.operators import FUNCTIONS
from missions.language.plan import Step

Lookup = Callable[[str], object]
"""Finds a thing by its name; raises LookupError that says what is there."""

MAX_STEPS = 10_000
"""Steps of a mission, those of its sub-missions counted each time that they are used."""

MAX_DEPTH = 100
"""Steps from the root of a tree to its deepest leaf, modifiers and sub-missions counted.

Reading and ticking go down step by step: a deeper tree would overflow the stack.
"""


def find_no_mission(name: str, beside: Path) -> Path:
    """Find no mission: the finder of a text that stands alone."""
    raise LookupError(f"cannot be found from {beside}: '{name}'")


FLAG_WORDS = {"yes": "true", "on": "true", "no": "false", "off": "false"}
"""What others write for what is true or false."""


_OTHER_SYNTAX = re.compile(
    r"\$(?P<shell>[\w.]+)|\{\{\s*(?P<jinja>[\w.]+)\s*\}\}|\{(?P<tree>[\w.]+)\}|\$\((?P<make>[\w.]+)\)"
)


def hole_hint(text: str) -> str:
    """Say how to write what other languages write as $x, {x} or {{x}}; nothing for any other text."""
    found = _OTHER_SYNTAX.fullmatch(text.strip())
    return f"write ${{{found[found.lastgroup]}}} for its value" if found and found.lastgroup else ""


@dataclass(slots=True)
class Vocabulary:
    """What any mission may name: leaves, gestures and controllers, and other missions, found from the file's folder.

    ``files`` are the missions that were read already, so that one that is used often is read once.
    """

    leaves: Mapping[str, type[Leaf]]
    things: Mapping[str, Lookup] = field(default_factory=dict)
    find_mission: Callable[[str, Path], Path] = find_no_mission
    files: dict[Path, tuple[SourceText, Node]] = field(default_factory=dict)


@dataclass(slots=True)
class CheckContext:
    """The mission being read: its text, its params' values, what it may name, and what is wrong with it.

    ``variables`` are the variables that some step of the mission sets, and the params that are known only when it runs.
    ``missing_params`` are those params among them that nobody has given yet. ``variable_leaves`` are those variables of which it is known
    what they hold, each with a leaf that keeps that; ``param_kinds`` are those of the params whose values are not known yet.
    ``has_unreadable_line`` is whether a line of the file could not be read; ``has_unreadable_mission`` whether a mission in it could not, which may
    return anything.
    ``file_chain`` are the files that lead to this one, itself last; ``steps`` how many steps were read, all files together.
    ``depth`` is how many steps stand above the one that is read now, in all files of the chain.
    """

    source: SourceText
    vocabulary: Vocabulary
    file_chain: tuple[Path, ...] = ()
    steps: list[Mark] = field(default_factory=list)
    params: dict[str, object] = field(default_factory=dict)
    variables: set[str] = field(default_factory=set)
    missing_params: set[str] = field(default_factory=set)
    variable_leaves: dict[str, type[Leaf]] = field(default_factory=dict)
    param_kinds: dict[str, Kind] = field(default_factory=dict)
    faults: list[Diagnostic] = field(default_factory=list)
    has_unreadable_line: bool = False
    has_unreadable_mission: bool = False
    depth: int = 0

    @property
    def leaves(self) -> Mapping[str, type[Leaf]]:
        """The leaves by their words."""
        return self.vocabulary.leaves

    @property
    def things(self) -> Mapping[str, Lookup]:
        """How gestures and controllers are found."""
        return self.vocabulary.things

    def param_kinds_of(self, value: Value) -> Mapping[str, Kind]:
        """Return the kinds of the params that ``read_value`` reads and that nothing else gives a value to."""
        names = () if value.template is None else {read.name for read in value.template.reads}
        known = (name for name in names if name in self.params and name not in self.variables)
        return {name: kind_of_value(self.params[name]) for name in known}

    def forget_kinds(self, names: Iterable[str]) -> None:
        """Take it that these variables may hold anything."""
        for name in names:
            self.variable_leaves.pop(name, None)

    def fault(self, mark: Mark, message: str, suggestion: str = "", *, certain: bool = False) -> None:
        """Note a mistake; where a line of the file could not be read, only what is ``sure`` whatever stood there."""
        if certain or not self.has_unreadable_line:
            add_diagnostic(self.faults, Diagnostic(self.source, mark, message, suggestion))

    def fault_at(self, step: Step, message: str, suggestion: str = "") -> None:
        """Note a mistake at a step, in whichever file that stands."""
        if not self.has_unreadable_line:
            add_diagnostic(self.faults, Diagnostic(step.source, step.mark, message, suggestion))

    def check_new_name(self, node: Scalar, label: str) -> None:
        """Check the name that the mission gives to a param or a variable; ``what`` begins the message of a fault."""
        if not node.text.isidentifier():
            self.fault(node.mark, f"{label} needs a plain word, got {quoted_value(node.text)}", "such as 'last_seen'")
        elif node.text in {*STATE_KINDS, *CONSTANTS, *FUNCTIONS, *RESERVED_WORDS}:
            self.fault(node.mark, f"{label} cannot be '{node.text}', which means something in expressions already")

    def read_value(self, node: Scalar, label: str, convert: Convert, wanted_kind: str = "") -> Value:
        """Read a scalar: a constant, or a text with ``${...}`` to be filled; ``what`` begins the message of a fault.

        ``wants`` is the kind of the argument that gets it.
        """
        try:
            filled = template(node.text)
        except ExpressionError as error:
            self.expression_fault(node, error, label)
            return INVALID_VALUE
        if filled is None:
            return self.convert_constant(node, node.value, label, convert, certain=True, hint=hole_hint(node.text))
        return self.read_formula(node, filled, label, convert, wanted_kind)

    def convert_constant(
        self, node: Node, value: object, label: str, convert: Convert, *, certain: bool = False, hint: str = ""
    ) -> Value:
        """Convert a value that is known now; ``hint`` is what to write where that cannot be."""
        try:
            return Value(convert(value))
        except (ValueError, LookupError) as error:
            self.fault(node.mark, f"{label} {error.args[0] if error.args else error}", hint, certain=certain)
            return INVALID_VALUE

    def read_formula(
        self, node: Scalar, formula: Template | Expression, label: str, convert: Convert, wanted_kind: str = ""
    ) -> Value:
        """Check the names that an expression reads; where all are params its value is known now."""
        known = [self._check_name(node, read, label) for read in formula.reads]
        if not all(known):
            return INVALID_VALUE
        names = {read.name for read in formula.reads}
        if any(name not in self.params or name in self.variables for name in names):
            return Value(
                template=formula, convert=convert, location=ExpressionLocation(self.source, node, label, wanted_kind)
            )
        kinds = {name: kind_of_value(self.params[name]) for name in names}
        if mistakes := find_mismatches(formula, ExpressionLocation(self.source, node, label, wanted_kind), kinds):
            for fault in () if self.has_unreadable_line else mistakes:
                add_diagnostic(self.faults, fault)
            return INVALID_VALUE
        try:
            found = formula.evaluate(self.params)
        except ExpressionError as error:
            self.fault(node.mark, f"{label}: {error}")
            return INVALID_VALUE
        return self.convert_constant(node, found, label, convert)

    def awaits_params(self, formula: Template | Expression) -> bool:
        """Say whether all that it waits for are params that nobody has given yet."""
        names = {read.name for read in formula.reads}
        return all(
            name in self.missing_params or (name in self.params and name not in self.variables) for name in names
        )

    def expression_fault(self, node: Scalar, error: ExpressionError, label: str) -> None:
        """Note an expression that cannot be read, at its place in ``node``."""
        self.fault(
            ExpressionLocation(self.source, node, label).place(error.column or 0, error.length), f"{label}: {error}"
        )

    def _check_name(self, node: Scalar, read: NameReference, label: str) -> bool:
        """Note a name that nothing can give a value to, and a member that its value cannot have."""
        if read.name in self.variable_leaves:
            return self._check_member(node, read, label, self.variable_leaves[read.name])
        if read.name in self.params or read.name in self.variables or read.member in STATE_KINDS.get(read.name, ()):
            return True
        if not self.has_unreadable_mission:
            mark = ExpressionLocation(self.source, node, label).place(read.column, read.length)
            alone = self._is_never_set(read.name)
            self.fault(mark, f"{label}: unknown name {quoted_value(read.dotted)}", self._name_hint(read), certain=alone)
        return False

    def _is_never_set(self, name: str) -> bool:
        """Say whether a name stands once in the file, and no mission in it may return it: so nothing sets it.

        That is so whatever a line was meant for that could not be read.
        """
        words = re.findall(r"\w+", self.source.text)
        return (
            self.has_unreadable_line and words.count(name) == 1 and words.count("mission") < 2
        )  # its own header is one

    def _check_member(self, node: Scalar, read: NameReference, label: str, leaf: type[Leaf]) -> bool:
        """Note a member that what ``leaf`` keeps does not have."""
        members = members_of(leaf.output_type) if isinstance(leaf.output_type, type) else []
        if not read.member or read.member in members or get_origin(leaf.output_type) is not None:
            return True
        noun = leaf.output_doc.partition(":")[0].removeprefix("the ")
        mark = ExpressionLocation(self.source, node, label).place(read.column, read.length)
        self.fault(
            mark,
            f"{label}: {with_article(noun)} has no {quoted_value(read.member)}",
            suggest_from(read.member, members),
        )
        return False

    def _name_hint(self, read: NameReference) -> str:
        """Say what may be meant by an unknown name."""
        own = sorted({*self.params, *self.variables})
        state = [f"{name}.{member}" for name, members in STATE_KINDS.items() for member in members]
        if to_snake_case(read.name) in FLAG_WORDS and not read.member:
            flag = f"write '{FLAG_WORDS[to_snake_case(read.name)]}'"
            return f"{flag}, or '{read.name}' in quotes for the text" if read.compared else flag
        if read.name in STATE_KINDS:
            members = [name for name in state if name.startswith(f"{read.name}.")]
            return (
                suggest_from(read.dotted, members) if read.member else f"which of it? known are: {', '.join(members)}"
            )
        if read.member:  # the name before it is what must be like another
            close = closest(read.name, [*own, *STATE_KINDS])
            close = f"{close}.{read.member}" if close else ""
        else:
            close = closest(read.name, [*own, *state])
        hint = f"did you mean '{close}'?" if close else f"known are: {', '.join([*own, *STATE_KINDS])}"
        return f"{hint}; write '{read.name}' in quotes for the text" if read.compared and not read.member else hint
