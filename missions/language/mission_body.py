"""Parses the keys of a mission file or a sub-mission: header, params, tree, returns, properties.

``properties`` are claims about the mission, which ``mission verify`` proves or refutes.
"""

import re
from collections.abc import Callable, Iterator

from config.diagnostics import Mark, own_words_for, suggest_from, suggest_key
from config.units import quoted_value
from config.yaml_nodes import Listing, Mapping, Node, Scalar
from drivers.api.fast_dataclass import dataclass
from missions.language.check_context import CheckContext
from missions.language.expressions import Value
from missions.language.modifiers import read_expression
from missions.language.nodes import MISSION
from missions.language.param_types import Param, find_setters, read_params, single_kind_leaves
from missions.language.plan import MissionProperty, PlaceholderLeaf, Step
from missions.language.split_values import join_split_values
from missions.language.synonyms import SYNONYMS, explained_hint

PROPERTIES = {
    "never": (
        "a claim that something never happens: one thing while, before, after or without another",
        r" (while|before|after|without) ",
    ),
    "always eventually": ("a claim that something stays reachable from every state of a run", r"\S"),
    "can": ("a claim that an end is possible: succeed or fail", r"^(succeed|fail)$"),
}
"""Keywords of properties, each with its meaning and a pattern that the text after it must contain."""

PROPERTY_FORMS = (
    "never: gesture while drive",
    "never: gesture before find_face",
    "never: drive after say",
    "never: say without gesture",
    "always eventually: base stopped",
    "always eventually: say",
    "can: succeed",
)
"""An example of each form of a property."""

RELATIONS = ("while", "before", "after", "without")
PROPERTY_ENDS = ("succeed", "fail")
_HINT = f"such as '{PROPERTY_FORMS[0]}' or '{PROPERTY_FORMS[4]}'"


def read_properties(context: CheckContext, node: Node | None, tree: Step | None) -> tuple[MissionProperty, ...]:
    """Return the properties in a list; report names that are not steps of ``tree`` or actuators that it drives."""
    if node is None or tree is None:  # without a tree, properties have no steps to refer to
        return ()
    if not isinstance(node, Listing) or not node.items:
        context.fault(node.mark, "'properties' needs a list, each on a line with '- '", _HINT)
        return ()
    if any(step.leaf is PlaceholderLeaf for step in tree.walk()):  # an unread node may have the name
        return ()
    names = property_names(tree)
    return tuple(found for item in node.items for found in _read_property(context, item, names, tree.claims))


def property_names(tree: Step) -> set[str]:
    """Return the names that a property can use: leaves, sub-missions, and nodes with a ``name``."""
    return {
        word
        for step in tree.walk()
        for word in (
            step.word if step.leaf is not None or step.kind == MISSION else "",
            step.name if step.name != step.kind else "",
        )
        if word
    }


def _read_property(
    context: CheckContext, node: Node, names: set[str], parts: frozenset[str]
) -> Iterator[MissionProperty]:
    """Yield the property in a YAML node, unless it has errors, which are reported.

    ``names`` are the names that it can use, ``parts`` the actuators.
    """
    if not isinstance(node, Mapping) or len(node.entries) != 1:
        context.fault(node.mark, f"a property needs one of {', '.join(PROPERTIES)}", _HINT)
        return
    ((key, value),) = node.entries
    if key.text not in PROPERTIES:
        context.fault(key.mark, f"unknown property {quoted_value(key.text)}", suggest_from(key.text, PROPERTIES))
    elif not isinstance(value, Scalar) or not value.text.strip():
        context.fault(value.mark, f"'{key.text}' needs a text", _HINT)
    else:
        found = _READERS[key.text](context, value, names, parts)
        if found is not None:
            form, subject, other = found
            yield MissionProperty(form, subject, other, f"{key.text}: {value.text.strip()}", key.mark)


ParsedProperty = tuple[str, str, str] | None


def _never(context: CheckContext, value: Scalar, names: set[str], parts: frozenset[str]) -> ParsedProperty:
    splits = [
        (relation, value.text[: match.start()].strip(), value.text[match.end() :].strip())
        for relation in RELATIONS
        for match in re.finditer(rf"\s{relation}\s", value.text)
    ]
    if not splits:
        words = ", ".join(f"'{relation}'" for relation in RELATIONS)
        context.fault(value.mark, f"'never' needs one of {words} between two names", _HINT)
        return None
    known = names | parts
    # A name may contain one of the words itself ("wait while he goes"): choose the split with known names.
    relation, subject, other = next((s for s in splits if s[1] in known and s[2] in known), splits[0])
    may_be_other = names if relation in ("before", "after") else known  # actuators do not succeed
    good = _check_known_name(context, value, subject, known) & _check_known_name(context, value, other, may_be_other)
    return (relation, subject, other) if good else None


def _eventually(context: CheckContext, value: Scalar, names: set[str], parts: frozenset[str]) -> ParsedProperty:
    text = value.text.strip()
    subject, _, last = text.rpartition(" ")
    if last == "stopped" and text not in names:
        return ("stopped", subject, "") if _check_known_name(context, value, subject.strip(), names | parts) else None
    return ("eventually", text, "") if _check_known_name(context, value, text, names | parts) else None


def _can(context: CheckContext, value: Scalar, names: set[str], parts: frozenset[str]) -> ParsedProperty:
    del names, parts
    text = value.text.strip()
    if text not in PROPERTY_ENDS:
        context.fault(
            value.mark, f"'can' takes succeed or fail, got {quoted_value(text)}", suggest_from(text, PROPERTY_ENDS)
        )
        return None
    return "can", text, ""


