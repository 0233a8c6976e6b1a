"""What a mission listens for: read from its file, and gathered from its whole tree."""

from dataclasses import replace
from string import punctuation

from behaviours.leaf import Leaf
from config.faults import Diagnostic
from config.marked import Listing, Mapping, Node, Scalar
from config.units import seen
from missions.language.claims import Target
from missions.language.expressions import UNREAD, Value
from missions.language.notes import Notes
from missions.language.plan import Step
from perception.hearing.grammar import fault_of, normalised

KIND = "phrases"
"""The kind of the arguments that hold them."""


def read_phrases(notes: Notes, node: Node, what: str) -> Value:
    """Read one phrase, or a list of them: a mapping from how each is listened for to how it is written.

    All must be known before the mission starts, since the recogniser is made for them; what has to wait for a param
    that nobody has given yet is left out.
    """
    found: dict[str, str] = {}
    wrong = False
    items = node.items if isinstance(node, Listing) else [node]
    if isinstance(node, Scalar) and "," in node.text:
        parts = [part.strip() for part in node.text.split(",")]
        hint = f"write [{', '.join(parts)}] for {len(parts)} phrases, or leave the comma out"
        notes.fault(node.mark, f"{what} is one phrase with a comma in it, {seen(node.text)}", hint)
        return UNREAD
    if not items:
        notes.fault(node.mark, f"{what} needs at least one phrase")
    for item in items:
        if not isinstance(item, Scalar):
            notes.fault(item.mark, f"{what} needs a phrase, or a list of them")
            wrong = True
            continue
        value = notes.value(item if item.value is None else replace(item, value=item.text), what, _sayable)
        wrong = wrong or value is UNREAD
        if isinstance(value.constant, str):
            found.setdefault(normalised(value.constant), value.constant)
        elif value.template is not None and not notes.awaits(value.template):
            hint = "use params that are given when it starts, or listen for all that may be said"
            notes.fault(item.mark, f"{what}: {seen(item.text)} must be known before the mission starts", hint)
            wrong = True
    return UNREAD if wrong else Value(found)


def second_phrase(leaf: type[Leaf], node: Mapping, name: Scalar) -> str:
    """Say how to write two phrases where ``{for: yes, no}`` stands, of which YAML makes a key without a value."""
    own = next((argument.name for argument in leaf.arguments.values() if argument.kind == KIND), "")
    first, second = node.get(own), node.get(name.text)
    if not isinstance(first, Scalar) or not isinstance(second, Scalar) or second.value is not None:
        return ""
    return f"write {own}: [{first.text}, {name.text}] for two phrases"


def _sayable(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError(f"needs a phrase, got {seen(value)}")
    if fault := fault_of(value):
        raise ValueError(f"cannot be {seen(value)}: {fault}")
    return value


def phrases_of(tree: Step) -> tuple[str, ...]:
    """Return all phrases that a mission listens for, as they are listened for, each once."""
    return tuple(dict.fromkeys(phrase for step in tree.walk() for phrase in own_phrases(step)))


def own_phrases(step: Step) -> dict[str, str]:
    """Return the phrases that one step listens for, as far as they are known: as written, by how each is heard."""
    declared = {} if step.leaf is None else step.leaf.arguments
    found: dict[str, str] = {}
    for name, value in step.arguments.items():
        if name in declared and declared[name].kind == KIND and isinstance(value.constant, dict):
            found |= value.constant
    return found


def check_phrases(notes: Notes, tree: Step, robot: Target) -> None:
    """Note every word that the robot's ears cannot listen for, since nobody knows how it is said."""
    words = dict.fromkeys(word for phrase in phrases_of(tree) for word in phrase.split())
    unknown = set(robot.unpronounceable(tuple(words))) if words else set()
    for step in tree.walk():
        own = own_phrases(step)
        strange = {word: phrase for phrase in own for word in phrase.split() if word in unknown}
        for word, phrase in strange.items():
            notes.fault_at(
                step,
                f"'{step.kind}' cannot listen for {seen(_written(word, own[phrase]))}: no dictionary has it",
                f"pronunciations: {{{word}: ...}} in the section 'microphone' of robot '{robot.name}' (docs/speech.md)",
            )


def confusions(tree: Step, robot: Target) -> list[Diagnostic]:
    """Return a hint for each two phrases that the robot's ears easily take for each other, where the second stands."""
    places: dict[str, tuple[Step, str]] = {}
    for step in tree.walk():
        for phrase, written in own_phrases(step).items():
            places.setdefault(phrase, (step, written))
    found = robot.confusable(tuple(places)) if len(places) > 1 else ()
    return [_confused(places[one], places[other]) for one, other in found]


def _confused(one: tuple[Step, str], other: tuple[Step, str]) -> Diagnostic:
    (first, earlier), (step, written) = one, other
    where = "" if first is step else f" (line {first.mark.line})"
    message = f"{seen(written)} is easily confused with {seen(earlier)}{where}"
    return Diagnostic(step.source, step.mark, message, "try another or a longer phrase (docs/speech.md)")


def _written(word: str, phrase: str) -> str:
    """Return a word as the mission writes it, in ``phrase``."""
    plain = (each.strip(punctuation) for each in phrase.split())
    return next((each for each in plain if normalised(each) == word), word)
