"""State of the checker while it reads a mission, and the errors found."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field, replace
from pathlib import Path
from typing import get_origin

from behaviours.leaf import Leaf
from config.diagnostics import Diagnostic, Mark, SourceText, add_diagnostic, closest, suggest_from, to_snake_case
from config.units import UNITS, quoted_value, with_article
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
    draws_number,
    template,
)
from missions.language.inference import ExpressionLocation, find_mismatches
from missions.language.kinds import CONSTANTS, RESERVED_WORDS, STATE_KINDS, Kind, kind_of_value, members_of
from missions.language.nodes import FAILURE_NAME
from missions.language.operators import FUNCTIONS
from missions.language.param_hints import param_hint, sole_name
from missions.language.plan import Step

Lookup = Callable[[str], object]
"""Function that finds an object, such as a gesture, by name; it raises LookupError with the known names."""

MAX_STEPS = 10_000
"""Maximum steps of a mission; steps of sub-missions count at each use."""

MAX_DEPTH = 100
"""Maximum steps from the root of a mission to the deepest leaf, including modifiers and sub-missions.

Reading and ticking are recursive, so a deeper tree would overflow the stack.
"""


def find_no_mission(name: str, beside: Path) -> Path:
    """Raise LookupError, since no sub-mission can be found: the default for mission texts that are not in a file."""
    raise LookupError(f"cannot be found from {beside}: '{name}'")


FLAG_WORDS = {"yes": "true", "on": "true", "no": "false", "off": "false"}
"""Words that other systems use for true and false, each with the word that missions use."""


FAILURE_WORDS = frozenset(
    {"cause", "error", "error_message", "exception", "failure_reason", "fault", "last_error", "last_failure", "reason"}
)
"""Words of other languages for the reason of a failure."""

FAILURE_HINT = "read it in a later child of a selector, in 'recover' or in 'finally'"

_OTHER_SYNTAX = re.compile(
    r"\$(?P<shell>[\w.]+)|\{\{\s*(?P<jinja>[\w.]+)\s*\}\}|\{(?P<tree>[\w.]+)\}|\$\((?P<make>[\w.]+)\)"
)


def hole_hint(text: str) -> str:
    """Return the hint for a variable in the notation of other languages: $x, {x} or {{x}}; empty for other texts."""
    found = _OTHER_SYNTAX.fullmatch(text.strip())
    return f"write ${{{found[found.lastgroup]}}} for its value" if found and found.lastgroup else ""


@dataclass(slots=True)
class Vocabulary:
    """Names that missions can use: leaves, ``things`` such as gestures by kind, and missions.

    ``find_mission`` returns the file of a mission by its name and the folder of the file that uses it. ``files`` caches
    the missions that were read, so that each is read once.
    """

    leaves: Mapping[str, type[Leaf]]
    things: Mapping[str, Lookup] = field(default_factory=dict)
    find_mission: Callable[[str, Path], Path] = find_no_mission
    files: dict[Path, tuple[SourceText, Node]] = field(default_factory=dict)


@dataclass(slots=True)
class CheckContext:
    """State of the checker for the mission that it reads: text, params, known names, and errors.

    ``variables`` are set by some step of the mission, or are params known only in a run; ``missing_params`` are those
    that the caller has not set yet. ``variable_leaves`` are variables of known type, each with a leaf that stores it;
    ``param_kinds`` are the kinds of params without a value. ``param_nodes`` are the defaults of params in the file,
    each with its value. ``param_places`` are the places of the values that a file that runs this mission gives to
    params. ``read_names`` are all names that expressions read.
    ``has_unreadable_line`` is true if a line of the file could not be read. ``has_unreadable_mission`` is true if a
    sub-mission could not be read; it may return any variable.
    ``file_chain`` are the files from the main mission down to this one. ``steps`` are the places of all steps read so
    far in all files; ``depth`` is the number of steps above the present one. ``is_failure_readable`` is true where an
    expression may read the reason of a failure.
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
    param_nodes: dict[str, tuple[Scalar, object]] = field(default_factory=dict)
    param_places: dict[str, tuple[SourceText, Mark]] = field(default_factory=dict)
    read_names: set[str] = field(default_factory=set)
    faults: list[Diagnostic] = field(default_factory=list)
    has_unreadable_line: bool = False
    has_unreadable_mission: bool = False
    depth: int = 0
    is_failure_readable: bool = False

    @contextmanager
    def failure_readable(self, readable: bool) -> Iterator[None]:
        """Context manager that sets ``is_failure_readable`` to ``readable``, and restores it at the end."""
        before, self.is_failure_readable = self.is_failure_readable, readable
        yield
        self.is_failure_readable = before

    @property
    def leaves(self) -> Mapping[str, type[Leaf]]:
        """Classes of the available leaves by tag, which is their name in missions."""
        return self.vocabulary.leaves

    @property
    def things(self) -> Mapping[str, Lookup]:
        """Lookups of gestures, controllers and other objects by kind."""
        return self.vocabulary.things

    def param_kinds_of(self, value: Value) -> Mapping[str, Kind]:
        """Return the kinds (static types) of the params in the expression ``value``, by name.

        Params that a step of the mission may change are left out.
        """
        names = () if value.template is None else {read.name for read in value.template.reads}
        known = (name for name in names if name in self.params and name not in self.variables)
        return {name: kind_of_value(self.params[name]) for name in known}

    def forget_kinds(self, names: Iterable[str]) -> None:
        """Record that the types of the variables ``names`` are not known."""
        for name in names:
            self.variable_leaves.pop(name, None)

    def fault(self, mark: Mark, message: str, suggestion: str = "", *, certain: bool = False) -> None:
        """Report an error at ``mark``.

        If a line of the file could not be read, the error is reported only if it is ``certain``, which means that the
        unread line cannot be its cause.
        """
        if certain or not self.has_unreadable_line:
            add_diagnostic(self.faults, Diagnostic(self.source, mark, message, suggestion))

    def fault_at(self, step: Step, message: str, suggestion: str = "") -> None:
        """Report an error at a step, in the file of the step."""
        if not self.has_unreadable_line:
            add_diagnostic(self.faults, Diagnostic(step.source, step.mark, message, suggestion))

    def check_new_name(self, node: Scalar, label: str) -> None:
        """Check a name that the mission gives to a param or a variable; ``label`` begins an error message."""
        if not node.text.isidentifier():
            self.fault(node.mark, f"{label} needs a plain word, got {quoted_value(node.text)}", "such as 'last_seen'")
        elif node.text in {*STATE_KINDS, *CONSTANTS, *FUNCTIONS, *RESERVED_WORDS, FAILURE_NAME}:
            self.fault(node.mark, f"{label} cannot be '{node.text}', which is reserved in expressions")

    def read_value(self, node: Scalar, label: str, convert: Convert, wanted_kind: Kind = "") -> Value:
        """Return the value of a scalar: a constant, or a text with ``${...}``; report its errors.

        ``label`` begins an error message; ``convert`` converts the value; ``wanted_kind`` is the kind of the argument.
        """
        try:
            filled = template(node.text)
        except ExpressionError as error:
            self.expression_fault(node, error, label)
            return INVALID_VALUE
        if filled is None:
            known = node.text in self.params or node.text in self.variables
            hint = f"did you mean ${{{node.text}}}?" if known else hole_hint(node.text)
            constant = self.convert_constant(node, node.value, label, convert, certain=True, hint=hint)
            if constant is not INVALID_VALUE:
                self._check_shell_variable(node, label)
            return constant
        return self.read_formula(node, filled, label, convert, wanted_kind)

    def _check_shell_variable(self, node: Scalar, label: str) -> None:
        """Report ``$word`` in a text if ``word`` is a param or variable, since missions insert only ``${word}``."""
        for name in re.findall(r"\$(\w+)", node.text):
            if name in self.params or name in self.variables:
                self.fault(node.mark, f"{label}: '${name}' is not an expression", f"write ${{{name}}} for its value")

    def convert_constant(
        self, node: Node, value: object, label: str, convert: Convert, *, certain: bool = False, hint: str = ""
    ) -> Value:
        """Convert a constant value; ``hint`` belongs to a conversion error."""
        try:
            return Value(convert(value))
        except (ValueError, LookupError) as error:
            self.fault(node.mark, f"{label} {error.args[0] if error.args else error}", hint, certain=certain)
            return INVALID_VALUE

    def read_formula(
        self, node: Scalar, formula: Template | Expression, label: str, convert: Convert, wanted_kind: Kind = ""
    ) -> Value:
        """Return the value of an expression after a check of the names in it; a constant if it reads only params.

        ``label`` begins an error message; ``convert`` converts the value; ``wanted_kind`` is the kind of the argument.
        """
        known = [self._check_name(node, read, label) for read in formula.reads]
        if not all(known):
            return INVALID_VALUE
        names = {read.name for read in formula.reads}
        if draws_number(formula) or any(name not in self.params or name in self.variables for name in names):
            return Value(
                template=formula, convert=convert, location=ExpressionLocation(self.source, node, label, wanted_kind)
            )
        kinds = {name: kind_of_value(self.params[name]) for name in names}
        if mistakes := find_mismatches(formula, ExpressionLocation(self.source, node, label, wanted_kind), kinds):
            for fault in () if self.has_unreadable_line else mistakes:
                hint = self._param_hint(formula, wanted_kind, fault.message) or fault.suggestion
                add_diagnostic(self.faults, replace(fault, suggestion=hint))
            return INVALID_VALUE
        try:
            found = formula.evaluate(self.params)
        except ExpressionError as error:
            self.fault(node.mark, f"{label}: {error}", self._null_hint(formula))
            return INVALID_VALUE
        try:
            return Value(convert(found))
        except (ValueError, LookupError) as error:
            message = f"{label} {error.args[0] if error.args else error}"
            self.fault(node.mark, message, self._param_hint(formula, wanted_kind, message))
            return INVALID_VALUE

    def _param_hint(self, formula: Template | Expression, wanted_kind: Kind, message: str) -> str:
        """Return the hint for ``${param}`` with an unsuitable default, or that a param is null; empty otherwise.

        The default also decides the type, so a caller's value without a unit is an error of the default.
        """
        if hint := self._null_hint(formula):
            return hint
        name = sole_name(formula)
        node, default = self.param_nodes.get(name, (None, None))
        if node is None or (wanted_kind not in UNITS and self.params.get(name) is not default):
            return ""
        return param_hint(name, node, wanted_kind, message)

    def _null_hint(self, formula: Template | Expression) -> str:
        """Return the hint with the place at which a param that ``formula`` reads is null; empty if none is."""
        for name in sorted({read.name for read in formula.reads}):
            if name in self.params and self.params[name] is None:
                node, _ = self.param_nodes.get(name, (None, None))
                own_place = None if node is None else (self.source, node.mark)
                if place := self.param_places.get(name, own_place):
                    source, mark = place
                    return f"'{name}' is null ({source.name}:{mark.line}); write a value there"
        return ""

    def awaits_params(self, formula: Template | Expression) -> bool:
        """Return True if an expression reads only params, some of which the caller has not set yet."""
        names = {read.name for read in formula.reads}
        return not draws_number(formula) and names <= self._early_names

    @property
    def _early_names(self) -> set[str]:
        """Names whose values are known before the mission starts."""
        return (self.params.keys() - self.variables) | self.missing_params

    def late_place(self, formula: Template | Expression) -> tuple[str, tuple[SourceText, Mark]] | None:
        """Return a param because of which ``formula`` is known only in a run, with the place of its value.

        None if anything else in the formula is known only in a run.
        """
        names = [read.name for read in formula.reads if read.name not in self._early_names]
        if draws_number(formula) or not names or not self.param_places.keys() >= set(names):
            return None
        return names[0], self.param_places[names[0]]

    def check_known_early(
        self, node: Node, label: str, message: str, values: Iterable[Value], suggestion: str = ""
    ) -> bool:
        """Report the first of ``values`` that is known only in a run; return whether there is none.

        The error with this ``message`` is at ``node``; or where another mission gives such a value to a param.
        """
        formulas = (value.template for value in values if value.template is not None)
        late = next((formula for formula in formulas if not self.awaits_params(formula)), None)
        if late is None:
            return True
        param = self.late_place(late)
        if param is None:
            self.fault(node.mark, f"{label}: {message}", suggestion)
        elif not self.has_unreadable_line:
            name, (source, mark) = param
            user = f"{label.partition(':')[0]} needs it ({self.source.name}:{node.mark.line})"
            message = f"'{name}' must be known before the mission starts: {user}"
            add_diagnostic(self.faults, Diagnostic(source, mark, message, suggestion or "write a value or a param"))
        return False

    def expression_fault(self, node: Scalar, error: ExpressionError, label: str) -> None:
        """Report an expression that cannot be parsed, at its place in ``node``."""
        self.fault(
            ExpressionLocation(self.source, node, label).place(error.column or 0, error.length), f"{label}: {error}"
        )

    def _check_name(self, node: Scalar, read: NameReference, label: str) -> bool:
        """Report an unknown name or member; return whether it is known."""
        self.read_names.add(read.name)
        if read.name == FAILURE_NAME:
            return self._check_failure(node, read, label)
        if read.name in self.variable_leaves:
            return self._check_member(node, read, label, self.variable_leaves[read.name])
        if read.name in self.params or read.name in self.variables or read.member in STATE_KINDS.get(read.name, ()):
            return True
        if not self.has_unreadable_mission:
            mark = ExpressionLocation(self.source, node, label).place(read.column, read.length)
            alone = self._is_never_set(read.name)
            self.fault(mark, f"{label}: unknown name {quoted_value(read.dotted)}", self._name_hint(read), certain=alone)
        return False

    def _check_failure(self, node: Scalar, read: NameReference, label: str) -> bool:
        """Report the reason of a failure where none can be read, or a member of it; return whether it can be read."""
        if self.is_failure_readable and not read.member:
            return True
        message, hint = f"'{FAILURE_NAME}' is a text: it has no {quoted_value(read.member)}", ""
        if not self.is_failure_readable:
            message = f"no failure can be read here: '{FAILURE_NAME}' is the reason of the last failure"
            hint = FAILURE_HINT
        mark = ExpressionLocation(self.source, node, label).place(read.column, read.length)
        self.fault(mark, f"{label}: {message}", hint)
        return False

    def _is_never_set(self, name: str) -> bool:
        """Return True if no step can set the variable ``name``, in a file with a line that could not be read.

        This is so if the name occurs once in the text and there is no sub-mission that could return it.
        """
        words = re.findall(r"\w+", self.source.text)
        return (
            self.has_unreadable_line and words.count(name) == 1 and words.count("mission") < 2
        )  # its own header counts as one

    def _check_member(self, node: Scalar, read: NameReference, label: str, leaf: type[Leaf]) -> bool:
        """Report a member that the result of ``leaf`` does not have; return whether it has it."""
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
        """Return a hint for the unknown name that an expression reads: a similar name, or all known names."""
        own_names = sorted({*self.params, *self.variables})
        state = [f"{name}.{member}" for name, members in STATE_KINDS.items() for member in members]
        if to_snake_case(read.name) in FLAG_WORDS and not read.member:
            flag = f"write '{FLAG_WORDS[to_snake_case(read.name)]}'"
            return f"{flag}, or '{read.name}' in quotes for the text" if read.compared else flag
        if to_snake_case(read.name) in FAILURE_WORDS and not read.compared:
            return f"'{FAILURE_NAME}' is the reason of the last failure: {FAILURE_HINT}"
        if read.name in STATE_KINDS:
            members = [name for name in state if name.startswith(f"{read.name}.")]
            return (
                suggest_from(read.dotted, members) if read.member else f"add a member; known are: {', '.join(members)}"
            )
        if read.member:  # the misspelt name is the one before the dot
            close = closest(read.name, [*own_names, *STATE_KINDS])
            close = f"{close}.{read.member}" if close else ""
        else:
            close = closest(read.name, [*own_names, *state])
        hint = f"did you mean '{close}'?" if close else f"known are: {', '.join([*own_names, *STATE_KINDS])}"
        return f"{hint}; write '{read.name}' in quotes for the text" if read.compared and not read.member else hint