def _check_known_name(context: CheckContext, value: Scalar, name: str, known: set[str] | frozenset[str]) -> bool:
    """Report an error if ``name`` is not in ``known``, at its place in the text of ``value``; return False then."""
    if name in known:
        return True
    at = max(0, value.text.rfind(name) if value.text.rstrip().endswith(name) else value.text.find(name))
    mark = Mark(value.mark.line, value.mark.column + value.quoted + at, max(1, len(name)))
    context.fault(mark, f"no behaviour of this mission is called {quoted_value(name)}", suggest_from(name, known))
    return False


_READERS = {"never": _never, "always eventually": _eventually, "can": _can}


MISSION_KEYS = ("mission", "summary", "params", "if_interrupted", "tree", "returns", "properties")

IF_INTERRUPTED = ("retry", "give_up")
"""Values of the key ``if_interrupted``: what to do with a task whose run was interrupted at an unknown point."""


@dataclass(frozen=True, slots=True)
class MissionBody:
    """Contents of a mission file. ``returns`` are its results by name.

    ``if_interrupted`` is one of ``IF_INTERRUPTED``, or empty if not set.
    """

    mission: str
    summary: str
    tree: Step | None
    returns: dict[str, Value]
    properties: tuple[MissionProperty, ...] = ()
    if_interrupted: str = ""


FIRST_KEYS_HINT = "write 'mission: NAME', then 'tree:'"
"""Hint for a file without the keys of a mission."""

AssignParams = Callable[[CheckContext, dict[str, Param], str], None]
"""Function that sets the params of a mission, given the context, the declared params and the mission's name.

It stores known values in ``params`` of the context, names without a value in ``variables``.
"""


def read_body(
    context: CheckContext, root: Node, assign_params: AssignParams, read_step: Callable[[CheckContext, Node], Step]
) -> MissionBody | None:
    """Return the contents of a mission file; None if it is not a mapping."""
    if not isinstance(root, Mapping):
        context.fault(root.mark, "a mission begins with keys", FIRST_KEYS_HINT)
        return None
    context.has_unreadable_line = context.has_unreadable_line or root.torn
    if _SPLIT_VALUE.search(context.source.text):
        root = _with_joined_values(context, root)
    for key, _ in root.entries:
        if key.text not in MISSION_KEYS:
            hint = explained_hint(key.text) or suggest_key(key.text, MISSION_KEYS, SYNONYMS)
            context.fault(key.mark, f"a mission has no key '{key.text}'", hint)
    mission, summary = _header(context, root, "mission", required=True), _header(context, root, "summary")
    assign_params(context, read_params(context, root.get("params")), mission)
    node = root.get("tree")
    if node is None:
        if not _has_misspelt_key(root, "tree"):
            context.fault(root.mark, "the mission needs 'tree:' with its first behaviour under it")
        return MissionBody(mission, summary, None, {})
    found = find_setters(node, context.leaves)
    available = context.params.keys() | context.variables
    context.variable_leaves |= {name: leaf for name, leaf in single_kind_leaves(found).items() if name not in available}
    context.variables |= found.keys()
    context.param_places = {name: place for name, place in context.param_places.items() if name not in found}
    tree = read_step(context, node)
    properties = read_properties(context, root.get("properties"), tree)
    returns = read_returns(context, root.get("returns"))
    return MissionBody(mission, summary, tree, returns, properties, _if_interrupted(context, root))


_SPLIT_VALUE = re.compile(r"^[^{\[\n]*[{\[].*(?:\([^()]*,|, *[^\s:,{}\[\]]+ [^:,{}\[\]]*[,}])", re.MULTILINE)
"""Pattern of a text in flow style with a comma in brackets or words: the files in which a value may be split.

It begins with the line, so that a line of many brackets is searched once, and not from each of them.
"""


def _with_joined_values(context: CheckContext, root: Mapping) -> Mapping:
    """Report each value that YAML has split at a comma, and return the mission with its parts joined."""
    joined = join_split_values(root, context.fault)
    return joined if isinstance(joined, Mapping) else root


def _header(context: CheckContext, root: Mapping, key: str, *, required: bool = False) -> str:
    node = root.get(key)
    if node is None:
        if required and not _has_misspelt_key(root, key):
            context.fault(root.mark, f"the mission needs '{key}: ...'")
        return ""
    if not isinstance(node, Scalar) or node.value is None or not node.text.strip():
        context.fault(node.mark, f"'{key}' needs a text")
        return ""
    return node.text


def _has_misspelt_key(root: Mapping, key: str) -> bool:
    """Return True if the mission file has a key of another system that means ``key``; an error was reported for it."""
    return any(word not in MISSION_KEYS and own_words_for(word, SYNONYMS, (key,)) for word in root.keys())  # noqa: SIM118 - no dict


def _if_interrupted(context: CheckContext, root: Mapping) -> str:
    node = root.get("if_interrupted")
    if node is None:
        return ""
    text = node.text if isinstance(node, Scalar) else ""
    if text not in IF_INTERRUPTED:
        context.fault(node.mark, f"'if_interrupted' cannot be {quoted_value(text)}", suggest_from(text, IF_INTERRUPTED))
    return text


def read_returns(context: CheckContext, node: Node | None) -> dict[str, Value]:
    """Return the results in ``returns: {name: expression}`` by name; expressions use the variables of ``context``."""
    if node is None:
        return {}
    if not isinstance(node, Mapping):
        context.fault(node.mark, "'returns' needs names and expressions", "write returns: {found: person}")
        return {}
    found = {}
    for key, value in node.entries:
        context.check_new_name(key, "a result")
        if isinstance(value, Scalar):
            found[key.text] = read_expression(context, f"result '{key.text}'", value, lambda result: result)
        else:
            context.fault(value.mark, f"result '{key.text}' needs an expression")
    return found
