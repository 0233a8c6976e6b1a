"""Steps from YAML nodes: a word, a key with a value, a mapping or a list, and the modifiers beside it."""

import re
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from behaviours.basics import WaitUntil
from behaviours.leaf import Leaf
from config.diagnostics import InvalidFileError, add_diagnostic, own_words_for, suggest_from
from config.library import kinds_of
from config.units import quantity_text, quoted_value, with_article
from config.yaml_nodes import Listing, Mapping, Node, Scalar, compose, read_source
from drivers.api.kinds import REPEATABLE_KINDS
from missions.language.arguments import read_arguments
from missions.language.check_context import MAX_DEPTH, MAX_STEPS, CheckContext
from missions.language.child_order import read_order
from missions.language.expressions import INVALID_VALUE, ExpressionError, Value, in_si, parse
from missions.language.for_each import read_for_each
from missions.language.kinds import STATE_KINDS
from missions.language.mission_body import FIRST_KEYS_HINT, read_body, read_returns
from missions.language.modifiers import outdent_hint, read_halt_limit, read_modifier
from missions.language.nodes import (
    BRANCHES,
    COMPOSITES,
    FINALLY,
    FOR_EACH,
    HALT_LIMIT,
    MISSION,
    MODIFIER_KEYS,
    MODIFIERS,
    ORDER_KEYS,
    RECOVER,
    RETRY,
    SWITCHES,
    WAIT_FOR,
    provides_failure,
)
from missions.language.parallel_counts import COUNTS, arguments_as_written, entries_as_written, read_counts, source_text
from missions.language.param_types import Param, find_setters
from missions.language.plan import UNREAD_KIND, PlaceholderLeaf, Step
from missions.language.switches import read_switch
from missions.language.synonyms import SYNONYMS, UNMATCHED_HINT, explained_hint, unknown_word_hint

# Sub-missions: finds the file, reads it with its params, and passes on its results.

ReadStep = Callable[[CheckContext, Node], Step]


def read_submission(
    context: CheckContext, key: Scalar, value: Node | None, beside: Mapping, name: str | None, read_step: ReadStep
) -> Step | None:
    """Return the step of ``mission: NAME`` with the ``with`` and ``returns`` beside it; None if it has errors."""
    if not isinstance(value, Scalar) or value.value is None:
        context.fault(key.mark, "'mission' needs the name of a mission, or the path of its file")
        return None
    path = _find_submission(context, value)
    if path is None:
        return None
    if path not in context.vocabulary.files:
        try:
            source = read_source(path)
            context.vocabulary.files[path] = source, compose(source, context.faults, empty_hint=FIRST_KEYS_HINT)
        except InvalidFileError as error:
            for fault in error.diagnostics:
                add_diagnostic(context.faults, fault)
            return None
    source, root = context.vocabulary.files[path]
    inner = CheckContext(
        source,
        context.vocabulary,
        (*context.file_chain, path.resolve()),
        steps=context.steps,
        faults=context.faults,
        has_unreadable_line=context.has_unreadable_line,
        depth=context.depth,
    )
    arguments: dict[str, Value] = {}

    def take(inner: CheckContext, params: dict[str, Param], mission: str) -> None:
        arguments.update(_read_submission_params(context, inner, params, mission, value, beside.get("with")))

    body = read_body(inner, root, take, read_step)
    if body is None or body.tree is None:
        return None
    # Params with errors, which have been reported: their readers have none.
    arguments |= dict.fromkeys(inner.missing_params - arguments.keys(), INVALID_VALUE)
    own_returns = beside.get("returns")
    reader = replace(inner, source=context.source, read_names=set())
    returns = body.returns if own_returns is None else read_returns(reader, own_returns)
    inner.read_names |= reader.read_names
    if beside.get("as") is None:
        context.variables |= returns.keys()
        context.forget_kinds(returns)
    elif not returns:
        context.fault(key.mark, f"mission '{value.text}' returns nothing that 'as' could store")
    shown = name or body.mission
    return Step(
        MISSION,
        shown,
        key.mark,
        context.source,
        (body.tree,),
        arguments=arguments,
        returns=returns,
        hidden_results=_hidden_results(root, reader.read_names & (arguments.keys() | body.tree.variables)),
        text=body.mission,
        arguments_as_written=entries_as_written(beside.get("with")),
    )


