"""Lists in missions: their members have one type, and are plain values or mappings of plain values."""

import json
import re
from collections.abc import Callable, Iterable
from collections.abc import Mapping as Named
from functools import partial

from config.diagnostics import InvalidFileError, SourceText, suggest_from
from config.units import Quantity, parse_quantity, quoted_value, with_article
from config.yaml_nodes import Listing, Mapping, Node, Scalar, compose
from missions.language.check_context import CheckContext
from missions.language.expressions import Convert, format_value
from missions.language.kinds import RESERVED_WORDS
from missions.language.parallel_counts import source_text

LIST_EXAMPLE = "such as [kitchen, hall]"

ReadScalar = Callable[[str, Scalar], object]
"""Function that returns the value of a YAML scalar in a list.

Its first argument is the key of the scalar if that stands in a mapping, otherwise an empty text.
"""

MemberType = str | dict[str, str]
"""Type of the members of a list: a word, or the type of each value of a mapping by key."""


def list_members(node: Listing, read_scalar: ReadScalar) -> list[object]:
    """Return the members of a list: plain values and mappings of them. Raises ValueError for other members."""
    return [_member(item, read_scalar) for item in node.items]


def _member(node: Node, read_scalar: ReadScalar) -> object:
    if isinstance(node, Mapping) and node.entries:
        return {key.text: _plain_member(value, key.text, read_scalar) for key, value in node.entries}
    return _plain_member(node, "", read_scalar)


def _plain_member(node: Node, key: str, read_scalar: ReadScalar) -> object:
    if not isinstance(node, Scalar):
        raise ValueError("needs plain values as its members, or mappings of plain values")
    if "${" in node.text:
        raise ValueError(f"cannot have the member {quoted_value(node.text)}: lists in a file hold plain values")
    return read_scalar(key, node)


def parse_list(text: str, read_scalar: ReadScalar) -> list[object]:
    """Parse a list of the command line: ``kitchen, hall``, or in brackets. Raises ValueError."""
    text = text.strip()
    try:
        node = compose(SourceText("", text if text.startswith("[") else f"[{text}]"))
    except InvalidFileError:
        node = None
    if not isinstance(node, Listing):
        raise ValueError(f"needs a list, such as 'kitchen, hall', got {quoted_value(text)}")
    return list_members(node, read_scalar)


def list_text(values: Iterable[object]) -> str:
    """Return a list as text that ``parse_list`` reads: ``kitchen, hall``, ``{x: 1 m, y: 0 m}``."""
    return ", ".join(map(_member_text, values))


def _member_text(value: object) -> str:
    if isinstance(value, Named):
        return f"{{{', '.join(f'{key}: {_member_text(item)}' for key, item in value.items())}}}"
    if isinstance(value, str):
        return value if re.fullmatch(r"\w([\w .-]*[\w.-])?", value) else json.dumps(value, ensure_ascii=False)
    return str(value).lower() if isinstance(value, bool) else format_value(value)


def list_converter(convert: Convert) -> Convert:
    """Return a converter of lists, which applies ``convert`` to each member."""
    return partial(_convert_members, convert)


def _convert_members(convert: Convert, value: object) -> list[object]:
    if not isinstance(value, list | tuple):
        raise ValueError(f"needs a list, {LIST_EXAMPLE}, got {quoted_value(value)}")
    found = []
    for number, each in enumerate(value, start=1):
        try:
            found.append(convert(each))
        except (ValueError, LookupError) as error:
            raise ValueError(f"has a wrong member {number}: it {error.args[0] if error.args else error}") from None
    return found


def mapping_converter(entries: Named[str, Convert]) -> Convert:
    """Return a converter of mappings; ``entries`` has each key that they must have, and the converter of its value."""
    return partial(_convert_mapping, entries)


