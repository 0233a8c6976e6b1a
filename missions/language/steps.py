"""From YAML nodes to steps: a word, one key with a value, a mapping or a list, and the modifiers beside it."""

import re
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from behaviours.leaf import Leaf
from config.faults import InvalidFileError, note, one_of, ours_for
from config.library import kinds_of
from config.marked import Listing, Mapping, Node, Scalar, compose, read_source
from config.units import article, seen
from drivers.api.kinds import SEVERAL
from missions.language.arguments import read_arguments
from missions.language.body import read_body, read_returns
from missions.language.counts import COUNTS, as_written, read_counts, written_arguments, written_entries
from missions.language.expressions import UNREAD, Value
from missions.language.for_each import read_for_each
from missions.language.modifiers import outdent, read_modifier
from missions.language.nodes import BRANCHES, COMPOSITES, FOR_EACH, MISSION, MODIFIERS, SWITCHES
from missions.language.notes import MAX_DEPTH, MAX_STEPS, Notes
from missions.language.param_types import Param, setters
from missions.language.plan import UNKNOWN, Hole, Step
from missions.language.switches import read_switch
from missions.language.synonyms import COMPARISON, WORDS, word_meant

# A mission inside a mission: found, read with the params that it is given, and its results handed back.

ReadStep = Callable[[Notes, Node], Step]


def read_submission(
    notes: Notes, key: Scalar, value: Node | None, beside: Mapping, name: str | None, read_step: ReadStep
) -> Step | None:
    """Read ``mission: NAME`` with the ``with`` and ``returns`` beside it."""
    if not isinstance(value, Scalar) or value.value is None:
        notes.fault(key.mark, "'mission' needs the name of a mission, or the path of its file")
        return None
    path = _find(notes, value)
    if path is None:
        return None
    if path not in notes.words.files:
        try:
            source = read_source(path)
            notes.words.files[path] = source, compose(source, notes.faults)
        except InvalidFileError as error:
            for fault in error.faults:
                note(notes.faults, fault)
            return None
    source, root = notes.words.files[path]
    inner = Notes(
        source,
        notes.words,
        (*notes.chain, path.resolve()),
        steps=notes.steps,
        faults=notes.faults,
        torn=notes.torn,
        depth=notes.depth,
    )
    given: dict[str, Value] = {}

    def take(inner: Notes, params: dict[str, Param], mission: str) -> None:
        given.update(_take(notes, inner, params, mission, value, beside.get("with")))

    body = read_body(inner, root, take, read_step)
    if body is None or body.tree is None:
        return None
    own = beside.get("returns")
    returns = read_returns(replace(inner, source=notes.source), own) if own is not None else body.returns
    if beside.get("as") is None:
        notes.stored |= returns.keys()
        notes.forget_kinds(returns)
    elif not returns:
        notes.fault(key.mark, f"mission '{value.text}' returns nothing that 'as' could keep")
    shown = name or body.mission
    return Step(
        MISSION,
        shown,
        key.mark,
        notes.source,
        (body.tree,),
        arguments=given,
        returns=returns,
        text=body.mission,
        written=written_entries(beside.get("with")),
    )


def _find(notes: Notes, value: Scalar) -> Path | None:
    folder = Path(notes.source.name).parent
    try:
        path = notes.words.find_mission(value.text, folder)
    except LookupError as error:
        notes.fault(value.mark, f"{error.args[0] if error.args else error}")
        return None
    if path.resolve() in notes.chain:
        way = [step.name for step in notes.chain[notes.chain.index(path.resolve()) :]]
        notes.fault(
            value.mark,
            f"a mission cannot include itself: {' -> '.join([*way, path.name])}",
            _hidden(notes, value, path),
        )
        return None
    return path


def _hidden(notes: Notes, value: Scalar, path: Path) -> str:
    """Say how to run a mission of the library whose name the file at ``path`` has; nothing where there is none."""
    with suppress(LookupError):
        notes.words.find_mission(value.text, path)  # nothing is beside in a file, which is no folder
        return f"the library has another '{value.text}': rename {path.name} to run that"
    return ""


def leads_to(notes: Notes, path: Path, files: Collection[Path]) -> bool:
    """Say whether the mission in a file is one of ``files``, or runs one of them, itself or by another."""
    found, new = set[Path](), [path]
    while new:
        path = new.pop().resolve()
        if path in files:
            return True
        if path not in found:
            found.add(path)
            with suppress(InvalidFileError):
                for name in _RUNS.findall(read_source(path).text):
                    with suppress(LookupError):
                        new.append(notes.words.find_mission(name, path.parent))
    return False