def _hidden_results(root: Node, names: Collection[str]) -> tuple[str, ...]:
    """Return those of ``names``, variables of a mission, that its file also declares as results of another value."""
    declared = root.get("returns") if isinstance(root, Mapping) else None
    entries = declared.entries if isinstance(declared, Mapping) else []
    return tuple(name.text for name, value in entries if name.text in names and source_text(value) != name.text)


def _find_submission(context: CheckContext, value: Scalar) -> Path | None:
    folder = Path(context.source.name).parent
    try:
        path = context.vocabulary.find_mission(value.text, folder)
    except LookupError as error:
        context.fault(value.mark, f"{error.args[0] if error.args else error}")
        return None
    if path.resolve() in context.file_chain:
        way = [step.name for step in context.file_chain[context.file_chain.index(path.resolve()) :]]
        context.fault(
            value.mark,
            f"a mission cannot include itself: {' -> '.join([*way, path.name])}",
            _library_hint(context, value, path),
        )
        return None
    return path


def _library_hint(context: CheckContext, value: Scalar, path: Path) -> str:
    """Return the hint how to run the library's mission of the same name; empty if there is none."""
    with suppress(LookupError):
        context.vocabulary.find_mission(value.text, path)  # a file has no other files beside it
        return f"the library has another '{value.text}': rename {path.name} to run that"
    return ""


def includes_mission(context: CheckContext, path: Path, files: Collection[Path]) -> bool:
    """Return whether the mission in a file is one of ``files``, or runs one of them, directly or indirectly."""
    found, new = set[Path](), [path]
    while new:
        path = new.pop().resolve()
        if path in files:
            return True
        if path not in found:
            found.add(path)
            with suppress(InvalidFileError):
                for name in _SUBMISSION_PATTERN.findall(read_source(path).text):
                    with suppress(LookupError):
                        new.append(context.vocabulary.find_mission(name, path.parent))
    return False


_SUBMISSION_PATTERN = re.compile(r"""(?<=[ {\[,])mission:\s*['"]?([\w./-]+)""")
"""Pattern that finds the names of sub-missions in the text of a mission."""


def _report_unknown_param(
    context: CheckContext, inner_context: CheckContext, params: dict[str, Param], mission: str, name: Scalar
) -> None:
    """Report that the sub-mission ``mission`` has no param ``name``.

    Not reported if the sub-mission declares the param with an error, since that is reported there.
    """
    if name.text not in inner_context.missing_params:
        hint = outdent_hint(name.text, MISSION) or suggest_from(name.text, params) or "it has none"
        context.fault(name.mark, f"mission '{mission}' has no param {quoted_value(name.text)}", hint)


def _read_submission_params(
    context: CheckContext,
    inner_context: CheckContext,
    params: dict[str, Param],
    mission: str,
    value: Scalar,
    node: Node | None,
) -> dict[str, Value]:
    """Return the values of all params of a sub-mission: from ``with``, or the defaults."""
    values: dict[str, Value] = {}
    refused: set[str] = set()
    if node is not None and not isinstance(node, Mapping):
        context.fault(node.mark, "'with' needs names and values", "write with: {side: 0.5 m}")
    for name, value_node in node.entries if isinstance(node, Mapping) else ():
        param = params.get(name.text)
        if param is None:
            _report_unknown_param(context, inner_context, params, mission, name)
        else:
            before = len(context.faults)
            inner_context.param_places[name.text] = context.source, value_node.mark
            values[name.text] = param.type.read_value(context, value_node, f"'{name.text}'")
            if len(context.faults) > before:
                refused.add(name.text)
    for param in params.values():
        unknown = param.name in refused or (param.name not in values and not param.has_value)
        if param.required and param.name not in values:
            context.fault(
                value.mark, f"mission '{mission}' needs '{param.name}', {with_article(param.kind)}", param.help
            )
        formula = values.setdefault(param.name, Value(param.default if param.has_value else None)).template
        if unknown:  # reported already; errors that follow from it are suppressed
            inner_context.variables.add(param.name)
            inner_context.missing_params.add(param.name)
            inner_context.param_kinds[param.name] = param.type.value_kind
            continue
        if formula is None:
            inner_context.params[param.name] = values[param.name].constant
            continue
        inner_context.variables.add(param.name)  # its value is known only when the sub-mission starts
        places = inner_context.param_places
        _, places[param.name] = context.late_place(formula) or ("", places[param.name])
        if context.awaits_params(formula):
            inner_context.missing_params.add(param.name)
    return values


