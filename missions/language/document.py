"""Parses and checks a mission file, or its text, and returns a plan.

It also checks comparisons with results of ``listen``, after the whole tree is read.
"""

import ast
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

from behaviours.leaf import Leaf
from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText, did_you_mean
from config.units import quoted_value
from config.yaml_nodes import Mapping as Entries
from config.yaml_nodes import Node, compose, read_source
from missions.language.check_context import CheckContext, Lookup, Vocabulary, find_no_mission
from missions.language.claims import TargetRobot, check_claims, check_cleanups, check_necks, check_needs, check_reach
from missions.language.definite_assignment import check_assignments
from missions.language.draws import check_draws
from missions.language.expressions import Expression, Value
from missions.language.for_each import check_loop_names, steps_in_scope
from missions.language.mission_body import FIRST_KEYS_HINT, read_body
from missions.language.nodes import MISSION, SWITCHES
from missions.language.outcomes import check_outcomes
from missions.language.param_types import Param, assign_params, read_params
from missions.language.phrases import check_phrases, step_phrases
from missions.language.plan import Plan, Step
from missions.language.steps import read_step
from missions.language.variables import check_kinds
from missions.language.wanted_objects import check_objects


def check_answers(context: CheckContext, tree: Step) -> None:
    """Report each text that a mission compares with a result of ``listen`` but does not listen for."""
    _check_mission_answers(context, tree, context.params)


def _check_mission_answers(context: CheckContext, tree: Step, params: Collection[str]) -> None:
    """Report texts of one mission and its sub-missions that no ``listen`` of the same mission can return.

    ``params`` are the names of the mission's params.
    """
    steps = list(steps_in_scope(tree))
    answers = _phrase_variables(steps, params)
    for step in steps:
        for value in step.arguments.values():
            for name, text in _text_comparisons(value):
                if name in answers and text not in answers[name]:
                    _report_impossible_text(context, step, name, text, answers[name])
        on = step.arguments.get("on") if step.kind in SWITCHES else None
        name = _variable_name(on)
        for case in step.cases if name in answers else ():
            if isinstance(case, str) and case not in answers[name]:
                _report_impossible_text(context, step, name, case, answers[name])
        if step.kind == MISSION:
            _check_mission_answers(context, step.children[0], step.arguments.keys())


def _phrase_variables(steps: Collection[Step], params: Collection[str]) -> Mapping[str, frozenset[str]]:
    """Return the variables that hold only results of ``listen``, each with all possible phrases."""
    found: dict[str, frozenset[str]] = {}
    other = set(params)
    for step in steps:
        phrases = step_phrases(step)
        # If a param has no value yet, phrases with that param are missing.
        known = phrases and not any("${" in text for text in step.arguments_as_written.values())
        if step.output_variable is None:
            other |= step.direct_variables | step.returns.keys()
        elif known:
            found[step.output_variable] = found.get(step.output_variable, frozenset()) | frozenset(phrases.values())
        else:
            other.add(step.output_variable)
    return {name: phrases for name, phrases in found.items() if name not in other}


def _text_comparisons(value: Value) -> Iterator[tuple[str, str]]:
    """Yield each variable that an expression compares with a text, and the text."""
    parts = getattr(value.template, "parts", (value.template,))
    for tree in (part.tree for part in parts if isinstance(part, Expression)):
        for node in ast.walk(tree):
            if isinstance(node, ast.Compare) and len(node.ops) == 1 and isinstance(node.ops[0], _EQUALITY):
                sides = (node.left, node.comparators[0])
                yield from (
                    (one.id, text)
                    for one, other in (sides, sides[::-1])
                    if isinstance(one, ast.Name)
                    for text in _texts(other)
                )


_EQUALITY = (ast.Eq, ast.NotEq, ast.In, ast.NotIn)


def _texts(node: ast.expr) -> Iterator[str]:
    """Yield the texts in a node of an expression: a text, or a list of texts."""
    for each in node.elts if isinstance(node, ast.List | ast.Tuple) else [node]:
        if isinstance(each, ast.Constant) and isinstance(each.value, str):
            yield each.value


def _variable_name(value: Value | None) -> str:
    """Return the variable if the expression is a variable alone; empty otherwise."""
    formula = None if value is None else value.template
    return formula.tree.id if isinstance(formula, Expression) and isinstance(formula.tree, ast.Name) else ""


def _report_impossible_text(context: CheckContext, step: Step, name: str, text: str, phrases: Collection[str]) -> None:
    known = ", ".join(sorted(phrases))
    hint = did_you_mean(text, phrases) or f"it can be: {known}"
    context.fault_at(step, f"'{step.kind}': '{name}' is never {quoted_value(text)}", hint)


def load_plan(
    path: Path,
    leaves: Mapping[str, type[Leaf]],
    things: Mapping[str, Lookup],
    *,
    find_mission: Callable[[str, Path], Path] = find_no_mission,
    params: Mapping[str, str] | None = None,
    complete: bool = False,
    robot: TargetRobot | None = None,
) -> Plan:
    """Read and check a mission and its sub-missions.

    ``leaves`` and ``things`` are the names that it can use; ``find_mission`` returns the file of a sub-mission.
    ``params`` are texts of the caller; with ``complete``, a param without a value is an error. ``robot`` is the robot
    to check for. Raises InvalidFileError with all errors in files and params.
    """
    source = read_source(path)
    words = Vocabulary(leaves, things, find_mission)
    return _check(source, words, (path.resolve(),), params or {}, complete=complete, robot=robot)


