"""What every mission file holds, the one that is run and those that it runs: a header, params, a tree, and so on."""

from collections.abc import Callable
from dataclasses import dataclass

from config.faults import one_of
from config.marked import Listing, Mapping, Node, Scalar
from config.units import seen
from missions.language.modifiers import read_expression
from missions.language.notes import Notes
from missions.language.params import Param, read_params
from missions.language.plan import MISSION, SWITCH, Property, Step
from missions.language.properties import read_properties
from missions.language.values import Value

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


def read_body(notes: Notes, root: Node, take: Take, read_step: Callable[[Notes, Node], Step | None]) -> Body | None:
    """Read a mission file; None where it is no mapping."""
    if not isinstance(root, Mapping):
        notes.fault(root.mark, "a mission begins with keys", "write 'mission: NAME', then 'tree:'")
        return None
    for key, _ in root.entries:
        if key.text not in KEYS:
            notes.fault(key.mark, f"a mission has no key '{key.text}'", one_of(key.text, KEYS))
    mission, summary = _header(notes, root, "mission", required=True), _header(notes, root, "summary")
    take(notes, read_params(notes, root.get("params")), mission)
    node = root.get("tree")
    if node is None:
        notes.fault(root.mark, "the mission needs 'tree:' with its first behaviour under it")
        return Body(mission, summary, None, {})
    notes.stored |= stored_names(node, {word: leaf.open_ended for word, leaf in notes.leaves.items()})
    tree = read_step(notes, node)
    properties = read_properties(notes, root.get("properties"), tree)
    returns = read_returns(notes, root.get("returns"))
    return Body(mission, summary, tree, returns, properties, _if_interrupted(notes, root))


def _header(notes: Notes, root: Mapping, key: str, *, required: bool = False) -> str:
    node = root.get(key)
    if node is None:
        if required:
            notes.fault(root.mark, f"the mission needs '{key}: ...'")
        return ""
    if not isinstance(node, Scalar) or node.value is None or not node.text.strip():
        notes.fault(node.mark, f"'{key}' needs a text")
        return ""
    return node.text


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


def stored_names(node: Node, words: dict[str, bool]) -> set[str]:
    """Return the variables that anything below ``node`` sets: by ``as``, ``returns``, or a leaf such as ``set``.

    ``words`` says of each leaf whether it is open-ended. Read before the steps, since an expression may stand above
    what sets its variable.
    """
    found: set[str] = set()
    if isinstance(node, Listing):
        for item in node.items:
            found |= stored_names(item, words)
    elif isinstance(node, Mapping):
        for key, value in node.entries:
            if key.text == "as" and isinstance(value, Scalar):
                found.add(value.text)
            elif isinstance(value, Mapping) and (words.get(key.text) or _is_returns(node, key.text)):
                found.update(value.keys())
            elif key.text == SWITCH and isinstance(value, Mapping):
                cases = value.get("cases")
                branches = [case for _, case in cases.entries] if isinstance(cases, Mapping) else []
                for branch in (*branches, value.get("default")):
                    found |= set() if branch is None else stored_names(branch, words)
            elif isinstance(value, Listing):
                found |= stored_names(value, words)
    return found


def _is_returns(beside: Mapping, key: str) -> bool:
    return key == "returns" and beside.get(MISSION) is not None