STEP_KEY_HELP = {
    "name": "what people see in pictures of the tree",
    "as": "the variable that keeps what this behaviour has found",
    "with": "the values of the params of the mission that is run",
    "returns": "what the mission that is run hands back: a variable and an expression",
}
"""Help of the keys that name a step, and connect it with variables and another mission."""

BESIDE_KEYS = (*STEP_KEY_HELP, *COUNTS, *MODIFIER_KEYS, *ORDER_KEYS)
"""Keys that can stand beside a behaviour and are not modifiers."""

OWNER_OF_KEY = {
    "with": MISSION,
    "returns": MISSION,
    **dict.fromkeys(COUNTS, "parallel"),
    **{word: owner for word, (owner, _, _) in ORDER_KEYS.items()},
}
"""Keys that can stand beside one kind of behaviour only, each with the word of that behaviour."""

LIST_HINT = "`mission list behaviours` lists all; put your own into behaviours/NAME.py beside the mission"
MISSING_MESSAGE = "a behaviour is missing here"


def read_step(context: CheckContext, node: Node) -> Step:
    """Return the step of one YAML node of the tree; a placeholder if the node has errors."""
    above = context.depth
    context.depth += 1 + sum(key.text in MODIFIERS for key, _ in (node.entries if isinstance(node, Mapping) else ()))
    try:
        if context.depth > MAX_DEPTH:
            return _report_too_deep(context, node)
        if isinstance(node, Mapping):
            return _read_with_modifiers(context, node)
        if isinstance(node, Listing):
            context.fault(node.mark, "a list needs a composite before it", "write 'sequence:' or 'parallel:' above it")
            return _placeholder(context, node)
        if node.value is None:
            context.fault(node.mark, MISSING_MESSAGE)
            return _placeholder(context, node)
        return _read_behaviour(context, node, None, None) or _placeholder(context, node)
    finally:
        context.depth = above


def _report_too_deep(context: CheckContext, node: Node) -> Step:
    """Report that the tree is too deep, once for the whole mission; return a placeholder for ``node``."""
    message = f"nested too deeply: at most {MAX_DEPTH} steps, modifiers and sub-missions counted"
    if all(fault.message != message for fault in context.faults):
        context.fault(node.mark, message, certain=True)
    context.has_unreadable_mission = True
    return Step(UNREAD_KIND, _text(node) or "...", node.mark, context.source, leaf=PlaceholderLeaf)


def _placeholder(context: CheckContext, node: Node) -> Step:
    """Return a placeholder for a node with errors, with the variables that may be set below it."""
    names = {*find_setters(node, context.leaves)}
    words = (
        [_text(node)] if not isinstance(node, Mapping) else [*node.keys(), *(_text(each) for _, each in node.entries)]
    )
    if MISSION in words or any(_find_mission_of(context, word) for word in words):
        context.has_unreadable_mission = True  # its return values are unknown
        names |= context.variables
    return Step(
        UNREAD_KIND, _text(node) or "...", node.mark, context.source, leaf=PlaceholderLeaf, binds=tuple(sorted(names))
    )


