"""Phrases that a mission listens for."""

from dataclasses import replace
from string import punctuation

from behaviours.leaf import Leaf
from config.diagnostics import Diagnostic
from config.units import quoted_value
from config.yaml_nodes import Listing, Mapping, Node, Scalar
from missions.language.check_context import CheckContext
from missions.language.claims import TargetRobot
from missions.language.expressions import INVALID_VALUE, Value
from missions.language.plan import Step
from perception.hearing.grammar import normalise, phrase_error

PHRASES_KIND = "phrases"
"""Kind of arguments that take phrases."""


def read_phrases(context: CheckContext, node: Node, label: str) -> Value:
    """Return the phrases in a YAML node, a text or a list, as a mapping: normalised form to written form.

    A param may hold one phrase or several. All phrases must be known before the run, since the recogniser needs them. A
    phrase with a param that the caller has not set yet is left out.
    """
    found: dict[str, str] = {}
    wrong = False
    items = node.items if isinstance(node, Listing) else [node]
    if isinstance(node, Scalar) and "," in node.text and "${" not in node.text:
        parts = [part.strip() for part in node.text.split(",")]
        hint = f"write [{', '.join(parts)}] for {len(parts)} phrases, or leave the comma out"
        context.fault(node.mark, f"{label} is one phrase with a comma in it, {quoted_value(node.text)}", hint)
        return INVALID_VALUE
    if not items:
        context.fault(node.mark, f"{label} needs at least one phrase")
    for item in items:
        if not isinstance(item, Scalar):
            context.fault(item.mark, f"{label} needs a phrase, or a list of them")
            wrong = True
            continue
        value = context.read_value(item if item.value is None else replace(item, value=item.text), label, _as_phrases)
        wrong = wrong or value is INVALID_VALUE
        if isinstance(value.constant, tuple):
            for phrase in value.constant:
                found.setdefault(normalise(phrase), phrase)
        else:
            hint = "use params that are given when it starts, or listen for all that may be said"
            message = f"{quoted_value(item.text)} must be known before the mission starts"
            wrong = not context.check_known_early(item, label, message, [value], hint) or wrong
    return INVALID_VALUE if wrong else Value(found)


def second_phrase_hint(leaf: type[Leaf], node: Mapping, name: Scalar) -> str:
    """Return a hint for ``{for: yes, no}``, in which YAML reads ``no`` as a key; the user meant two phrases.

    Empty if this is not the mistake.
    """
    own_argument = next((argument.name for argument in leaf.arguments.values() if argument.kind == PHRASES_KIND), "")
    first, second = node.get(own_argument), node.get(name.text)
    if not isinstance(first, Scalar) or not isinstance(second, Scalar) or second.value is not None:
        return ""
    return f"write {own_argument}: [{first.text}, {name.text}] for two phrases"


def _as_phrases(value: object) -> tuple[str, ...]:
    """Return the phrases of a text, or of a list in a param. Raises ValueError."""
    if isinstance(value, list) and not value:
        raise ValueError("needs at least one phrase, got an empty list")
    return tuple(map(_check_phrase, value if isinstance(value, list) else [value]))


def _check_phrase(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError(f"needs a phrase, got {quoted_value(value)}")
    if fault := phrase_error(value):
        raise ValueError(f"cannot be {quoted_value(value)}: {fault}")
    return value


def all_phrases(tree: Step) -> tuple[str, ...]:
    """Return all phrases of a mission in normalised form, each once."""
    return tuple(dict.fromkeys(phrase for step in tree.walk() for phrase in step_phrases(step)))


def step_phrases(step: Step) -> dict[str, str]:
    """Return the known phrases of one step: the written form by the normalised form."""
    declared = {} if step.leaf is None else step.leaf.arguments
    found: dict[str, str] = {}
    for name, value in step.arguments.items():
        if name in declared and declared[name].kind == PHRASES_KIND and isinstance(value.constant, dict):
            found |= value.constant
    return found


def check_phrases(context: CheckContext, tree: Step, robot: TargetRobot) -> None:
    """Report each word whose pronunciation is unknown to the robot."""
    words = dict.fromkeys(word for phrase in all_phrases(tree) for word in phrase.split())
    unknown = set(robot.unpronounceable(tuple(words))) if words else set()
    for step in tree.walk():
        own_phrases = step_phrases(step)
        strange = {word: phrase for phrase in own_phrases for word in phrase.split() if word in unknown}
        for word, phrase in strange.items():
            unknown_word = quoted_value(_as_written(word, own_phrases[phrase]))
            context.fault_at(
                step,
                f"'{step.kind}' cannot listen for {unknown_word}: no dictionary has it",
                f"pronunciations: {{{word}: ...}} in the section 'microphone' of robot '{robot.name}' (docs/speech.md)",
            )


def confusions(tree: Step, robot: TargetRobot) -> list[Diagnostic]:
    """Return a hint for each pair of phrases that the robot easily confuses, placed at the second phrase."""
    places: dict[str, tuple[Step, str]] = {}
    for step in tree.walk():
        for phrase, written in step_phrases(step).items():
            places.setdefault(phrase, (step, written))
    found = robot.confusable(tuple(places)) if len(places) > 1 else ()
    return [_confusion_hint(places[one], places[other]) for one, other in found]


def _confusion_hint(one: tuple[Step, str], other: tuple[Step, str]) -> Diagnostic:
    (first, earlier), (step, written) = one, other
    where = "" if first is step else f" (line {first.mark.line})"
    message = f"{quoted_value(written)} is easily confused with {quoted_value(earlier)}{where}"
    return Diagnostic(step.source, step.mark, message, "try another or a longer phrase (docs/speech.md)")


def _as_written(word: str, phrase: str) -> str:
    """Return the written form of a normalised word of ``phrase``."""
    plain = (each.strip(punctuation) for each in phrase.split())
    return next((each for each in plain if normalise(each) == word), word)
