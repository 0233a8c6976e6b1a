"""Validation of data read from records."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from config.diagnostics import InvalidInputError

MAX_SECONDS = 1e9
"""Upper bound of times (s) in a record, and of other measured values: thirty years."""


class InvalidRecordError(InvalidInputError):
    """A file that is not a record, or cannot be read; the message has the reason and often a command to try."""


@contextmanager
def reject_malformed(path: Path) -> Iterator[None]:
    """Raise InvalidRecordError for lookup, type and value errors while content of a record is decoded."""
    try:
        yield
    except InvalidRecordError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, RecursionError, OverflowError) as error:
        cause = f"{type(error).__name__}: {error}"
        raise InvalidRecordError(f"{path}: damaged record: {cause:.200}") from error


def parse_message(data: bytes) -> Any:
    """Return the JSON object of a message. Raises ValueError for other JSON, or a time out of range."""
    message = parse_strict_json(data)
    if not isinstance(message, dict):
        raise ValueError(f"a message is not a JSON object: {data[:80]!r}")
    check_time(message.get("t", 0.0))
    return message


def check_time(value: object) -> float:
    """Return a time of a run (s). Raises ValueError if it is not a number within ``MAX_SECONDS``."""
    if not isinstance(value, int | float) or not -MAX_SECONDS < value < MAX_SECONDS:
        raise ValueError(f"{str(value)[:40]!r} is not a time of a run")
    return value


def parse_strict_json(data: bytes) -> Any:
    """Return parsed JSON. Raises ValueError also for NaN and Infinity, which Python accepts and no record has."""
    return json.loads(data, parse_constant=_reject_constant)


def _reject_constant(word: str) -> float:
    raise ValueError(f"{word} is not a JSON number")
