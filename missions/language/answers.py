"""Answers that cannot be: a variable keeps what ``listen`` has heard, and is asked for what that never says."""

import ast
from collections.abc import Collection, Iterator, Mapping

from config.faults import did_you_mean
from config.units import seen
from missions.language.expressions import Expression
from missions.language.nodes import MISSION, SWITCHES
from missions.language.notes import Notes
from missions.language.phrases import own_phrases
from missions.language.plan import Step
from missions.language.values import Value


def check_answers(notes: Notes, tree: Step) -> None:
    """Note every text with which an answer is compared, or that is a case of it, and that is none of the phrases."""
    _check(notes, tree, notes.params)


def _check(notes: Notes, tree: Step, params: Collection[str]) -> None:
    """Check one mission; those in it have variables of their own."""
    steps = list(_own(tree))
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
            _check(notes, step.children[0], step.arguments.keys())


def _own(step: Step) -> Iterator[Step]:
    """Yield the steps of one mission, without those of the missions in it."""
    yield step
    for child in () if step.kind == MISSION else step.children:
        yield from _own(child)


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