_RUNS = re.compile(r"""(?<=[ {\[,])mission:\s*['"]?([\w./-]+)""")
"""The missions that a mission runs."""


def _no_param(notes: Notes, inner: Notes, params: dict[str, Param], mission: str, name: Scalar) -> None:
    """Note a param that a sub-mission does not have; one that is wrong there has been noted."""
    if name.text not in inner.awaited:
        hint = outdent(name.text, MISSION) or one_of(name.text, params) or "it has none"
        notes.fault(name.mark, f"mission '{mission}' has no param {seen(name.text)}", hint)


def _take(
    notes: Notes, inner: Notes, params: dict[str, Param], mission: str, value: Scalar, node: Node | None
) -> dict[str, Value]:
    """Return the values of all params of a sub-mission: those given in ``with``, else the defaults."""
    values: dict[str, Value] = {}
    refused: set[str] = set()
    if node is not None and not isinstance(node, Mapping):
        notes.fault(node.mark, "'with' needs names and values", "write with: {side: 0.5 m}")
    for name, given in node.entries if isinstance(node, Mapping) else ():
        param = params.get(name.text)
        if param is None:
            _no_param(notes, inner, params, mission, name)
        else:
            before = len(notes.faults)
            values[name.text] = param.type.read(notes, given, f"'{name.text}'")
            if len(notes.faults) > before:
                refused.add(name.text)
    for param in params.values():
        unknown = param.name in refused or (param.name not in values and not param.known)
        if param.required and param.name not in values:
            notes.fault(value.mark, f"mission '{mission}' needs '{param.name}', {article(param.kind)}", param.help)
        formula = values.setdefault(param.name, Value(param.default if param.known else None)).template
        if unknown:  # said once: what comes of it is no fault of its own
            inner.stored.add(param.name)
            inner.awaited.add(param.name)
            inner.kinds[param.name] = param.type.values
            continue
        if formula is None:
            inner.params[param.name] = values[param.name].constant
            continue
        inner.stored.add(param.name)  # known only when the sub-mission starts
        if notes.awaits(formula):
            inner.awaited.add(param.name)
    return values


BESIDE = ("name", "as", "with", "returns", *COUNTS)
"""What may stand beside a behaviour without wrapping it."""

ONLY_BESIDE = {"with": MISSION, "returns": MISSION, **dict.fromkeys(COUNTS, "parallel")}
"""What stands only beside one behaviour."""

LISTED = "`mission list behaviours` lists what there is; your own go into behaviours/NAME.py beside the mission"
MISSING = "a behaviour is missing here"


def read_step(notes: Notes, node: Node) -> Step:
    """Read one node of the tree; a hole where it is too wrong to go on."""
    above = notes.depth
    notes.depth += 1 + sum(key.text in MODIFIERS for key, _ in (node.entries if isinstance(node, Mapping) else ()))
    try:
        if notes.depth > MAX_DEPTH:
            return _too_deep(notes, node)
        if isinstance(node, Mapping):
            return _with_modifiers(notes, node)
        if isinstance(node, Listing):
            notes.fault(node.mark, "a list needs a composite before it", "write 'sequence:' or 'parallel:' above it")
            return _hole(notes, node)
        if node.value is None:
            notes.fault(node.mark, MISSING)
            return _hole(notes, node)
        return _behaviour(notes, node, None, None) or _hole(notes, node)
    finally:
        notes.depth = above


def _too_deep(notes: Notes, node: Node) -> Step:
    """Note it once: each of a thousand leaves may be too deep."""
    message = f"nested too deep: at most {MAX_DEPTH} steps, modifiers and sub-missions counted"
    if all(fault.message != message for fault in notes.faults):
        notes.fault(node.mark, message, sure=True)
    notes.loose = True
    return Step(UNKNOWN, _text(node) or "...", node.mark, notes.source, leaf=Hole)


def _hole(notes: Notes, node: Node) -> Step:
    """Return what stands for a node that could not be read: it may set what anything below it would."""
    names = {*setters(node, notes.leaves)}
    words = (
        [_text(node)] if not isinstance(node, Mapping) else [*node.keys(), *(_text(each) for _, each in node.entries)]
    )
    if MISSION in words or any(_mission_of(notes, word) for word in words):
        notes.loose = True  # it may return anything
        names |= notes.stored
    return Step(UNKNOWN, _text(node) or "...", node.mark, notes.source, leaf=Hole, binds=tuple(sorted(names)))


