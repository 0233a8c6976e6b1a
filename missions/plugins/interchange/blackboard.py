"""Blackboard of BehaviorTree.CPP in missions: each entry of a tree's blackboard becomes a variable of its mission.

This module finds the variables' names and kinds of values, and the params and results of each mission.
"""

import re
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

from missions.language.kinds import CONSTANTS, RESERVED_WORDS, STATE_KINDS
from missions.language.nodes import COMPOSITES, FAILURE, FAILURE_NAME, FOR_EACH, MODIFIERS, SUCCESS, SWITCHES
from missions.language.operators import FUNCTIONS
from missions.plugins.interchange.foreign_trees import ForeignProject, SourceTree, call_ports, normal_form
from missions.plugins.interchange.mission_text import Computed, MissionStep, PlainExpression, Verbatim, identifier
from missions.plugins.interchange.node_kinds import CONDITION_ATTRIBUTES, END_ATTRIBUTES
from missions.plugins.interchange.scripts import FLAG, NUMBER, TEXT, ScriptError, parse_script
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.yaml_ports import is_pointer

ROOT_ENTRY = "@"
"""Prefix of a blackboard entry that belongs to the main tree, wherever it is used: ``{@x}``."""

MAX_NAME_LENGTH = 80
"""Maximum characters of a variable's name; a longer name of a blackboard entry is cut."""

RESERVED = frozenset({*STATE_KINDS, *CONSTANTS, *FUNCTIONS, *RESERVED_WORDS, FAILURE_NAME})


class VariableNames:
    """Names of the mission variables that stand for the blackboard entries of one tree.

    A variable has the name of its entry, unless missions do not allow the name; ``renamed`` has such entries.
    """

    def __init__(self, *, is_main: bool) -> None:
        self._is_main = is_main
        self._names: dict[str, str] = {}
        self._taken: set[str] = set()
        self.renamed: dict[str, str] = {}

    def name(self, entry: str) -> str:
        """Return the name of the variable that stands for a blackboard entry."""
        if entry.startswith(ROOT_ENTRY) and self._is_main:
            entry = entry.removeprefix(ROOT_ENTRY)
        if entry not in self._names:
            plain = f"root_{entry[1:]}" if entry.startswith(ROOT_ENTRY) else entry
            found = self.fresh(plain, first_number=0)
            self._names[entry] = found
            if found != entry and not entry.startswith(ROOT_ENTRY):
                self.renamed[entry] = found
        return self._names[entry]

    def known(self) -> dict[str, str]:
        """Return the names of all variables so far, by the name of their blackboard entry."""
        return dict(self._names)

    def fresh(self, wish: str, first_number: int = 0) -> str:
        """Return a name that no variable of the mission has yet: ``wish``, or ``wish`` with a suffix such as ``_2``."""
        plain = identifier(wish)[:MAX_NAME_LENGTH] or "entry"
        plain = plain if plain.isidentifier() else f"entry_{plain}"
        found, number = plain, first_number
        while found in RESERVED or found in self._taken:
            number += 1
            found = f"{plain}_" if number == 1 else f"{plain}_{number}"
        self._taken.add(found)
        return found


@dataclass(frozen=True, slots=True)
class SubtreeCall:
    """A SubTree node: it runs ``tree``, with a value for each port.

    ``entries`` maps a port to the entry of the calling tree's blackboard that it is connected to, ``constants`` maps a
    port to its constant value. With ``shares_names`` (BehaviorTree.CPP: ``_autoremap``), each other entry of the called
    tree is connected to the caller's entry of the same name.
    """

    tree: SourceTree
    element: Element
    entries: dict[str, str]
    constants: dict[str, object]
    shares_names: bool


