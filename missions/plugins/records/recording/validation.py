"""What is wrong with a file that should be a record."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from config.diagnostics import InvalidInputError

MAX_SECONDS = 1e9
"""Seconds that no run lasts: thirty years. No figure of a robot is as large either."""


class InvalidRecordError(InvalidInputError):
    """A file that is no record, or none that can be read; says so, and what to type next, in its message."""


@contextmanager
def reject_malformed(path: Path) -> Iterator[None]:
    """Raise InvalidRecordError where what a record holds is not what it should be."""
    try:
        yield
    except InvalidRecordError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, RecursionError, OverflowError) as error:
        said = f"{type(error).__name__}: {error}"
        raise InvalidRecordError(f"{path}: holds what this MissionTree does not understand: {said:.200}") from error


def parse_message(data: bytes) -> Any:
    """Return what a message says. Raises ValueError for what is no object, or has a time at which no run is."""
    found = parse_strict_json(data)
    if not isinstance(found, dict):
        raise ValueError(f"a message is no object: {data[:80]!r}")
    check_time(found.get("t", 0.0))
    return found


def check_time(value: object) -> float:
    """Return a time of a run. Raises ValueError for what is none."""
    if not isinstance(value, int | float) or not -MAX_SECONDS < value < MAX_SECONDS:
        raise ValueError(f"{str(value)[:40]!r} is no time of a run")
    return value


def parse_strict_json(data: bytes) -> Any:
    """Return what JSON says. Raises ValueError for NaN and Infinity, too, which Python reads and no record has."""
    return json.loads(data, parse_constant=_reject_constant)


def _reject_constant(word: str) -> float:
    raise ValueError(f"{word} is no number of JSON")
