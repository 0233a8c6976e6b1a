"""``properties``: what a mission promises of itself, as ``mission verify`` proves or refutes it."""

import re
from collections.abc import Iterator

from config.faults import Mark, one_of
from config.marked import Listing, Mapping, Node, Scalar
from config.units import seen
from missions.language.notes import Notes
from missions.language.plan import Hole, Property, Step

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
