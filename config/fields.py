"""Reader of one mapping of a file, key by key, that collects all errors."""

from collections.abc import Callable, Iterator
from pathlib import Path

from config.diagnostics import (
    KEY_SYNONYMS,
    Diagnostic,
    InvalidFileError,
    Mark,
    SourceText,
    add_diagnostic,
    own_words_for,
    suggest_key,
)
from config.units import quantity_text, si_value
from config.yaml_nodes import Listing, Mapping, Node, Scalar, compose, read_source


class Fields:
    """Keys of one mapping of a YAML file, for ``config.section_reader``.

    Call ``report_unknown_keys`` at the end. All sections of a file share the list ``diagnostics``; ``wrong_places`` are
    the paths of invalid values.
    """

    def __init__(
        self,
        source: SourceText,
        node: Node,
        diagnostics: list[Diagnostic],
        *,
        subject: str,
        torn: bool = False,
        hint: str = "",
    ) -> None:
        self.source = source
        self.node = node
        self.diagnostics = diagnostics
        self.subject = subject
        self.torn = torn or (isinstance(node, Mapping) and node.torn)
        self.wrong_places: list[tuple[str | int, ...]] = []
        self._known: set[str] = set()
        self._lacking: dict[str, Diagnostic] = {}
        if not isinstance(node, Mapping):
            self.add_error(node.mark, f"{subject} must be a mapping of keys to values, such as 'name: value'", hint)

    def add_error(self, mark: Mark, message: str, suggestion: str = "", *, sure: bool = False) -> None:
        """Add an error. If a line of the file could not be read, other errors may be its consequences, and are dropped.

        Errors that are ``sure`` are added in any case.
        """
        if sure or not self.torn:
            add_diagnostic(self.diagnostics, Diagnostic(self.source, mark, message, suggestion))

    def node_of(self, key: str, *, required: bool = False, hint: str = "") -> Node | None:
        """Return the node of ``key``, or None; a missing ``required`` key is an error with ``hint``."""
        self._known.add(key)
        found = self.node.get(key) if isinstance(self.node, Mapping) else None
        if found is None and required and isinstance(self.node, Mapping):
            self.add_error(self.node.mark, f"{self.subject} needs '{key}'", hint)
            self._lacking[key] = Diagnostic(self.source, self.node.mark, f"{self.subject} needs '{key}'", hint)
        return found

    def measure(
        self, node: Node, key: str, dimension: str, *, low: float | None = None, high: float | None = None
    ) -> float:
        """Return the quantity in ``node`` in SI units, clamped to ``low`` and ``high`` (SI); 0 for an invalid value."""
        try:
            value = si_value(value_of(node), dimension)
        except ValueError as error:
            self.add_error(node.mark, f"'{key}' {error}", sure=True)
            return 0.0
        return self.clamp(key, node.mark, value, low, high, lambda bound: quantity_text(bound, dimension))

    def clamp(
        self,
        key: str,
        mark: Mark,
        value: float,
        low: float | None,
        high: float | None,
        show: Callable[[float], str] = str,
    ) -> float:
        """Return ``value`` clamped to the bounds ``low`` and ``high``; if it exceeds one, add an error at ``mark``.

        ``key`` is the name of the value in the error, and ``show`` formats the bound.
        """
        if low is not None and value < low:
            self.add_error(mark, f"'{key}' must be at least {show(low)}")
            return low
        if high is not None and value > high:
            self.add_error(mark, f"'{key}' must be at most {show(high)}")
            return high
        return value

    def section(self, key: str, *, hint: str = "") -> "Fields | None":
        """Return the mapping under ``key``, or None; ``hint`` is the suggestion if the value is not a mapping."""
        node = self.node_of(key)
        subject = f"'{key}'"
        return (
            None
            if node is None
            else Fields(self.source, node, self.diagnostics, subject=subject, torn=self.torn, hint=hint)
        )

    def entries(self) -> Iterator[tuple[Scalar, Node]]:
        """Yield all keys with their nodes, for a mapping with freely chosen names."""
        if isinstance(self.node, Mapping):
            for key, value in self.node.entries:
                self._known.add(key.text)
                yield key, value

    def report_unknown_keys(self, unknown: str = "") -> None:
        """Add an error for each key that was not read; ``unknown`` is the message, with {} for the key."""
        if not isinstance(self.node, Mapping):
            return
        for key, _ in self.node.entries:
            if key.text not in self._known:
                message = unknown.replace("{}", key.text) or f"{self.subject} has no key '{key.text}'"
                self.add_error(key.mark, message, suggest_key(key.text, self._known), sure=True)
                self.wrong_places.append((key.text,))
                for meant in own_words_for(key.text, KEY_SYNONYMS, self._lacking):  # one mistake, not two
                    self.diagnostics[:] = [each for each in self.diagnostics if each != self._lacking.get(meant)]


def value_of(node: Node) -> object:
    """Return the value of a scalar node, or an empty list or dict for a sequence or mapping."""
    return node.value if isinstance(node, Scalar) else [] if isinstance(node, Listing) else {}


def read_fields(path: Path, *, subject: str, name: str | None = None) -> Fields:
    """Read a YAML file with a mapping at the top; ``subject`` names the mapping in errors.

    Raises InvalidFileError for other files.
    """
    return fields_of(read_source(path, name), subject=subject)


def fields_of(source: SourceText, *, subject: str) -> Fields:
    """Read a YAML text with a mapping at the top; ``subject`` names the mapping in errors.

    Raises InvalidFileError for other texts.
    """
    faults: list[Diagnostic] = []
    fields = Fields(source, compose(source, faults), faults, subject=subject)
    if not isinstance(fields.node, Mapping):
        raise InvalidFileError(faults)
    return fields
