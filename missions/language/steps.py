"""From YAML nodes to steps: a word, one key with a value, a mapping or a list, and the modifiers beside it."""

from config.faults import one_of
from config.marked import Listing, Mapping, Node, Scalar
from missions.language.arguments import read_arguments
from missions.language.modifiers import MODIFIERS, read_modifier
from missions.language.notes import Notes
from missions.language.plan import COMPOSITES, Step

BESIDE = ("name", "as")
"""What may stand beside a behaviour without wrapping it."""


def read_step(notes: Notes, node: Node) -> Step | None:
    """Read one node of the tree; None where it is too wrong to go on."""
    if isinstance(node, Scalar):
        if node.value is None:
            notes.fault(node.mark, "a behaviour is missing here")
            return None
        return _behaviour(notes, node, None, None)
    if isinstance(node, Listing):
        notes.fault(node.mark, "a list needs a composite before it", "write 'sequence:' or 'parallel:' above it")
        return None
    return _with_modifiers(notes, node)


def _with_modifiers(notes: Notes, node: Mapping) -> Step | None:
    behaviours = []
    for key, value in node.entries:
        if key.text in notes.leaves or key.text in COMPOSITES:
            behaviours.append((key, value))
        elif key.text not in MODIFIERS and key.text not in BESIDE:
            words = [*notes.leaves, *COMPOSITES, *MODIFIERS, *BESIDE]
            beside = any(name in notes.leaves or name in COMPOSITES for name in node.keys())  # noqa: SIM118
            what = "modifier" if beside else "behaviour"
            notes.fault(key.mark, f"unknown {what} '{key.text}'", one_of_few(key.text, words))
    if not behaviours:
        if all(key.text in MODIFIERS or key.text in BESIDE for key in (key for key, _ in node.entries)):
            notes.fault(node.mark, "no behaviour here, only what may stand beside one")
        return None
    for key, _ in behaviours[1:]:
        notes.fault(
            key.mark,
            f"a second behaviour, '{key.text}', beside '{behaviours[0][0].text}'",
            "begin it with '- ' in a sequence, or indent it",
        )
    key, value = behaviours[0]
    step = _behaviour(notes, key, value, node)
    for word, given in node.entries:
        if word.text in MODIFIERS:
            wrapped = read_modifier(notes, word.text, given)
            if step is not None:
                step = Step(word.text, step.name, word.mark, (step,), arguments={"value": wrapped})
    return step


def _behaviour(notes: Notes, key: Scalar, value: Node | None, beside: Mapping | None) -> Step | None:
    """Read the behaviour itself, with the name and the variable that stand beside it."""
    name = _word_beside(notes, beside, "name") or key.text
    keep_as = _word_beside(notes, beside, "as")
    if key.text in COMPOSITES:
        if keep_as is not None:
            notes.fault(key.mark, f"'{key.text}' finds nothing out that 'as' could keep")
        return Step(key.text, name, key.mark, _children(notes, key, value))
    leaf = notes.leaves.get(key.text)
    if leaf is None:
        notes.fault(key.mark, f"unknown behaviour '{key.text}'", one_of_few(key.text, [*notes.leaves, *COMPOSITES]))
        return None
    if keep_as is not None and not leaf.stores:
        notes.fault(key.mark, f"'{key.text}' finds nothing out that 'as' could keep")
    arguments = read_arguments(notes, leaf, key, value)
    return Step(key.text, name, key.mark, leaf=leaf, arguments=arguments, keep_as=keep_as)


def one_of_few(word: str, known: list[str]) -> str:
    """Return the closest word, or where the whole list can be seen."""
    close = one_of(word, known)
    return close if close.startswith("did you mean") else "`mission behaviours` lists what there is"


def _children(notes: Notes, key: Scalar, value: Node | None) -> tuple[Step, ...]:
    if not isinstance(value, Listing) or not value.items:
        notes.fault(key.mark, f"'{key.text}' needs a list of at least one behaviour, each on a line with '- '")
        return ()
    found = (read_step(notes, item) for item in value.items)
    return tuple(step for step in found if step is not None)


def _word_beside(notes: Notes, beside: Mapping | None, key: str) -> str | None:
    node = beside.get(key) if beside is not None else None
    if node is None:
        return None
    if not isinstance(node, Scalar) or node.value is None:
        notes.fault(node.mark, f"'{key}' needs a {'word' if key == 'as' else 'text'}")
        return None
    if key == "as" and not node.text.isidentifier():
        notes.fault(node.mark, f"'as' needs a plain word, got '{node.text}'")
    return node.text


def stored_names(node: Node, words: dict[str, bool]) -> set[str]:
    """Return the variables that anything below ``node`` sets: by ``as``, or by an open-ended leaf such as ``set``.

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
            elif words.get(key.text) and isinstance(value, Mapping):
                found.update(value.keys())
            elif key.text in COMPOSITES:
                found |= stored_names(value, words)
    return found
