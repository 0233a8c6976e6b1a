"""What every mission file holds, the one that is run and those that it runs: a header, params, a tree, and so on."""

from collections.abc import Callable

from config.faults import one_of
from config.marked import Mapping, Node, Scalar
from config.synonyms import key_meant, ours_for
from config.units import seen
from drivers.api.quick import dataclass
from missions.language.modifiers import read_expression
from missions.language.notes import Notes
from missions.language.params import Param, read_params
from missions.language.plan import Property, Step
from missions.language.properties import read_properties
from missions.language.stored import of_one_kind, setters
from missions.language.synonyms import WORDS
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
