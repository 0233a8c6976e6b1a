"""Reading one mapping of a file, key by key, and noting everything that is wrong with it."""

from collections.abc import Callable, Iterator
from pathlib import Path

from config.faults import KEYS, Diagnostic, InvalidFileError, Mark, Source, key_meant, note, ours_for
from config.marked import Listing, Mapping, Node, Scalar, compose, read_source
from config.units import in_dimension, written


class Fields:
    """The keys of one mapping, for whoever reads declared keys (``config.declared``).

    Call ``done`` at the end: keys that nobody asked for are faults too. Faults gather in the list that all sections of
    a file share; ``wrong`` is where to note which keys are.
    """

    def __init__(
        self, source: Source, node: Node, faults: list[Diagnostic], *, what: str, torn: bool = False, hint: str = ""
    ) -> None:
        self.source = source
        self.node = node
        self.faults = faults
        self.what = what
        self.torn = torn or (isinstance(node, Mapping) and node.torn)
        self.wrong: list[tuple[str | int, ...]] = []
        self._known: set[str] = set()
        self._lacking: dict[str, Diagnostic] = {}
        if not isinstance(node, Mapping):
            self.fault(node.mark, f"{what} must be a mapping of keys to values, such as 'name: value'", hint)

    def fault(self, mark: Mark, message: str, suggestion: str = "", *, sure: bool = False) -> None:
        """Note a mistake; where a line of the file could not be read, only what is ``sure`` whatever stood there."""
        if sure or not self.torn:
            note(self.faults, Diagnostic(self.source, mark, message, suggestion))

    def node_of(self, key: str, *, required: bool = False, hint: str = "") -> Node | None:
        """Return the node of ``key``, None where it is missing; ``hint`` says what to write where it is required."""
        self._known.add(key)
        found = self.node.get(key) if isinstance(self.node, Mapping) else None
        if found is None and required and isinstance(self.node, Mapping):
            self.fault(self.node.mark, f"{self.what} needs '{key}'", hint)
            self._lacking[key] = Diagnostic(self.source, self.node.mark, f"{self.what} needs '{key}'", hint)
        return found

    def measure(
        self, node: Node, key: str, dimension: str, *, low: float | None = None, high: float | None = None
    ) -> float:
        """Return the quantity that ``node`` holds, between ``low`` and ``high`` (all SI); 0 for another value."""
        try:
            value = in_dimension(value_of(node), dimension)
        except ValueError as error:
            self.fault(node.mark, f"'{key}' {error}", sure=True)
            return 0.0
        return self.within(key, node.mark, value, low, high, lambda bound: written(bound, dimension))

    def within(
        self,
        key: str,
        mark: Mark,
        value: float,
        low: float | None,
        high: float | None,
        show: Callable[[float], str] = str,
    ) -> float:
        """Return a number, or the bound that it is beyond, which is noted."""
        if low is not None and value < low:
            self.fault(mark, f"'{key}' must be at least {show(low)}")
            return low
        if high is not None and value > high:
            self.fault(mark, f"'{key}' must be at most {show(high)}")
            return high
        return value

    def section(self, key: str, *, hint: str = "") -> "Fields | None":
        """Return the mapping under ``key``; ``hint`` says what to write where it is none."""
        node = self.node_of(key)
        what = f"'{key}'"
        return None if node is None else Fields(self.source, node, self.faults, what=what, torn=self.torn, hint=hint)

    def entries(self) -> Iterator[tuple[Scalar, Node]]:
        """Every key with its node, for a mapping whose keys are names that the file chooses."""
        if isinstance(self.node, Mapping):
            for key, value in self.node.entries:
                self._known.add(key.text)
                yield key, value

    def done(self, unknown: str = "") -> None:
        """Note every key that nobody asked for; ``unknown`` is the message, with {} for the key."""
        if not isinstance(self.node, Mapping):
            return
        for key, _ in self.node.entries:
            if key.text not in self._known:
                message = unknown.replace("{}", key.text) or f"{self.what} has no key '{key.text}'"
                self.fault(key.mark, message, key_meant(key.text, self._known), sure=True)
                self.wrong.append((key.text,))
                for meant in ours_for(key.text, KEYS, self._lacking):  # one mistake, not two
                    self.faults[:] = [each for each in self.faults if each != self._lacking.get(meant)]


def value_of(node: Node) -> object:
    """Return what a scalar means; an empty list or mapping stands for one."""
    return node.value if isinstance(node, Scalar) else [] if isinstance(node, Listing) else {}


def read_fields(path: Path, *, what: str, name: str | None = None) -> Fields:
    """Read a YAML file whose top is one mapping. Raises InvalidFileError when it is not."""
    return fields_of(read_source(path, name), what=what)


def fields_of(source: Source, *, what: str) -> Fields:
    """Read a text in YAML whose top is one mapping. Raises InvalidFileError when it is not."""
    faults: list[Diagnostic] = []
    fields = Fields(source, compose(source, faults), faults, what=what)
    if not isinstance(fields.node, Mapping):
        raise InvalidFileError(faults)
    return fields
