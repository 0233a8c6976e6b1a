"""A mission file as a whole: its header, its params, its tree. The one way from a path to a checked plan."""

from collections.abc import Mapping as Named
from functools import cache
from pathlib import Path

from behaviours.leaf import Leaf
from config.faults import Fault, InvalidFileError, Mark, Source, note, one_of
from config.marked import Mapping, Node, Scalar, compose, plain, read_source
from config.units import Quantity, in_dimension, quantity, seen
from missions.language.arguments import default_value
from missions.language.claims import check_claims, check_needs
from missions.language.notes import Lookup, Notes
from missions.language.plan import Plan, Step
from missions.language.steps import read_step, stored_names

KEYS = ("mission", "summary", "params", "tree")

MAX_DEPTH = 100
"""Steps from the root of a tree to its deepest leaf."""


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
    faults: list[Fault] = []
    root = compose(source, faults)
    # Each thing is looked up once, however often the mission names it.
    notes = Notes(source, leaves, {kind: cache(find) for kind, find in things.items()}, faults=faults)
    if not isinstance(root, Mapping):
        notes.fault(root.mark, "a mission begins with keys", "write 'mission: NAME', then 'tree:'")
        raise InvalidFileError(notes.faults)
    for key, _ in root.entries:
        if key.text not in KEYS:
            notes.fault(key.mark, f"a mission has no key '{key.text}'", one_of(key.text, KEYS))
    mission, summary = _header(notes, root, "mission", required=True), _header(notes, root, "summary")
    _read_params(notes, root.get("params"))
    _take_params(notes, params or {}, mission)
    tree = _read_tree(notes, root)
    if tree is not None:
        _check_depth(notes, tree)
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
    if not isinstance(node, Scalar) or node.value is None or not node.text.strip():
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


def _check_depth(notes: Notes, tree: Step) -> None:
    """Note a tree so deep that ticking it, which goes down step by step, would overflow the stack."""
    depth, row = 0, [tree]
    while row:
        depth, row = depth + 1, [child for step in row for child in step.children]
    if depth > MAX_DEPTH:
        notes.fault(tree.mark, f"{depth} steps deep, modifiers counted; at most {MAX_DEPTH} are possible")


def _read_params(notes: Notes, node: Node | None) -> None:
    """Take the defaults from the file."""
    if node is not None and not isinstance(node, Mapping):
        notes.fault(node.mark, "'params' needs names and their defaults", "write 'patience: 60 s' under it")
    for key, value in node.entries if isinstance(node, Mapping) else ():
        notes.new_name(key, "a param")
        if not isinstance(value, Scalar):
            notes.fault(value.mark, f"param '{key.text}' needs one value as its default")
        elif "${" in value.text:
            notes.fault(value.mark, f"the default of param '{key.text}' cannot be calculated", "write a plain value")
        else:
            notes.params[key.text] = default_value(value)


def _take_params(notes: Notes, given: Named[str, str], mission: str) -> None:
    """Put the caller's values in the place of the defaults."""
    for name, text in given.items():
        source = Source(f"--param {name}", f"{name}={text}")
        if name not in notes.params:
            hint = one_of(name, notes.params) or "it has none"
            message = f"mission '{mission}' has no param {seen(name)}"
            note(notes.faults, Fault(source, Mark(1, 1, len(name)), message, hint))
            continue
        try:
            notes.params[name] = like(notes.params[name], text)
        except ValueError as error:
            note(notes.faults, Fault(source, Mark(1, len(name) + 2, max(1, len(text))), f"'{name}' {error}"))


def like(default: object, text: str) -> object:
    """Read a caller's text as a value of the default's kind. Raises ValueError that says what was expected."""
    if isinstance(default, str):
        return text
    if isinstance(default, Quantity):
        in_dimension(plain(text), default.dimension)
        return quantity(text)
    value = plain(text)
    if default is None:
        found = quantity(text)
        return value if found is None else found
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise ValueError(f"needs true or false, got {seen(text)}")
    elif isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"needs a number such as {seen(default)}, got {seen(text)}")
    return value
