"""A mission file as a whole: its header, its params, its tree. The one way from a path to a checked plan."""

from collections.abc import Mapping as Named
from pathlib import Path

from behaviours.leaf import Leaf
from config.faults import Fault, InvalidFileError, Mark, Source, one_of
from config.marked import Mapping, Node, Scalar, compose, plain, read_source
from config.units import Quantity, article
from missions.language.arguments import known_quantity
from missions.language.claims import check_claims, check_needs
from missions.language.notes import Lookup, Notes
from missions.language.plan import Plan, Step
from missions.language.steps import read_step, stored_names
from missions.language.values import shown

KEYS = ("mission", "summary", "params", "tree")


def load_plan(
    path: Path,
    leaves: Named[str, type[Leaf]],
    things: Named[str, Lookup],
    *,
    params: Named[str, str] | None = None,
    robot: tuple[str, frozenset[str]] | None = None,
) -> Plan:
    """Read and check a mission. ``params`` are the caller's, as texts; ``robot`` is a name and the parts it has.

    Raises InvalidFileError with every mistake, in the file and in the params.
    """
    return check_plan(read_source(path), leaves, things, params=params, robot=robot)


def check_plan(
    source: Source,
    leaves: Named[str, type[Leaf]],
    things: Named[str, Lookup],
    *,
    params: Named[str, str] | None = None,
    robot: tuple[str, frozenset[str]] | None = None,
) -> Plan:
    """Check a mission's text. See ``load_plan``."""
    root = compose(source)
    notes = Notes(source, leaves, things)
    if not isinstance(root, Mapping):
        notes.fault(root.mark, "a mission begins with keys", "write 'mission: NAME', then 'tree:'")
        raise InvalidFileError(notes.faults)
    for key, _ in root.entries:
        if key.text not in KEYS:
            notes.fault(key.mark, f"a mission has no key '{key.text}'", one_of(key.text, KEYS))
    mission, summary = _header(notes, root, "mission", required=True), _header(notes, root, "summary")
    _read_params(notes, root.get("params"), params or {})
    tree = _read_tree(notes, root)
    if tree is not None:
        check_claims(notes, tree)
        if robot is not None:
            check_needs(notes, tree, *robot)
    if notes.faults or tree is None:
        raise InvalidFileError(notes.faults)
    return Plan(mission, summary, dict(notes.params), tree, source)


def _header(notes: Notes, root: Mapping, key: str, *, required: bool = False) -> str:
    node = root.get(key)
    if node is None:
        if required:
            notes.fault(root.mark, f"the mission needs '{key}: ...'")
        return ""
    if not isinstance(node, Scalar) or not node.text.strip():
        notes.fault(node.mark, f"'{key}' needs a text")
        return ""
    return node.text


def _read_tree(notes: Notes, root: Mapping) -> Step | None:
    node = root.get("tree")
    if node is None:
        notes.fault(root.mark, "the mission needs 'tree:' with its first behaviour under it")
        return None
    notes.stored = stored_names(node, {word: leaf.open_ended for word, leaf in notes.leaves.items()})
    return read_step(notes, node)


def _read_params(notes: Notes, node: Node | None, given: Named[str, str]) -> None:
    """Take the defaults from the file, then the caller's values in their place."""
    if node is not None and not isinstance(node, Mapping):
        notes.fault(node.mark, "'params' needs names and their defaults", "write 'patience: 60 s' under it")
    entries = node.entries if isinstance(node, Mapping) else []
    for key, value in entries:
        if not key.text.isidentifier():
            notes.fault(key.mark, f"a param needs a plain word as its name, got '{key.text}'")
        if isinstance(value, Scalar):
            notes.params[key.text] = value.text if value.quoted else known_quantity(value.value)
        else:
            notes.fault(value.mark, f"param '{key.text}' needs one value as its default")
    for name, text in given.items():
        source = Source(f"--param {name}", f"{name}={text}")
        if name not in notes.params:
            message = f"mission '{_name_of(notes)}' has no param '{name}'"
            notes.faults.append(Fault(source, Mark(1, 1, len(name)), message, one_of(name, notes.params)))
            continue
        try:
            notes.params[name] = like(notes.params[name], text)
        except ValueError as error:
            notes.faults.append(Fault(source, Mark(1, len(name) + 2, max(1, len(text))), f"'{name}' {error}"))


def _name_of(notes: Notes) -> str:
    return notes.source.name


def like(default: object, text: str) -> object:
    """Read a caller's text as a value of the default's kind. Raises ValueError that says what was expected."""
    if isinstance(default, Quantity):
        value = known_quantity(text)
        if not isinstance(value, Quantity) or value.dimension != default.dimension:
            raise ValueError(f"needs {article(default.dimension)} such as '{default}', got '{text}'")
        return value
    if isinstance(default, str):
        return text
    value = plain(text)
    if isinstance(default, bool) != isinstance(value, bool) or (
        isinstance(default, int | float) and not isinstance(value, int | float)
    ):
        kind = "true or false" if isinstance(default, bool) else "a number"
        raise ValueError(f"needs {kind} such as '{shown(default)}', got '{text}'")
    return value