def _read_with_modifiers(context: CheckContext, node: Mapping) -> Step:
    behaviours = [(key, value) for key, value in node.entries if _is_behaviour(context, key.text)]
    unknown: list[Node] = []
    for key, value in node.entries:
        if not (_is_behaviour(context, key.text) or key.text in MODIFIERS or key.text in BESIDE_KEYS):
            _report_unknown_word(
                context, key, "modifier" if behaviours else "behaviour", alone=False, beside=[*node.keys()]
            )
            _read_below(context, value)
            unknown.append(value)
    if not behaviours and all(key.text in MODIFIERS or key.text in BESIDE_KEYS for key, _ in node.entries):
        hint = "write it below the behaviour that it is for, without a dash" if node.entries else ""
        if {key.text for key, _ in node.entries} in ({"delay"}, {"hold"}):
            hint = "write 'wait' for a step that waits"
        context.fault(
            node.mark, "no behaviour here, only keys that stand beside one" if node.entries else MISSING_MESSAGE, hint
        )
    for key, _ in behaviours[1:]:
        first = behaviours[0][0].text
        if key.text != first:  # a repeated key has been reported already
            hint = "begin it with '- ' in a sequence, or indent it"
            context.fault(key.mark, f"a second behaviour, '{key.text}', beside '{first}'", hint)
    step = (_read_behaviour(context, *behaviours[0], node) if behaviours else None) or _placeholder(context, node)
    step = _read_modifiers(context, node, step)
    if unknown and step.leaf is not PlaceholderLeaf:
        names = tuple(sorted(find_setters(node, context.leaves)))
        step = Step(
            UNREAD_KIND, step.name, node.mark, context.source, (step,), arguments={"value": INVALID_VALUE}, binds=names
        )
    return step


def _read_modifiers(context: CheckContext, node: Mapping, step: Step) -> Step:
    """Return ``step`` in the modifiers beside it: each wraps the ones above it."""
    for word, value in node.entries:
        owner = MODIFIER_KEYS[word.text][0] if word.text in MODIFIER_KEYS else ""
        if owner and node.get(owner) is None:
            context.fault(word.mark, f"'{word.text}' stands only beside '{owner}'", _OWNER_HINTS[owner])
        elif word.text == FINALLY:
            step = _read_finally(context, word, value, node.get(HALT_LIMIT), step)
        elif word.text in MODIFIERS:
            recovery = node.get(RECOVER) if word.text == RETRY else None
            step = Step(
                word.text,
                step.name,
                word.mark,
                context.source,
                (step,) if recovery is None else (step, _read_member(context, recovery, RECOVER)),
                arguments={"value": read_modifier(context, word.text, value)},
                text=_text(value),
                arguments_as_written={"value": source_text(value)},
            )
    return step


_OWNER_HINTS = {RETRY: "add 'retry: 3' for the number of attempts", FINALLY: "add 'finally' with a behaviour"}
"""Hints, by modifier, for a key that stands without this modifier, such as ``recover`` without ``retry``."""


def _read_member(context: CheckContext, node: Node, word: str) -> Step:
    """Return the step of the behaviour after ``recover`` or ``finally``; it may read why the node before it failed."""
    if isinstance(node, Scalar) and node.value is None:
        context.fault(node.mark, f"'{word}' needs a behaviour", f"write {word}: {{say: ...}}")
        return _placeholder(context, node)
    with context.failure_readable(True):
        return read_step(context, node)


def _read_finally(context: CheckContext, word: Scalar, value: Node, limit: Node | None, step: Step) -> Step:
    """Return the step of a ``finally`` around ``step``; ``limit`` is the node of its ``halt_limit``."""
    found = Value(Leaf.halt_limit) if limit is None else read_halt_limit(context, limit)
    children = (step, _read_member(context, value, FINALLY))
    text = f"at most {quantity_text(Leaf.halt_limit, 'duration') if limit is None else source_text(limit)}"
    return Step(FINALLY, step.name, word.mark, context.source, children, arguments={"value": found}, text=text)


def _is_behaviour(context: CheckContext, word: str) -> bool:
    return word in context.leaves or word in BRANCHES


