"""Lists as values: ``[kitchen, hall]``, all of one kind, in a file or on a command line."""

from collections.abc import Callable
from functools import partial

from config.faults import InvalidFileError, Source
from config.marked import Listing, Node, Scalar, compose
from config.units import seen

FORM = "such as [kitchen, hall]"

Convert = Callable[[object], object]
Meant = Callable[[Scalar], object]
"""Returns the value that a scalar has, as a member of a list."""


def members(node: Listing, meant: Meant) -> list[object]:
    """Return the values of a list's members. Raises ValueError for what cannot be one."""
    return [_member(item, meant) for item in node.items]


def _member(node: Node, meant: Meant) -> object:
    if not isinstance(node, Scalar):
        raise ValueError("needs plain values as its members: a list holds no lists and no mappings")
    if "${" in node.text:
        raise ValueError(f"cannot have the member {seen(node.text)}: lists in a file hold plain values")
    return meant(node)


def typed(text: str, meant: Meant) -> list[object]:
    """Read a list from a command line: ``kitchen, hall``, or in brackets. Raises ValueError."""
    text = text.strip()
    try:
        node = compose(Source("", text if text.startswith("[") else f"[{text}]"))
    except InvalidFileError:
        node = None
    if not isinstance(node, Listing):
        raise ValueError(f"needs a list, such as 'kitchen, hall', got {seen(text)}")
    return members(node, meant)


def of(convert: Convert) -> Convert:
    """Return what turns a list into one whose members ``convert`` has turned."""
    return partial(_each, convert)


def _each(convert: Convert, value: object) -> list[object]:
    if not isinstance(value, list | tuple):
        raise ValueError(f"needs a list, {FORM}, got {seen(value)}")
    found = []
    for number, each in enumerate(value, start=1):
        try:
            found.append(convert(each))
        except (ValueError, LookupError) as error:
            raise ValueError(f"has a wrong member {number}: it {error.args[0] if error.args else error}") from None
    return found
