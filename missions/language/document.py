"""The one way from a mission file, or its text, to a checked plan."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

from behaviours.leaf import Leaf
from config.faults import Diagnostic, InvalidFileError, Source
from config.marked import Mapping as Entries
from config.marked import compose, read_source
from missions.language.answers import check_answers
from missions.language.body import read_body
from missions.language.claims import Target, check_claims, check_necks, check_needs, check_reach
from missions.language.flow import check_flow
from missions.language.for_each import check_names
from missions.language.notes import Lookup, Notes, Words, no_missions
from missions.language.outcomes import check_outcomes
from missions.language.params import Param, read_params, take_params
from missions.language.phrases import check_phrases
from missions.language.plan import Plan, Step
from missions.language.steps import read_step
from missions.language.variables import check_kinds

MAX_DEPTH = 100
"""Steps from the root of a tree to its deepest leaf."""


def load_plan(
    path: Path,
    leaves: Mapping[str, type[Leaf]],
    things: Mapping[str, Lookup],
    *,
    find_mission: Callable[[str, Path], Path] = no_missions,
    params: Mapping[str, str] | None = None,
    complete: bool = False,
    robot: Target | None = None,
) -> Plan:
    """Read and check a mission, and the missions that it runs.

    ``params`` are the caller's, as texts; ``complete`` asks that none is missing. ``robot`` is the one it is for.
    Raises InvalidFileError with every mistake, in the files and in the params.
    """
    source = read_source(path)
    words = Words(leaves, things, find_mission)
    return _check(source, words, (path.resolve(),), params or {}, complete=complete, robot=robot)


def check_plan(
    source: Source,
    leaves: Mapping[str, type[Leaf]],
    things: Mapping[str, Lookup],
    *,
    find_mission: Callable[[str, Path], Path] = no_missions,
    params: Mapping[str, str] | None = None,
    complete: bool = False,
    robot: Target | None = None,
) -> Plan:
    """Check a mission's text. See ``load_plan``."""
    words = Words(leaves, things, find_mission)
    return _check(source, words, (), params or {}, complete=complete, robot=robot)


def declared_params(path: Path, leaves: Mapping[str, type[Leaf]], things: Mapping[str, Lookup]) -> Mapping[str, Param]:
    """Read what params a mission has, and nothing else of it. Raises InvalidFileError for a mistake in them."""
    source, faults = read_source(path), list[Diagnostic]()
    root = compose(source, faults)
    notes = Notes(source, Words(leaves, things, no_missions), (path.resolve(),), faults=faults)
    found = read_params(notes, root.get("params") if isinstance(root, Entries) else None)
    if notes.faults:
        raise InvalidFileError(notes.faults)
    return found


def _check(
    source: Source,
    words: Words,
    chain: tuple[Path, ...],
    given: Mapping[str, str],
    *,
    complete: bool,
    robot: Target | None,
) -> Plan:
    faults: list[Diagnostic] = []
    root = compose(source, faults)
    # Each thing is looked up once, however often missions name it.
    words.things = {kind: cache(find) for kind, find in words.things.items()}
    words.find_mission = cache(words.find_mission)
    notes = Notes(source, words, chain, faults=faults)

    def take(notes: Notes, params: dict[str, Param], mission: str) -> None:
        take_params(notes, params, given, mission, complete=complete)

    body = read_body(notes, root, take, read_step)
    tree = None if body is None else body.tree
    if body is not None and tree is not None and _is_flat(notes, tree):
        check_claims(notes, tree)
        if robot is not None:
            check_needs(notes, tree, robot)
            check_reach(notes, tree, robot)
            check_necks(notes, tree, robot)
            check_phrases(notes, tree, robot)
        check_kinds(notes, tree, body.returns)
        check_answers(notes, tree)
        check_names(notes, tree)
        check_flow(notes, tree)
        check_outcomes(notes, tree)
    if notes.faults or body is None or tree is None:
        raise InvalidFileError(notes.faults)
    params = dict(notes.params)
    return Plan(body.mission, body.summary, params, tree, source, body.returns, body.properties, body.if_interrupted)


def _is_flat(notes: Notes, tree: Step) -> bool:
    """Note a tree so deep that ticking it, which goes down step by step, would overflow the stack."""
    depth, row = 0, [tree]
    while row:
        depth, row = depth + 1, [child for step in row for child in step.children]
    if depth > MAX_DEPTH:
        notes.fault(tree.mark, f"{depth} steps deep, modifiers counted; at most {MAX_DEPTH} are possible")
    return depth <= MAX_DEPTH