def _read_behaviour(context: CheckContext, key: Scalar, value: Node | None, beside: Mapping | None) -> Step | None:
    """Return the step of the behaviour ``key: value`` with the keys ``beside`` it; None if it has errors."""
    if not _is_behaviour(context, key.text):
        _report_unknown_word(context, key, "behaviour", alone=True)
        return None
    context.steps.append(key.mark)
    if len(context.steps) == MAX_STEPS + 1:
        context.fault(key.mark, f"more than {MAX_STEPS:,} steps, those of sub-missions counted each time")
    if len(context.steps) > MAX_STEPS:
        return None
    name = _read_word_beside(context, beside, "name")
    keep_as = _read_word_beside(context, beside, "as")
    leaf = context.leaves.get(key.text)
    if keep_as is not None:
        context.check_new_name(keep_as, "'as'")
        if key.text != MISSION and (leaf is None or not leaf.output_doc):
            hint = "indent it, to stand beside the behaviour above" if key.text in COMPOSITES else ""
            if key.text == WAIT_FOR:
                hint = f"put 'as' inside, such as {WAIT_FOR}: {{face_seen: , as: {keep_as.text}}}"
            context.fault(keep_as.mark, f"'{key.text}' has no result that 'as' could store", hint)
    for word, _ in beside.entries if beside is not None else ():
        only = OWNER_OF_KEY.get(word.text, key.text)
        if only != key.text:
            context.fault(word.mark, f"'{word.text}' stands only beside '{only}', not beside '{key.text}'")
    variable = keep_as.text if keep_as is not None else None
    step = _read_by_kind(context, key, value, beside or Mapping(key.mark), name.text if name is not None else None)
    return step if step is None or variable is None else replace(step, output_variable=variable)


def _read_by_kind(
    context: CheckContext, key: Scalar, value: Node | None, beside: Mapping, name: str | None
) -> Step | None:
    """Return the step of a leaf, a sub-mission, a switch or another composite; None if it has errors."""
    leaf = context.leaves.get(key.text)
    shown = name or key.text
    if leaf is not None:
        arguments = read_arguments(context, leaf, key, value)
        return Step(
            key.text,
            shown,
            key.mark,
            context.source,
            leaf=_with_named_parts(context, leaf, arguments, key),
            arguments=arguments,
            text=_text(value),
            arguments_as_written=arguments_as_written(leaf, value),
        )
    if key.text == MISSION:
        return read_submission(context, key, value, beside, name, read_step)
    if key.text in SWITCHES:
        return read_switch(context, key, value, shown, read_step)
    if key.text == FOR_EACH:
        return read_for_each(context, key, value, shown, read_step)
    if key.text == WAIT_FOR:
        return _read_wait_for(context, key, value, shown)
    children = _read_children(context, key, value)
    count = len(value.items) if isinstance(value, Listing) else 0
    settings = (read_counts if key.text == "parallel" else read_order)(context, beside, count)
    written = {word: text for word, text in entries_as_written(beside).items() if word in settings}
    return Step(key.text, shown, key.mark, context.source, children, arguments=settings, arguments_as_written=written)


def _read_wait_for(context: CheckContext, key: Scalar, value: Node | None, shown: str) -> Step | None:
    """Return the step of a ``wait_for``; None without a behaviour to wait for."""
    if value is None or (isinstance(value, Scalar) and value.value is None):
        context.fault(
            key.mark, f"'{WAIT_FOR}' needs a behaviour to tick until it succeeds", f"write {WAIT_FOR}: face_seen"
        )
        return None
    if isinstance(value, Scalar) and (hint := _wait_hint(context, value.text)):
        context.fault(value.mark, f"'{WAIT_FOR}' needs a behaviour, got {quoted_value(value.text)}", hint)
        return None
    child = read_step(context, value)
    return Step(WAIT_FOR, shown, key.mark, context.source, (child,))


def _wait_hint(context: CheckContext, text: str) -> str:
    """Return the hint for a duration or an expression after ``wait_for``; empty if it is neither."""
    if _is_behaviour(context, text):
        return ""
    with suppress(ValueError):
        in_si(text, "duration")
        return f"write wait: {text}"
    with suppress(ExpressionError):
        names = {read.name for read in parse(text).reads}
        if names & {*STATE_KINDS, *context.params, *context.variables}:
            return f"write {WaitUntil.tag}: {text}"
    return ""


