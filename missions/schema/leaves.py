"""Leaves in the schema: what stands behind each one's word, and its help.

The two forms, a value and a mapping of named arguments, are told apart by ``if`` and not by ``anyOf``: so an editor
reports a mistake for the form that was written.
"""

from behaviours.leaf import Argument, Leaf
from missions.library.catalogue import details, example, summary, terms
from missions.schema.values import NAME, Schema, Things, described, named, written


def leaf_value(leaf: type[Leaf], things: Things) -> Schema:
    """Return what may stand behind a leaf's word: nothing, its principal argument, or a mapping of named ones."""
    found: Schema = {
        "description": summary(leaf),
        "markdownDescription": explained(leaf),
        "if": {"type": "object"},
        "then": _named_arguments(leaf, things),
        "else": _alone(leaf, things),
    }
    snippets = _values(leaf, things)
    return {**found, "defaultSnippets": snippets} if snippets else found


def explained(leaf: type[Leaf]) -> str:
    """Return a leaf's entry in the catalogue, as Markdown for an editor."""
    lines = [
        f"`{each.name}`: {each.help}\n  ({terms(each)}{'; may stand alone' if each.principal else ''})"
        for each in leaf.arguments.values()
    ]
    parts = [summary(leaf), details(leaf), "\n".join(f"- {line}" for line in lines)]
    if leaf.drives:
        parts.append(f"Drives: {', '.join(sorted(leaf.drives))}.")
    if leaf.needs:
        parts.append(f"Needs: {', '.join(sorted(leaf.needs))}.")
    if leaf.stores:
        parts.append(f"`as` keeps {leaf.stores}.")
    return "\n\n".join(part for part in parts if part)


def needs_nothing(leaf: type[Leaf]) -> bool:
    """True for a leaf whose word may stand alone."""
    return not leaf.open_ended and not any(argument.required for argument in leaf.arguments.values())


def _principal(leaf: type[Leaf]) -> Argument | None:
    return next((argument for argument in leaf.arguments.values() if argument.principal), None)


def _named_arguments(leaf: type[Leaf], things: Things) -> Schema:
    if leaf.open_ended:
        return {"propertyNames": NAME, "minProperties": 1}
    return {
        "properties": {argument.name: described(argument, things) for argument in leaf.arguments.values()},
        "required": [argument.name for argument in leaf.arguments.values() if argument.required],
        "additionalProperties": False,
    }


def _alone(leaf: type[Leaf], things: Things) -> Schema:
    """Return what a leaf takes without the name of an argument."""
    principal = _principal(leaf)
    if leaf.open_ended:
        return {"type": "object", "errorMessage": "needs names and values, such as {count: 1}"}
    if principal is None:
        message = f"needs its arguments by name: {', '.join(leaf.arguments)}" if leaf.arguments else "takes no argument"
        return {"type": "null" if needs_nothing(leaf) else "object", "errorMessage": message}
    one = written(principal, things)
    one.pop("defaultSnippets", None)  # they stand with the leaf's word, where editors look for them
    return {"if": {"not": {"type": "null"}}, "then": one} if needs_nothing(leaf) else one


def _values(leaf: type[Leaf], things: Things) -> list[Schema]:
    """Return values to complete a leaf's word with; none for one that may stand alone."""
    principal = _principal(leaf)
    if leaf.open_ended:
        return [{"label": "names and values", "body": {"count": 1}}]
    if needs_nothing(leaf):
        return []
    if principal is None:
        required = {argument.name: example(argument) for argument in leaf.arguments.values() if argument.required}
        return [{"label": ", ".join(required), "body": required}]
    if principal.kind in things:
        return list(named(principal.kind, things[principal.kind])["defaultSnippets"])
    return [{"label": str(example(principal)), "body": example(principal)}]
