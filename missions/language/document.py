"""The one way from a mission file, or its text, to a checked plan.

A variable that keeps what ``listen`` has heard, and is asked for what that never says, is found with the whole of it.
"""

import ast
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cache
from pathlib import Path

from behaviours.leaf import Leaf
from config.faults import Diagnostic, InvalidFileError, Source, did_you_mean
from config.marked import Mapping as Entries
from config.marked import compose, read_source
from config.units import seen
from missions.language.body import read_body
from missions.language.claims import Target, check_claims, check_necks, check_needs, check_reach
from missions.language.expressions import Expression, Value
from missions.language.for_each import check_names, own_steps
from missions.language.nodes import MISSION, SWITCHES
from missions.language.notes import Lookup, Notes, Words, no_missions
from missions.language.outcomes import check_outcomes
from missions.language.param_types import Param, read_params, take_params
from missions.language.phrases import check_phrases, own_phrases
from missions.language.plan import Plan, Step
from missions.language.sought import check_objects
from missions.language.steps import read_step
from missions.language.unset import check_flow
from missions.language.variables import check_kinds


def check_answers(notes: Notes, tree: Step) -> None:
    """Note every text with which an answer is compared, or that is a case of it, and that is none of the phrases."""
    _check_asked(notes, tree, notes.params)


def _check_asked(notes: Notes, tree: Step, params: Collection[str]) -> None:
    """Check one mission; those in it have variables of their own."""
    steps = list(own_steps(tree))
    answers = _answers(steps, params)
    for step in steps:
        for value in step.arguments.values():
            for name, text in _asked(value):
                if name in answers and text not in answers[name]:
                    _never(notes, step, name, text, answers[name])
        on = step.arguments.get("on") if step.kind in SWITCHES else None
        name = _name(on)
        for case in step.cases if name in answers else ():
            if isinstance(case, str) and case not in answers[name]:
                _never(notes, step, name, case, answers[name])
        if step.kind == MISSION:
            _check_asked(notes, step.children[0], step.arguments.keys())


def _answers(steps: Collection[Step], params: Collection[str]) -> Mapping[str, frozenset[str]]:
    """Return the variables that keep nothing but what is heard, each with all that this can be."""
    found: dict[str, frozenset[str]] = {}
    other = set(params)
    for step in steps:
        phrases = own_phrases(step)
        # A phrase with a param in it may be missing among them, where nobody has given that yet.
        known = phrases and not any("${" in text for text in step.written.values())
        if step.keep_as is None:
            other |= step.own_names | step.returns.keys()
        elif known:
            found[step.keep_as] = found.get(step.keep_as, frozenset()) | frozenset(phrases.values())
        else:
            other.add(step.keep_as)
    return {name: phrases for name, phrases in found.items() if name not in other}


def _asked(value: Value) -> Iterator[tuple[str, str]]:
    """Yield the variables that an expression compares with texts, each with the text."""
    parts = getattr(value.template, "parts", (value.template,))
    for tree in (part.tree for part in parts if isinstance(part, Expression)):
        for node in ast.walk(tree):
            if isinstance(node, ast.Compare) and len(node.ops) == 1 and isinstance(node.ops[0], _EQUAL):
                sides = (node.left, node.comparators[0])
                yield from (
                    (one.id, text)
                    for one, other in (sides, sides[::-1])
                    if isinstance(one, ast.Name)
                    for text in _texts(other)
                )


_EQUAL = (ast.Eq, ast.NotEq, ast.In, ast.NotIn)


def _texts(node: ast.expr) -> Iterator[str]:
    """Yield the texts that a node of an expression is, or is a list of."""
    for each in node.elts if isinstance(node, ast.List | ast.Tuple) else [node]:
        if isinstance(each, ast.Constant) and isinstance(each.value, str):
            yield each.value


def _name(value: Value | None) -> str:
    """Return the variable that an expression is; empty for any other."""
    formula = None if value is None else value.template
    return formula.tree.id if isinstance(formula, Expression) and isinstance(formula.tree, ast.Name) else ""


def _never(notes: Notes, step: Step, name: str, text: str, phrases: Collection[str]) -> None:
    known = ", ".join(sorted(phrases))
    hint = did_you_mean(text, phrases) or f"it can be: {known}"
    notes.fault_at(step, f"'{step.kind}': '{name}' is never {seen(text)}", hint)


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
    # What follows notes mistakes at steps alone, and none of those where a line could not be read.
    if body is not None and tree is not None and not notes.torn:
        check_claims(notes, tree)
        if robot is not None:
            check_needs(notes, tree, robot)
            check_reach(notes, tree, robot)
            check_necks(notes, tree, robot)
            check_phrases(notes, tree, robot)
        check_kinds(notes, tree, body.returns)
        check_answers(notes, tree)
        check_names(notes, tree)
        check_objects(notes, tree)
        check_flow(notes, tree)
        check_outcomes(notes, tree)
    if notes.faults or body is None or tree is None:
        raise InvalidFileError(notes.faults)
    params = dict(notes.params)
    return Plan(body.mission, body.summary, params, tree, source, body.returns, body.properties, body.if_interrupted)