def _with_modifiers(notes: Notes, node: Mapping) -> Step:
    behaviours = [(key, value) for key, value in node.entries if _is_behaviour(notes, key.text)]
    unknown: list[Node] = []
    for key, value in node.entries:
        if not (_is_behaviour(notes, key.text) or key.text in MODIFIERS or key.text in BESIDE):
            _unknown(notes, key, "modifier" if behaviours else "behaviour", alone=False, beside=[*node.keys()])
            _read_below(notes, value)
            unknown.append(value)
    if not behaviours and all(key.text in MODIFIERS or key.text in BESIDE for key, _ in node.entries):
        hint = "write it below the behaviour that it is for, without a dash" if node.entries else ""
        if {key.text for key, _ in node.entries} in ({"delay"}, {"hold"}):
            hint = "write 'wait' for a step that waits"
        notes.fault(node.mark, "no behaviour here, only what may stand beside one" if node.entries else MISSING, hint)
    for key, _ in behaviours[1:]:
        first = behaviours[0][0].text
        if key.text != first:  # the same word twice is a key that stands twice, which has been noted
            hint = "begin it with '- ' in a sequence, or indent it"
            notes.fault(key.mark, f"a second behaviour, '{key.text}', beside '{first}'", hint)
    step = (_behaviour(notes, *behaviours[0], node) if behaviours else None) or _hole(notes, node)
    for word, given in node.entries:
        if word.text in MODIFIERS:
            step = Step(
                word.text,
                step.name,
                word.mark,
                notes.source,
                (step,),
                arguments={"value": read_modifier(notes, word.text, given)},
                text=_text(given),
                written={"value": as_written(given)},
            )
    if unknown and step.leaf is not Hole:
        names = tuple(sorted(setters(node, notes.leaves)))
        step = Step(UNKNOWN, step.name, node.mark, notes.source, (step,), arguments={"value": UNREAD}, binds=names)
    return step


def _is_behaviour(notes: Notes, word: str) -> bool:
    return word in notes.leaves or word in BRANCHES


def _behaviour(notes: Notes, key: Scalar, value: Node | None, beside: Mapping | None) -> Step | None:
    """Read the behaviour itself, with what stands beside it."""
    if not _is_behaviour(notes, key.text):
        _unknown(notes, key, "behaviour", alone=True)
        return None
    notes.steps.append(key.mark)
    if len(notes.steps) == MAX_STEPS + 1:
        notes.fault(key.mark, f"more than {MAX_STEPS:,} steps, those of sub-missions counted each time")
    if len(notes.steps) > MAX_STEPS:
        return None
    name = _word_beside(notes, beside, "name")
    keep_as = _word_beside(notes, beside, "as")
    leaf = notes.leaves.get(key.text)
    if keep_as is not None:
        notes.new_name(keep_as, "'as'")
        if key.text != MISSION and (leaf is None or not leaf.stores):
            hint = "indent it, to stand beside the behaviour above" if key.text in COMPOSITES else ""
            notes.fault(keep_as.mark, f"'{key.text}' finds nothing out that 'as' could keep", hint)
    for word, _ in beside.entries if beside is not None else ():
        only = ONLY_BESIDE.get(word.text, key.text)
        if only != key.text:
            notes.fault(word.mark, f"'{word.text}' stands only beside '{only}', not beside '{key.text}'")
    kept = keep_as.text if keep_as is not None else None
    step = _of_kind(notes, key, value, beside or Mapping(key.mark), name.text if name is not None else None)
    return step if step is None or kept is None else replace(step, keep_as=kept)


def _of_kind(notes: Notes, key: Scalar, value: Node | None, beside: Mapping, name: str | None) -> Step | None:
    """Read what is a leaf, a sub-mission, a switch or another composite, each in its own way."""
    leaf = notes.leaves.get(key.text)
    shown = name or key.text
    if leaf is not None:
        arguments = read_arguments(notes, leaf, key, value)
        return Step(
            key.text,
            shown,
            key.mark,
            notes.source,
            leaf=_meaning(notes, leaf, arguments, key),
            arguments=arguments,
            text=_text(value),
            written=written_arguments(leaf, value),
        )
    if key.text == MISSION:
        return read_submission(notes, key, value, beside, name, read_step)
    if key.text in SWITCHES:
        return read_switch(notes, key, value, shown, read_step)
    if key.text == FOR_EACH:
        return read_for_each(notes, key, value, shown, read_step)
    children = _children(notes, key, value)
    if key.text != "parallel":
        return Step(key.text, shown, key.mark, notes.source, children)
    counts = read_counts(notes, beside, len(value.items) if isinstance(value, Listing) else 0)
    written = {word: text for word, text in written_entries(beside).items() if word in COUNTS}
    return Step(key.text, shown, key.mark, notes.source, children, arguments=counts, written=written)