def _with_named_parts(context: CheckContext, leaf: type[Leaf], values: dict[str, Value], key: Scalar) -> type[Leaf]:
    """Return the leaf class bound to the parts that its arguments ``values`` name, such as ``arm: right_arm``.

    The leaf then uses ``right_arm`` as if it were the robot's only arm. If a second argument names another part of the
    same kind, the leaf gets that as an additional part.
    """
    of_parts = [argument for argument in leaf.arguments.values() if argument.kind in REPEATABLE_KINDS]
    for place, argument in enumerate(of_parts):
        has_other = any(other.kind == argument.kind for other in of_parts[:place])
        value = values.get(argument.name)
        if value is not None and value.template is not None:
            message = f"'{leaf.tag}': which {argument.kind} it means must be known before the mission runs"
            context.fault(key.mark, message, f"write the name of the {argument.kind} itself")
        if value is not None and isinstance(value.constant, str):
            leaf = leaf.with_part(argument.kind, value.constant, additional=has_other)
    return leaf


def _text(node: Node | None) -> str:
    return node.text if isinstance(node, Scalar) else ""


def _report_unknown_word(
    context: CheckContext, key: Scalar, label: str, *, alone: bool, beside: Collection[str] = ()
) -> None:
    modifiers, composites = (*MODIFIERS, *BESIDE_KEYS), BRANCHES
    words = [*context.leaves, *composites, *([] if alone else modifiers)]
    found = re.match(r"(\w+)[:\s]\s*(.*)", key.text)
    if key.text.startswith("-") and key.text[1:] in words:
        hint = f"write '- {key.text[1:]}', with a space after the dash"
    elif " - " in key.text:
        hint = "align each '- ' of a list in one column"
    elif key.text == "do" and not {"while", "until"}.isdisjoint(beside):
        hint = UNMATCHED_HINT  # the user means a loop; neither word is one
    elif found is not None and found[1] in words and not explained_hint(key.text):
        hint = f"write '{found[1]}: {found[2]}', with a colon and a space"
    else:
        hint = _mission_hint(context, key.text, alone=alone)
        hint = hint or unknown_word_hint(key.text, context.leaves, composites, modifiers, alone=alone)
        skipped = getattr(context.leaves, "skipped", ())
        hint = hint or (
            f"it may be defined in a file that could not be loaded: {', '.join(skipped)}" if skipped else LIST_HINT
        )
    context.fault(key.mark, f"unknown {label} {quoted_value(key.text)}", hint, certain=True)


def _mission_hint(context: CheckContext, word: str, *, alone: bool) -> str:
    """Return the hint for a mission name in place of a behaviour; empty if there is no such mission.

    A word that means one of our behaviours is not taken for a mission, unless the mission is in the same folder.
    """
    params = "" if alone else ", and its params under 'with:' beside it"
    path = _find_mission_of(context, word)
    if path is None or (
        path.parent != Path(context.source.name).parent and own_words_for(word, SYNONYMS, context.leaves)
    ):
        return ""
    if includes_mission(context, path, context.file_chain):
        return ""  # it would include itself
    return f"it is a mission: write 'mission: {word}'{params}"


def _find_mission_of(context: CheckContext, word: str) -> Path | None:
    """Return the file of the mission called ``word``; None if there is none."""
    with suppress(LookupError):
        path = context.vocabulary.find_mission(word, Path(context.source.name).parent) if word.isidentifier() else None
        return path if path is not None and "missions" in kinds_of(path) else None
    return None


def _read_below(context: CheckContext, node: Node) -> None:
    """Read the nodes in a list below an unknown word, to report their errors too."""
    for item in node.items if isinstance(node, Listing) else ():
        if isinstance(item, Mapping):
            read_step(context, item)


def _read_children(context: CheckContext, key: Scalar, value: Node | None) -> tuple[Step, ...]:
    if not isinstance(value, Listing) or not value.items:
        context.fault(key.mark, f"'{key.text}' needs a list of at least one behaviour, each on a line with '- '")
        return (_placeholder(context, key if value is None else value),)
    steps = []
    for place, item in enumerate(value.items):
        with context.failure_readable(context.is_failure_readable or provides_failure(key.text, place)):
            steps.append(read_step(context, item))
    return tuple(steps)


def _read_word_beside(context: CheckContext, beside: Mapping | None, key: str) -> Scalar | None:
    node = beside.get(key) if beside is not None else None
    if node is None or (isinstance(node, Scalar) and node.value is not None and node.text.strip()):
        return node
    context.fault(node.mark, f"'{key}' needs a {'word' if key == 'as' else 'text'}")
    return None
