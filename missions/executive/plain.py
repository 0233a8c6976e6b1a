"""Values of a mission as JSON can hold them, for files that people and programs read."""

from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from math import isfinite


def plain(value: object) -> object:
    """Return ``value`` in plain terms: an object by its fields, a number that is none as None, others in words."""
    match value:
        case None | bool() | int() | str():
            return value
        case float():
            return value if isfinite(value) else None
        case Mapping():
            return {str(name): plain(each) for name, each in value.items()}
        case list() | tuple() | set() | frozenset():
            return _all(value)
        case _ if is_dataclass(value):
            return {
                field.metadata.get("recorded", field.name): plain(getattr(value, field.name)) for field in fields(value)
            }
        case _:
            return str(value)


def _all(values: Collection[object]) -> list[object]:
    return [plain(value) for value in values]
