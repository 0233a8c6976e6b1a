"""What the checker knows while it reads one mission, and the faults that it has found."""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from pathlib import Path
from typing import get_origin

from behaviours.leaf import Leaf
from config.faults import Diagnostic, Mark, Source, closest, note, one_of, plain_word
from config.marked import Node, Scalar
from config.units import article, seen
from drivers.api.quick import dataclass
from missions.language.expressions import UNREAD, Convert, Expression, ExpressionError, Read, Template, Value, template
from missions.language.inference import Where, mismatches
from missions.language.kinds import RESERVED, STATE, WORDS, Kind, kind_of_value, members_of
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


def no_missions(name: str, beside: Path) -> Path:
    """Find no mission: the finder of a text that stands alone."""
    raise LookupError(f"cannot be found from {beside}: '{name}'")


FLAGS = {"yes": "true", "on": "true", "no": "false", "off": "false"}
"""What others write for what is true or false."""


_ELSEWHERE = re.compile(
    r"\$(?P<shell>[\w.]+)|\{\{\s*(?P<jinja>[\w.]+)\s*\}\}|\{(?P<tree>[\w.]+)\}|\$\((?P<make>[\w.]+)\)"
)


def hole_meant(text: str) -> str:
    """Say how to write what other languages write as $x, {x} or {{x}}; nothing for any other text."""
    found = _ELSEWHERE.fullmatch(text.strip())
    return f"write ${{{found[found.lastgroup]}}} for its value" if found and found.lastgroup else ""


@dataclass(slots=True)
class Words:
    """What any mission may name: leaves, gestures and controllers, and other missions, found from the file's folder.

    ``files`` are the missions that were read already, so that one that is used often is read once.
    """

    leaves: Mapping[str, type[Leaf]]
    things: Mapping[str, Lookup] = field(default_factory=dict)
    find_mission: Callable[[str, Path], Path] = no_missions
    files: dict[Path, tuple[Source, Node]] = field(default_factory=dict)