def _meaning(notes: Notes, leaf: type[Leaf], values: dict[str, Value], key: Scalar) -> type[Leaf]:
    """Return the leaf, which means the parts that its arguments name, of those of which a robot may have several.

    Of several arguments of one kind the first says which it sees as its robot's only one.
    """
    of_parts = [argument for argument in leaf.arguments.values() if argument.kind in SEVERAL]
    for place, argument in enumerate(of_parts):
        beside = any(other.kind == argument.kind for other in of_parts[:place])
        value = values.get(argument.name)
        if value is not None and value.template is not None:
            told = f"'{leaf.word}': which {argument.kind} it means must be known before the mission runs"
            notes.fault(key.mark, told, f"write the name of the {argument.kind} itself")
        if value is not None and isinstance(value.constant, str):
            leaf = leaf.with_part(argument.kind, value.constant, beside=beside)
    return leaf


def _text(node: Node | None) -> str:
    return node.text if isinstance(node, Scalar) else ""


def _unknown(notes: Notes, key: Scalar, what: str, *, alone: bool, beside: Collection[str] = ()) -> None:
    """Note an unknown word, with what may have been meant."""
    modifiers, composites = (*MODIFIERS, *BESIDE), BRANCHES
    words = [*notes.leaves, *composites, *([] if alone else modifiers)]
    found = re.match(r"(\w+)[:\s]\s*(.*)", key.text)
    if " - " in key.text:
        hint = "the '- ' of a list must stand one below the other, in one column"
    elif key.text == "do" and not {"while", "until"}.isdisjoint(beside):
        hint = COMPARISON  # a loop, which neither of them is
    elif found is not None and found[1] in words:
        hint = f"write '{found[1]}: {found[2]}', with a colon and a space"
    else:
        hint = _as_mission(notes, key.text, alone=alone)
        hint = hint or word_meant(key.text, notes.leaves, composites, modifiers, alone=alone)
        skipped = getattr(notes.leaves, "skipped", ())
        hint = hint or (f"it may be defined by what could not be loaded: {', '.join(skipped)}" if skipped else LISTED)
    notes.fault(key.mark, f"unknown {what} {seen(key.text)}", hint, sure=True)


def _as_mission(notes: Notes, word: str, *, alone: bool) -> str:
    """Say how a mission is run whose name stands where a behaviour is needed; nothing where there is none.

    A word for a behaviour of ours means that, unless the mission is the user's own: its file stands beside this one.
    """
    params = "" if alone else ", and its params under 'with:' beside it"
    path = _mission_of(notes, word)
    if path is None or (path.parent != Path(notes.source.name).parent and ours_for(word, WORDS, notes.leaves)):
        return ""
    if leads_to(notes, path, notes.chain):
        return ""  # it would include itself
    return f"it is a mission: write 'mission: {word}'{params}"


def _mission_of(notes: Notes, word: str) -> Path | None:
    """Return the file of the mission that a word names; None where there is none."""
    with suppress(LookupError):
        path = notes.words.find_mission(word, Path(notes.source.name).parent) if word.isidentifier() else None
        return path if path is not None and "missions" in kinds_of(path) else None
    return None


def _read_below(notes: Notes, node: Node) -> None:
    """Read what stands below an unknown word for its own mistakes, where it looks like the children of a composite."""
    for item in node.items if isinstance(node, Listing) else ():
        if isinstance(item, Mapping):
            read_step(notes, item)


def _children(notes: Notes, key: Scalar, value: Node | None) -> tuple[Step, ...]:
    if not isinstance(value, Listing) or not value.items:
        notes.fault(key.mark, f"'{key.text}' needs a list of at least one behaviour, each on a line with '- '")
        return (_hole(notes, key if value is None else value),)
    return tuple(read_step(notes, item) for item in value.items)


def _word_beside(notes: Notes, beside: Mapping | None, key: str) -> Scalar | None:
    node = beside.get(key) if beside is not None else None
    if node is None or (isinstance(node, Scalar) and node.value is not None and node.text.strip()):
        return node
    notes.fault(node.mark, f"'{key}' needs a {'word' if key == 'as' else 'text'}")
    return None
