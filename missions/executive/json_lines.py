"""The events of a run as lines of JSON, for other programs; values of a mission as JSON can hold them."""

import json
from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from math import isfinite
from typing import TextIO

from missions.executive.events import Event


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


class JsonLines:
    """Writes events to a text file, one JSON object a line, each flushed, so that a killed run keeps its past.

    ``whole`` is False once an event could not be written.
    """

    def __init__(self, file: TextIO) -> None:
        self.whole = True
        self._file = file

    def __call__(self, event: Event) -> None:
        """Write one event."""
        line = json.dumps(event.as_dict(), default=plain, ensure_ascii=False) + "\n"
        self.whole = False
        self._file.write(line)
        self._file.flush()
        self.whole = True
