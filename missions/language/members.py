"""What an expression may read of a value, behind a dot: fields and properties, but no methods and nothing private."""

from collections.abc import Mapping


def members_of(kind: type) -> list[str]:
    """Return the names of what every value of ``kind`` has."""
    public = (name for name in dir(kind) if not name.startswith("_"))
    return [name for name in public if not callable(getattr(kind, name, None))]


def members_in(value: object) -> list[str]:
    """Return the names of what ``value`` has; none for a text, a number or a list."""
    if isinstance(value, Mapping):
        return sorted(str(key) for key in value if not str(key).startswith("_"))
    return [] if value is None or isinstance(value, str | int | float | list) else members_of(type(value))