def _convert_mapping(entries: Named[str, Convert], value: object) -> dict[str, object]:
    if not isinstance(value, Named):
        raise ValueError(f"needs a mapping with {', '.join(entries)}, got {quoted_value(value)}")
    for key in value:
        if key not in entries:
            hint = suggest_from(str(key), entries)
            raise ValueError(f"has an unknown key {quoted_value(key)}" + (f"; {hint}" if hint else ""))
    found = {}
    for key, convert in entries.items():
        if key not in value:
            raise ValueError(f"has no '{key}'")
        try:
            found[key] = convert(value[key])
        except (ValueError, LookupError) as error:
            raise ValueError(f"has a wrong '{key}': it {error.args[0] if error.args else error}") from None
    return found


def default_value(node: Scalar) -> str | float | bool | None:
    """Return the value of a scalar without a known type: a quantity if it looks like one and is not quoted."""
    found = None if node.quoted else parse_quantity(node.text)
    return node.value if found is None else found


def untyped_members(node: Listing) -> list[object]:
    """Return the members of a list without a known type. Raises ValueError for members that are not allowed."""
    return list_members(node, lambda _, scalar: default_value(scalar))


def type_of_value(value: object) -> str:
    """Return the type of a plain value; "value" for None."""
    if isinstance(value, Quantity):
        return value.dimension
    if isinstance(value, bool):
        return "flag"
    if isinstance(value, int | float):
        return "number"
    return "text" if isinstance(value, str) else "value"


def common_type(context: CheckContext, label: str, node: Listing) -> MemberType | None:
    """Return the common type of the members of a list that is not empty; None if there is an error.

    ``label`` begins an error message.
    """
    try:
        types = [_type_of_member(member) for member in untyped_members(node)]
    except ValueError as error:
        context.fault(node.mark, f"{label} {error}")
        return None
    keys = [key for item in node.items if isinstance(item, Mapping) for key, _ in item.entries]
    if not all(check_key(context, label, key) for key in keys):
        return None
    for item, kind in zip(node.items, types, strict=True):
        if problem := _difference(node.items[0], types[0], item, kind):
            context.fault(item.mark, f"{label}: {problem}")
            return None
    return types[0]


def check_key(context: CheckContext, label: str, key: Scalar) -> bool:
    """Report a key of a mapping that no expression can read; return whether it can be read."""
    if key.text.isidentifier() and key.text not in RESERVED_WORDS and not key.text.startswith("_"):
        return True
    hint = "such as 'x', which expressions read as ${point.x}"
    reserved = f"a key cannot be '{key.text}', which is reserved in expressions"
    plain = f"a key needs a plain word, got {quoted_value(key.text)}"
    context.fault(key.mark, f"{label}: {reserved if key.text in RESERVED_WORDS else plain}", hint)
    return False


def _type_of_member(member: object) -> MemberType:
    if isinstance(member, Named):
        return {key: type_of_value(value) for key, value in member.items()}
    return type_of_value(member)


def _difference(first: Node, wanted: MemberType, item: Node, found: MemberType) -> str:
    """Return the error for a member of another type than the first member; empty if the types are equal."""
    text = quoted_value(source_text(item))
    if isinstance(wanted, str) or isinstance(found, str):
        if wanted == found:
            return ""
        first_text = f"{quoted_value(source_text(first))} is {_type_text(wanted)}"
        return f"the members of a list must have one type: {first_text}, {text} {_type_text(found)}"
    if wanted.keys() != found.keys():
        key = next(key for key in (*wanted, *found) if (key in wanted) != (key in found))
        has = f"has no '{key}'" if key in wanted else f"has '{key}'"
        return f"the members of a list must have the same keys: {text} {has}"
    for key, kind in wanted.items():
        if found[key] != kind:
            kinds = f"{with_article(kind)} in the first, {with_article(found[key])} in {text}"
            return f"'{key}' must have one type in all members: {kinds}"
    return ""


def _type_text(kind: MemberType) -> str:
    return with_article(kind) if isinstance(kind, str) else "a mapping"