class EntryKinds:
    """Kinds of the values of blackboard entries, from scripts and constants: number, flag or text; None if unknown."""

    def __init__(self, project: ForeignProject) -> None:
        self._found: dict[tuple[int, str], set[str | None]] = defaultdict(set)
        self._same: list[tuple[tuple[int, str], tuple[int, str]]] = []
        trees = list(project.trees())
        for _ in range(2):  # a script may read an entry that a later one sets
            for tree in trees:
                self._note_tree(project, tree)
        for _ in range(len(trees) + 1):
            for one, other in self._same:
                both = self._found[one] | self._found[other]
                self._found[one], self._found[other] = set(both), set(both)

    def of(self, tree: SourceTree) -> dict[str, str | None]:
        """Return the kinds of values of the blackboard entries of a tree, by the name of the entry."""
        return {entry: _one_kind(kinds) for (owner, entry), kinds in self._found.items() if owner == id(tree)}

    def _note_tree(self, project: ForeignProject, tree: SourceTree) -> None:
        for element in tree.elements():
            kind, _ = normal_form(element, project)
            for code in codes_of(element, kind).values():
                self._note_script(tree, code)
            if kind == "SetBlackboard":
                entry = entry_of(element.attributes.get("output_key", ""))
                if entry and not is_pointer(element.attributes.get("value", "")):
                    self._found[id(tree), entry].add(kind_of_constant(element.attributes.get("value", "")))
            elif kind == "SubTree" and (inner := project.find_tree(element.attributes.get("ID", ""), tree.file)):
                self._note_call(project, tree, inner, element)

    def _note_script(self, tree: SourceTree, code: str) -> None:
        try:
            script = parse_script(code, kinds=self.of(tree))
        except ScriptError:
            return
        for each in script.assignments:
            if each.formula.kind is not None:
                self._found[id(tree), each.entry].add(each.formula.kind)

    def _note_call(self, project: ForeignProject, tree: SourceTree, inner: SourceTree, element: Element) -> None:
        for port, value in call_ports(project, inner, element).items():
            if is_pointer(value) or tree.version == 3:
                self._same.append(((id(tree), entry_of(value, port)), (id(inner), port)))
            else:
                self._found[id(inner), port].add(kind_of_constant(value))


def codes_of(element: Element, kind: str) -> dict[str, str]:
    """Return the scripts of a node by the attribute that holds each; ``kind`` is the kind of the node."""
    names = {*CONDITION_ATTRIBUTES, *END_ATTRIBUTES, *(("code",) if "Script" in kind else ())}
    return {name: value for name, value in element.attributes.items() if name in names}


def _one_kind(kinds: set[str | None]) -> str | None:
    known = kinds - {None}
    if known == {NUMBER, FLAG}:
        return NUMBER
    return known.pop() if len(known) == 1 else None


def kind_of_constant(text: str) -> str:
    """Return the kind of the constant ``text`` in a port: number, flag or text."""
    value = constant_value(text)
    return FLAG if isinstance(value, bool) else NUMBER if isinstance(value, int | float) else TEXT


def constant_value(text: str) -> float | bool | str:
    """Return the constant in a port of an XML node as a number, or as True or False, otherwise as its text."""
    word = text.strip()
    if word in ("true", "True", "false", "False"):
        return word.lower() == "true"
    if re.fullmatch(r"[-+]?(\d{1,15}(\.\d*)?|\.\d+)([eE][-+]?\d{1,2})?", word):
        return int(word) if re.fullmatch(r"[-+]?\d+", word) else float(word)
    return text


def entry_of(value: str, port: str = "") -> str:
    """Return the name of the blackboard entry in a port's value: ``x`` for ``{x}`` and for ``x``.

    For ``{=}`` it is the name of the ``port``.
    """
    text = value.strip()
    if is_pointer(text):
        text = text.removeprefix("$")[1:-1].strip()
    return port if text == "=" else text


ANY_VALUE = Verbatim("{type: value}")
"""Declaration of a param without a default, which takes any value."""


@dataclass(slots=True)
class MissionInterface:
    """Variables of a mission that its callers must know.

    ``params`` has the default of each param, or its declaration in the mission file. ``needs`` are the variables that
    the mission reads before it sets them. ``sets`` are all variables that it sets, ``surely_set`` those that are set
    whenever it succeeds.
    """

    needs: dict[str, None] = field(default_factory=dict)
    sets: dict[str, None] = field(default_factory=dict)
    surely_set: set[str] = field(default_factory=set)
    params: dict[str, object] = field(default_factory=dict)


KEEPING_SUCCESS = {"timeout", "retry", "while", "delay", "hold", "finally"}
"""Modifiers with which a node can only succeed if the node without them has succeeded."""


