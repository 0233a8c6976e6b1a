"""What is wrong with a file that should be a record."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class InvalidRecordError(ValueError):
    """A file that is no record, or none that can be read; says so, and what to type next, in its message."""


@contextmanager
def understanding(path: Path) -> Iterator[None]:
    """Raise InvalidRecordError where what a record holds is not what it should be."""
    try:
        yield
    except InvalidRecordError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        said = f"{type(error).__name__}: {error}"
        raise InvalidRecordError(f"{path}: holds what this MissionTree does not understand: {said:.200}") from error