def check_plan(
    source: SourceText,
    leaves: Mapping[str, type[Leaf]],
    things: Mapping[str, Lookup],
    *,
    find_mission: Callable[[str, Path], Path] = find_no_mission,
    params: Mapping[str, str] | None = None,
    complete: bool = False,
    robot: TargetRobot | None = None,
) -> Plan:
    """Check the text of a mission, and return its plan. Raises InvalidFileError with all errors.

    ``leaves`` and ``things`` are the names that it can use; ``find_mission`` returns the file of a sub-mission.
    ``params`` are texts of the caller; with ``complete``, a param without a value is an error. ``robot`` is the robot
    to check for.
    """
    words = Vocabulary(leaves, things, find_mission)
    return _check(source, words, (), params or {}, complete=complete, robot=robot)


def declared_params(path: Path, leaves: Mapping[str, type[Leaf]], things: Mapping[str, Lookup]) -> Mapping[str, Param]:
    """Read only the params of a mission. Raises InvalidFileError for errors in them."""
    source, faults = read_source(path), list[Diagnostic]()
    root = compose(source, faults)
    notes = CheckContext(source, Vocabulary(leaves, things, find_no_mission), (path.resolve(),), faults=faults)
    found = read_params(notes, root.get("params") if isinstance(root, Entries) else None)
    if notes.faults:
        raise InvalidFileError(notes.faults)
    return found


def _check(
    source: SourceText,
    words: Vocabulary,
    chain: tuple[Path, ...],
    param_texts: Mapping[str, str],
    *,
    complete: bool,
    robot: TargetRobot | None,
) -> Plan:
    faults: list[Diagnostic] = []
    root = compose(source, faults, empty_hint=FIRST_KEYS_HINT)
    faults[:] = [_with_list_hint(fault, words.leaves) for fault in faults]
    # Each thing is looked up once, however often missions name it.
    words.things = {kind: cache(find) for kind, find in words.things.items()}
    words.find_mission = cache(words.find_mission)
    notes = CheckContext(source, words, chain, faults=faults)

    def take(notes: CheckContext, params: dict[str, Param], mission: str) -> None:
        assign_params(notes, params, param_texts, mission, complete=complete)

    body = read_body(notes, root, take, read_step)
    tree = None if body is None else body.tree
    # The following checks report errors at steps only, and none where a line could not be read.
    if body is not None and tree is not None and not notes.has_unreadable_line:
        check_claims(notes, tree)
        check_cleanups(notes, tree)
        if robot is not None:
            check_needs(notes, tree, robot)
            check_reach(notes, tree, robot)
            check_necks(notes, tree, robot)
            check_phrases(notes, tree, robot)
        check_kinds(notes, tree, body.returns)
        check_answers(notes, tree)
        check_draws(notes, tree)
        check_loop_names(notes, tree)
        check_objects(notes, tree)
        check_assignments(notes, tree)
        check_outcomes(notes, tree)
    if notes.faults or body is None or tree is None:
        raise InvalidFileError(notes.faults)
    params = dict(notes.params)
    return Plan(
        body.mission,
        body.summary,
        params,
        tree,
        source,
        body.returns,
        body.properties,
        body.if_interrupted,
        _unread_params(root, notes.read_names),
        frozenset(notes.missing_params),
    )


def _with_list_hint(fault: Diagnostic, leaves: Mapping[str, type[Leaf]]) -> Diagnostic:
    """Return a fault about a behaviour that stands twice as a key with the hint to write a list."""
    twice = re.match(r"'(\w+)' is a duplicate key", fault.message)
    if twice is None or twice[1] not in leaves:
        return fault
    return replace(fault, suggestion=f"to do both, write a 'sequence' with '- {twice[1]}: ...' on each line")


def _unread_params(root: Node, read_names: Collection[str]) -> dict[str, Mark]:
    """Return the places of the params of a mission that are not among ``read_names``, by name."""
    declared = root.get("params") if isinstance(root, Entries) else None
    entries = declared.entries if isinstance(declared, Entries) else []
    return {name.text: name.mark for name, _ in entries if name.text not in read_names}


def hidden_result_hints(tree: Step) -> list[Diagnostic]:
    """Return a hint for each ``returns`` beside a mission that reads a variable in place of a result of the same name.

    The mission declares the result with another value than that of its param or variable.
    """
    message = "'returns' beside '{}' reads the variable '{}', and not the result of this name"
    hint = "leave 'returns' out and write as: NAME, then read NAME.{}"
    return [
        Diagnostic(step.source, step.mark, message.format(step.name, name), hint.format(name))
        for step in tree.walk()
        for name in step.hidden_results
    ]


def unread_param_hints(plan: Plan) -> list[Diagnostic]:
    """Return a hint for each param that no expression of the mission reads, so that a caller sets it in vain."""
    hint = "write ${{{}}} where its value belongs, or remove it"
    return [
        Diagnostic(plan.source, mark, f"nothing reads the param '{name}'", hint.format(name))
        for name, mark in plan.unread_params.items()
    ]