class Dataflow:
    """Finds the variables that a mission reads before it sets them, by following its steps in the order of a run."""

    def __init__(self) -> None:
        self.needs: dict[str, None] = {}
        self.sets: dict[str, None] = {}

    def follow(self, step: MissionStep, known: frozenset[str]) -> frozenset[str]:
        """Note the variables that ``step`` reads and sets; return those that are set after it has succeeded.

        ``known`` are the variables that are set before it.
        """
        self._read(step.reads, known)
        for key in MODIFIERS:
            if key in step.keys and key not in ("recover", "finally"):
                self._read(step.key_reads.get(key, ()), known)
        for key in step.keys:
            if key not in MODIFIERS:
                self._read(step.key_reads.get(key, ()), known)
        after = self._follow_word(step, known)
        for value in step.keys.values():
            if isinstance(value, MissionStep):
                self.follow(value, known)
        self.sets |= dict.fromkeys(step.sets)
        return after if step.keys.keys() & MODIFIERS.keys() <= KEEPING_SUCCESS else known

    def _follow_word(self, step: MissionStep, known: frozenset[str]) -> frozenset[str]:
        inner = step.branches
        composite = COMPOSITES.get(step.word)
        if step.word == FOR_EACH:
            self.follow(inner[0], known | set(step.sets))
            return known
        if step.word in SWITCHES:
            ends = [self.follow(child, known) for child in inner]
            return frozenset.intersection(*ends) if step.has_all_cases else known
        if composite is None:
            for child in inner:
                self.follow(child, known)
            return known | set(step.sets)
        if composite.passes == SUCCESS and not composite.at_once:
            for child in inner:
                after = self.follow(child, known)
                known = known if "if" in child.keys else after
            return known
        ends = [self.follow(child, known) for child in inner]
        if composite.passes == FAILURE or step.word == "race" or "success_count" in step.keys:
            return frozenset.intersection(*ends)
        return frozenset().union(*ends)

    def _read(self, names: Iterable[str], known: frozenset[str]) -> None:
        self.needs |= dict.fromkeys(name for name in names if name not in known)


def fill_call(
    step: MissionStep, call: SubtreeCall, inner: MissionInterface, names: VariableNames, port_of: dict[str, str]
) -> None:
    """Write ``with`` and ``returns`` beside a ``mission`` step, and note the variables of the caller that it uses.

    ``call`` is the SubTree node of the step, ``inner`` the interface of the called mission, and ``names`` are the names
    of the caller's variables. ``port_of`` has the blackboard entry of each variable of the called mission.
    """
    given, returned = dict[str, object](), dict[str, object]()
    reads, sets = list[str](), list[str]()
    for variable, entry in port_of.items():
        outer = _outer_entry(call, entry)
        needed = variable in inner.needs or variable in inner.params
        if outer is not None:
            own = names.name(outer)
            if variable in inner.sets:
                returned[own] = PlainExpression(variable)
                sets.append(own)
            if needed or (variable in inner.sets and variable not in inner.surely_set):
                given[variable] = Computed(own)
                reads.append(own)
                inner.params.setdefault(variable, ANY_VALUE)
        elif entry in call.constants and (needed or variable in inner.sets):
            inner.params.setdefault(variable, ANY_VALUE)
            if variable in inner.needs or variable in inner.params:
                given[variable] = call.constants[entry]
    if given:
        step.keys["with"] = given
    if returned:
        step.keys["returns"] = returned
    step.reads, step.sets = tuple(reads), tuple(sets)


def give_missing_params(step: MissionStep, inner: MissionInterface) -> list[str]:
    """Pass null for each param of a called mission that this call omits, although the param has no default.

    Return the names of these params.
    """
    given = step.keys.get("with")
    known = given if isinstance(given, dict) else {}
    missing = {name: None for name, value in inner.params.items() if value is ANY_VALUE and name not in known}
    if missing:
        step.keys["with"] = {**known, **missing}
    return list(missing)


def _outer_entry(call: SubtreeCall, entry: str) -> str | None:
    """Return the entry of the caller's blackboard that an entry of the called tree is connected to; None without."""
    if entry.startswith(ROOT_ENTRY):
        return entry
    if entry in call.entries:
        return call.entries[entry]
    is_private = entry.startswith("_")
    return entry if call.shares_names and not is_private and entry not in call.constants else None
