"""What every mission file holds, the one that is run and those that it runs: a header, params, a tree, and so on.

``properties`` are what a mission promises of itself, as ``mission verify`` proves or refutes it.
"""

import re
from collections.abc import Callable, Iterator

from config.faults import Mark, key_meant, one_of, ours_for
from config.marked import Listing, Mapping, Node, Scalar
from config.units import seen
from drivers.api.quick import dataclass
from missions.language.expressions import Value
from missions.language.modifiers import read_expression
from missions.language.notes import Notes
from missions.language.param_types import Param, of_one_kind, read_params, setters
from missions.language.plan import Hole, Property, Step
from missions.language.synonyms import WORDS

PROPERTIES = {
    "never": (
        "what must not happen: one thing while, before, after or without another",
        r" (while|before|after|without) ",
    ),
    "always eventually": ("what must be reachable from every state that a run can come to", r"\S"),
    "can": ("an end that must be possible: succeed or fail", r"^(succeed|fail)$"),
}
"""The keys of a property: what each says, and a pattern that its text fits."""

FORMS = (
    "never: gesture while drive",
    "never: gesture before find_face",
    "never: drive after say",
    "never: say without gesture",
    "always eventually: base stopped",
    "always eventually: say",
    "can: succeed",
)
"""An example of each form."""

RELATIONS = ("while", "before", "after", "without")
ENDS = ("succeed", "fail")
_HINT = f"such as '{FORMS[0]}' or '{FORMS[4]}'"


def read_properties(notes: Notes, node: Node | None, tree: Step | None) -> tuple[Property, ...]:
    """Read a list of properties, whose names are those of the steps of ``tree`` and of the actuators it drives."""
    if node is None or tree is None:  # without a tree there is nothing to promise anything of
        return ()
    if not isinstance(node, Listing) or not node.items:
        notes.fault(node.mark, "'properties' needs a list, each on a line with '- '", _HINT)
        return ()
    if any(step.leaf is Hole for step in tree.walk()):  # what has not been read may be what is named
        return ()
    names = known_names(tree)
    return tuple(found for item in node.items for found in _read(notes, item, names, tree.claims))


def known_names(tree: Step) -> set[str]:
    """Return what a property may name of a tree: its leaves, its sub-missions, and the nodes with a ``name``."""
    return {
        word
        for step in tree.walk()
        for word in (step.kind if step.leaf is not None else "", step.name if step.name != step.kind else "")
        if word
    }


def _read(notes: Notes, node: Node, names: set[str], parts: frozenset[str]) -> Iterator[Property]:
    """Read one property."""
    if not isinstance(node, Mapping) or len(node.entries) != 1:
        notes.fault(node.mark, f"a property needs one of {', '.join(PROPERTIES)}", _HINT)
        return
    ((key, value),) = node.entries
    if key.text not in PROPERTIES:
        notes.fault(key.mark, f"unknown property {seen(key.text)}", one_of(key.text, PROPERTIES))
    elif not isinstance(value, Scalar) or not value.text.strip():
        notes.fault(value.mark, f"'{key.text}' needs a text", _HINT)
    else:
        found = _READERS[key.text](notes, value, names, parts)
        if found is not None:
            form, subject, other = found
            yield Property(form, subject, other, f"{key.text}: {value.text.strip()}", key.mark)


Found = tuple[str, str, str] | None


def _never(notes: Notes, value: Scalar, names: set[str], parts: frozenset[str]) -> Found:
    splits = [
        (relation, value.text[: match.start()].strip(), value.text[match.end() :].strip())
        for relation in RELATIONS
        for match in re.finditer(rf"\s{relation}\s", value.text)
    ]
    if not splits:
        words = ", ".join(f"'{relation}'" for relation in RELATIONS)
        notes.fault(value.mark, f"'never' needs one of {words} between two names", _HINT)
        return None
    known = names | parts
    # A name may hold one of the words itself ("wait while he goes"): the split whose names are known is meant.
    relation, subject, other = next((s for s in splits if s[1] in known and s[2] in known), splits[0])
    may_be_other = names if relation in ("before", "after") else known  # an actuator does not succeed
    good = _known(notes, value, subject, known) & _known(notes, value, other, may_be_other)
    return (relation, subject, other) if good else None


def _eventually(notes: Notes, value: Scalar, names: set[str], parts: frozenset[str]) -> Found:
    text = value.text.strip()
    subject, _, last = text.rpartition(" ")
    if last == "stopped" and text not in names:
        return ("stopped", subject, "") if _known(notes, value, subject.strip(), names | parts) else None
    return ("eventually", text, "") if _known(notes, value, text, names | parts) else None


