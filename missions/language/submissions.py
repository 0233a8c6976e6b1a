"""A mission inside a mission: found, read with the params that it is given, and its results handed back."""

import re
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from config.faults import InvalidFileError, note, one_of
from config.marked import Mapping, Node, Scalar, compose, read_source
from config.units import article, seen
from missions.language.body import read_body, read_returns
from missions.language.modifiers import outdent
from missions.language.nodes import MISSION
from missions.language.notes import Notes
from missions.language.params import Param
from missions.language.plan import Step
from missions.language.values import Value
from missions.language.written import written_entries

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