@dataclass(slots=True)
class Notes:
    """The mission being read: its text, its params' values, what it may name, and what is wrong with it.

    ``stored`` are the variables that some step of the mission sets, and the params that are known only when it runs.
    ``awaited`` are those params among them that nobody has given yet. ``kept`` are those variables of which it is known
    what they hold, each with a leaf that keeps that; ``kinds`` are those of the params whose values are not known yet.
    ``torn`` is whether a line of the file could not be read; ``loose`` whether a mission in it could not, which may
    return anything.
    ``chain`` are the files that lead to this one, itself last; ``steps`` how many steps were read, all files together.
    ``depth`` is how many steps stand above the one that is read now, in all files of the chain.
    """

    source: Source
    words: Words
    chain: tuple[Path, ...] = ()
    steps: list[Mark] = field(default_factory=list)
    params: dict[str, object] = field(default_factory=dict)
    stored: set[str] = field(default_factory=set)
    awaited: set[str] = field(default_factory=set)
    kept: dict[str, type[Leaf]] = field(default_factory=dict)
    kinds: dict[str, Kind] = field(default_factory=dict)
    faults: list[Diagnostic] = field(default_factory=list)
    torn: bool = False
    loose: bool = False
    depth: int = 0

    @property
    def leaves(self) -> Mapping[str, type[Leaf]]:
        """The leaves by their words."""
        return self.words.leaves

    @property
    def things(self) -> Mapping[str, Lookup]:
        """How gestures and controllers are found."""
        return self.words.things

    def known_kinds(self, value: Value) -> Mapping[str, Kind]:
        """Return the kinds of the params that ``value`` reads and that nothing else gives a value to."""
        names = () if value.template is None else {read.name for read in value.template.reads}
        known = (name for name in names if name in self.params and name not in self.stored)
        return {name: kind_of_value(self.params[name]) for name in known}

    def forget_kinds(self, names: Iterable[str]) -> None:
        """Take it that these variables may hold anything."""
        for name in names:
            self.kept.pop(name, None)

    def fault(self, mark: Mark, message: str, suggestion: str = "", *, sure: bool = False) -> None:
        """Note a mistake; where a line of the file could not be read, only what is ``sure`` whatever stood there."""
        if sure or not self.torn:
            note(self.faults, Diagnostic(self.source, mark, message, suggestion))

    def fault_at(self, step: Step, message: str, suggestion: str = "") -> None:
        """Note a mistake at a step, in whichever file that stands."""
        if not self.torn:
            note(self.faults, Diagnostic(step.source, step.mark, message, suggestion))

    def new_name(self, node: Scalar, what: str) -> None:
        """Check the name that the mission gives to a param or a variable; ``what`` begins the message of a fault."""
        if not node.text.isidentifier():
            self.fault(node.mark, f"{what} needs a plain word, got {seen(node.text)}", "such as 'last_seen'")
        elif node.text in {*STATE, *WORDS, *FUNCTIONS, *RESERVED}:
            self.fault(node.mark, f"{what} cannot be '{node.text}', which means something in expressions already")

    def value(self, node: Scalar, what: str, convert: Convert, wants: str = "") -> Value:
        """Read a scalar: a constant, or a text with ``${...}`` to be filled; ``what`` begins the message of a fault.

        ``wants`` is the kind of the argument that gets it.
        """
        try:
            filled = template(node.text)
        except ExpressionError as error:
            self.wrong_expression(node, error, what)
            return UNREAD
        if filled is None:
            return self.constant(node, node.value, what, convert, sure=True, hint=hole_meant(node.text))
        return self.computed(node, filled, what, convert, wants)

    def constant(
        self, node: Node, value: object, what: str, convert: Convert, *, sure: bool = False, hint: str = ""
    ) -> Value:
        """Convert a value that is known now; ``hint`` is what to write where that cannot be."""
        try:
            return Value(convert(value))
        except (ValueError, LookupError) as error:
            self.fault(node.mark, f"{what} {error.args[0] if error.args else error}", hint, sure=sure)
            return UNREAD

    def computed(
        self, node: Scalar, formula: Template | Expression, what: str, convert: Convert, wants: str = ""
    ) -> Value:
        """Check the names that an expression reads; where all are params its value is known now."""
        known = [self._known(node, read, what) for read in formula.reads]
        if not all(known):
            return UNREAD
        names = {read.name for read in formula.reads}
        if any(name not in self.params or name in self.stored for name in names):
            return Value(template=formula, convert=convert, where=Where(self.source, node, what, wants))
        kinds = {name: kind_of_value(self.params[name]) for name in names}
        if mistakes := mismatches(formula, Where(self.source, node, what, wants), kinds):
            for fault in () if self.torn else mistakes:
                note(self.faults, fault)
            return UNREAD
        try:
            found = formula.evaluate(self.params)
        except ExpressionError as error:
            self.fault(node.mark, f"{what}: {error}")
            return UNREAD
        return self.constant(node, found, what, convert)

    def awaits(self, formula: Template | Expression) -> bool:
        """Say whether all that it waits for are params that nobody has given yet."""
        names = {read.name for read in formula.reads}
        return all(name in self.awaited or (name in self.params and name not in self.stored) for name in names)

    def wrong_expression(self, node: Scalar, error: ExpressionError, what: str) -> None:
        """Note an expression that cannot be read, at its place in ``node``."""
        self.fault(Where(self.source, node, what).place(error.column or 0, error.length), f"{what}: {error}")

    def _known(self, node: Scalar, read: Read, what: str) -> bool:
        """Note a name that nothing can give a value to, and a member that its value cannot have."""
        if read.name in self.kept:
            return self._has_member(node, read, what, self.kept[read.name])
        if read.name in self.params or read.name in self.stored or read.member in STATE.get(read.name, ()):
            return True
        if not self.loose:
            mark = Where(self.source, node, what).place(read.column, read.length)
            alone = self._stands_alone(read.name)
            self.fault(mark, f"{what}: unknown name {seen(read.dotted)}", self._meant(read), sure=alone)
        return False

    def _stands_alone(self, name: str) -> bool:
        """Say whether a name stands once in the file, and no mission in it may return it: so nothing sets it.

        That is so whatever a line was meant for that could not be read.
        """
        words = re.findall(r"\w+", self.source.text)
        return self.torn and words.count(name) == 1 and words.count("mission") < 2  # its own header is one

    def _has_member(self, node: Scalar, read: Read, what: str, leaf: type[Leaf]) -> bool:
        """Note a member that what ``leaf`` keeps does not have."""
        members = members_of(leaf.keeps) if isinstance(leaf.keeps, type) else []
        if not read.member or read.member in members or get_origin(leaf.keeps) is not None:
            return True
        noun = leaf.stores.partition(":")[0].removeprefix("the ")
        mark = Where(self.source, node, what).place(read.column, read.length)
        self.fault(mark, f"{what}: {article(noun)} has no {seen(read.member)}", one_of(read.member, members))
        return False

    def _meant(self, read: Read) -> str:
        """Say what may be meant by an unknown name."""
        own = sorted({*self.params, *self.stored})
        state = [f"{name}.{member}" for name, members in STATE.items() for member in members]
        if plain_word(read.name) in FLAGS and not read.member:
            flag = f"write '{FLAGS[plain_word(read.name)]}'"
            return f"{flag}, or '{read.name}' in quotes for the text" if read.compared else flag
        if read.name in STATE:
            members = [name for name in state if name.startswith(f"{read.name}.")]
            return one_of(read.dotted, members) if read.member else f"which of it? known are: {', '.join(members)}"
        if read.member:  # the name before it is what must be like another
            close = closest(read.name, [*own, *STATE])
            close = f"{close}.{read.member}" if close else ""
        else:
            close = closest(read.name, [*own, *state])
        hint = f"did you mean '{close}'?" if close else f"known are: {', '.join([*own, *STATE])}"
        return f"{hint}; write '{read.name}' in quotes for the text" if read.compared and not read.member else hint