def _can(notes: Notes, value: Scalar, names: set[str], parts: frozenset[str]) -> Found:
    del names, parts
    text = value.text.strip()
    if text not in ENDS:
        notes.fault(value.mark, f"'can' takes succeed or fail, got {seen(text)}", one_of(text, ENDS))
        return None
    return "can", text, ""


def _known(notes: Notes, value: Scalar, name: str, known: set[str] | frozenset[str]) -> bool:
    """Note a name that nothing in the mission has, at its place in the text."""
    if name in known:
        return True
    at = max(0, value.text.rfind(name) if value.text.rstrip().endswith(name) else value.text.find(name))
    mark = Mark(value.mark.line, value.mark.column + value.quoted + at, max(1, len(name)))
    notes.fault(mark, f"no behaviour of this mission is called {seen(name)}", one_of(name, known))
    return False


_READERS = {"never": _never, "always eventually": _eventually, "can": _can}


KEYS = ("mission", "summary", "params", "if_interrupted", "tree", "returns", "properties")

IF_INTERRUPTED = ("retry", "give_up")
"""What to do about the mission as a task of which nobody knows how far it came."""


@dataclass(frozen=True, slots=True)
class Body:
    """A mission file, read. ``returns`` are the results that it hands back, by name.

    ``if_interrupted`` is one of ``IF_INTERRUPTED``; empty where the file says nothing of it.
    """

    mission: str
    summary: str
    tree: Step | None
    returns: dict[str, Value]
    properties: tuple[Property, ...] = ()
    if_interrupted: str = ""


Take = Callable[[Notes, dict[str, Param], str], None]
"""Gives the params their values: into ``params`` of the notes where known now, else their names into ``stored``."""


def read_body(notes: Notes, root: Node, take: Take, read_step: Callable[[Notes, Node], Step]) -> Body | None:
    """Read a mission file; None where it is no mapping."""
    if not isinstance(root, Mapping):
        notes.fault(root.mark, "a mission begins with keys", "write 'mission: NAME', then 'tree:'")
        return None
    notes.torn = notes.torn or root.torn
    for key, _ in root.entries:
        if key.text not in KEYS:
            notes.fault(key.mark, f"a mission has no key '{key.text}'", key_meant(key.text, KEYS, WORDS))
    mission, summary = _header(notes, root, "mission", required=True), _header(notes, root, "summary")
    take(notes, read_params(notes, root.get("params")), mission)
    node = root.get("tree")
    if node is None:
        if not _called_otherwise(root, "tree"):
            notes.fault(root.mark, "the mission needs 'tree:' with its first behaviour under it")
        return Body(mission, summary, None, {})
    found = setters(node, notes.leaves)
    given = notes.params.keys() | notes.stored
    notes.kept |= {name: leaf for name, leaf in of_one_kind(found).items() if name not in given}
    notes.stored |= found.keys()
    tree = read_step(notes, node)
    properties = read_properties(notes, root.get("properties"), tree)
    returns = read_returns(notes, root.get("returns"))
    return Body(mission, summary, tree, returns, properties, _if_interrupted(notes, root))


def _header(notes: Notes, root: Mapping, key: str, *, required: bool = False) -> str:
    node = root.get(key)
    if node is None:
        if required and not _called_otherwise(root, key):
            notes.fault(root.mark, f"the mission needs '{key}: ...'")
        return ""
    if not isinstance(node, Scalar) or node.value is None or not node.text.strip():
        notes.fault(node.mark, f"'{key}' needs a text")
        return ""
    return node.text


def _called_otherwise(root: Mapping, key: str) -> bool:
    """Say whether a key is there under another name, which has been noted."""
    return any(word not in KEYS and ours_for(word, WORDS, (key,)) for word in root.keys())  # noqa: SIM118 - no dict


def _if_interrupted(notes: Notes, root: Mapping) -> str:
    node = root.get("if_interrupted")
    if node is None:
        return ""
    said = node.text if isinstance(node, Scalar) else ""
    if said not in IF_INTERRUPTED:
        notes.fault(node.mark, f"'if_interrupted' cannot be {seen(said)}", one_of(said, IF_INTERRUPTED))
    return said


def read_returns(notes: Notes, node: Node | None) -> dict[str, Value]:
    """Read ``returns: {name: expression}``, whose expressions are those of the mission of ``notes``."""
    if node is None:
        return {}
    if not isinstance(node, Mapping):
        notes.fault(node.mark, "'returns' needs names and expressions", "write returns: {found: person}")
        return {}
    found = {}
    for key, value in node.entries:
        notes.new_name(key, "a result")
        if isinstance(value, Scalar):
            found[key.text] = read_expression(notes, f"result '{key.text}'", value, lambda result: result)
        else:
            notes.fault(value.mark, f"result '{key.text}' needs an expression")
    return found
