"""Reading one mapping of a file, key by key, and noting everything that is wrong with it."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

from config.asked import Key, note_free, note_key
from config.faults import Fault, InvalidFileError, Mark, Source, note, one_of
from config.marked import Listing, Mapping, Node, Scalar, compose, read_source
from config.synonyms import KEYS, key_meant, ours_for
from config.units import in_dimension, seen, written

Word = TypeVar("Word", bound=str)


class Fields:
    """The keys of one mapping. A getter notes a fault and returns its default (or a harmless value) when one is wrong.

    A getter without a default asks for a key that must be there. Call ``done`` at the end: keys that nobody asked for
    are faults too. Faults gather in the list that all sections of a file share. ``wrong`` is for whoever reads declared
    keys, to note which of them are.
    """

    def __init__(self, source: Source, node: Node, faults: list[Fault], *, what: str, torn: bool = False) -> None:
        self.source = source
        self.node = node
        self.faults = faults
        self.what = what
        self._torn = torn or (isinstance(node, Mapping) and node.torn)
        self.wrong: list[tuple[str | int, ...]] = []
        self._known: set[str] = set()
        self._lacking: dict[str, Fault] = {}
        if not isinstance(node, Mapping):
            self.fault(node.mark, f"{what} must be a mapping of keys to values, such as 'name: value'")

    def fault(self, mark: Mark, message: str, suggestion: str = "", *, sure: bool = False) -> None:
        """Note a mistake; where a line of the file could not be read, only what is ``sure`` whatever stood there."""
        if sure or not self._torn:
            note(self.faults, Fault(self.source, mark, message, suggestion))

    def node_of(self, key: str, *, required: bool = False) -> Node | None:
        """Return the node of ``key``, None where it is missing."""
        self._known.add(key)
        note_key(self.node, key, Key(required=required))
        found = self.node.get(key) if isinstance(self.node, Mapping) else None
        if found is None and required and isinstance(self.node, Mapping):
            self.fault(self.node.mark, f"{self.what} needs '{key}'")
            self._lacking[key] = Fault(self.source, self.node.mark, f"{self.what} needs '{key}'")
        return found

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text."""
        note_key(self.node, key, Key("text", default is None))
        node = self.node_of(key, required=default is None)
        if node is None:
            return default or ""
        if not isinstance(node, Scalar) or node.value is None or not node.text.strip():
            self.fault(node.mark, f"'{key}' needs a text")
            return default or ""
        return node.text

    def choice(self, key: str, among: Sequence[Word], default: Word | None = None) -> Word:
        """Return one of the words ``among``."""
        note_key(self.node, key, Key("choice", default is None, among=tuple(among)))
        node = self.node_of(key, required=default is None)
        if node is None:
            return among[0] if default is None else default
        text = node.text if isinstance(node, Scalar) else ""
        found = next((word for word in among if word == text), None)
        if found is None:
            self.fault(node.mark, f"'{key}' cannot be {seen(value_of(node))}", one_of(text, among), sure=True)
        return found or among[0]

    def flag(self, key: str, default: bool) -> bool:
        """Return true or false."""
        note_key(self.node, key, Key("flag"))
        node = self.node_of(key)
        if node is None:
            return default
        if not isinstance(node, Scalar) or not isinstance(node.value, bool):
            self.fault(node.mark, f"'{key}' needs true or false", sure=True)
            return default
        return node.value

    def number(
        self, key: str, default: float | None = None, *, low: float | None = None, high: float | None = None
    ) -> float:
        """Return a plain number between ``low`` and ``high``."""
        note_key(self.node, key, Key("number", default is None, low=low, high=high))
        node = self.node_of(key, required=default is None)
        if node is None:
            return default or 0.0
        value = node.value if isinstance(node, Scalar) else None
        if not isinstance(value, int | float) or isinstance(value, bool):
            self.fault(node.mark, f"'{key}' needs a plain number", sure=True)
            return default or 0.0
        return self._within(key, node.mark, float(value), low, high, str)

    def integer(self, key: str, default: int | None = None, *, low: int | None = None, high: int | None = None) -> int:
        """Return a whole number between ``low`` and ``high``."""
        note_key(self.node, key, Key("integer", default is None, low=low, high=high))
        node = self.node_of(key, required=default is None)
        if node is None:
            return default or 0
        value = node.value if isinstance(node, Scalar) else None
        if not isinstance(value, int) or isinstance(value, bool):
            self.fault(node.mark, f"'{key}' needs a whole number", sure=True)
            return default or 0
        return int(self._within(key, node.mark, value, low, high, str))

    def quantity(
        self,
        key: str,
        dimension: str,
        default: float | None = None,
        *,
        low: float | None = None,
        high: float | None = None,
    ) -> float:
        """Return a quantity of ``dimension`` in SI units, between ``low`` and ``high`` (SI)."""
        note_key(self.node, key, Key("quantity", default is None, dimension, low=low, high=high))
        node = self.node_of(key, required=default is None)
        if node is None:
            return default or 0.0
        return self.measure(node, key, dimension, low=low, high=high, fallback=default or 0.0)

    def measure(
        self,
        node: Node,
        key: str,
        dimension: str,
        *,
        low: float | None = None,
        high: float | None = None,
        fallback: float = 0.0,
    ) -> float:
        """Return the quantity that ``node`` holds."""
        try:
            value = in_dimension(value_of(node), dimension)
        except ValueError as error:
            self.fault(node.mark, f"'{key}' {error}", sure=True)
            return fallback
        return self._within(key, node.mark, value, low, high, lambda bound: written(bound, dimension))

    def span(self, key: str, dimension: str, default: tuple[float, float] | None = None) -> tuple[float, float]:
        """Return ``[low, high]``, two quantities of ``dimension`` in SI units."""
        note_key(self.node, key, Key("span", default is None, dimension))
        node = self.node_of(key, required=default is None)
        if node is None:
            return default or (0.0, 0.0)
        if not isinstance(node, Listing) or len(node.items) != 2:
            self.fault(node.mark, f"'{key}' needs two values: [low, high]")
            return default or (0.0, 0.0)
        before = len(self.faults)
        low, high = (self.measure(item, key, dimension) for item in node.items)
        if low >= high and len(self.faults) == before:
            self.fault(node.mark, f"'{key}': the first value must be below the second")
        return low, high

    def position(self, key: str, default: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return ``[x, y, z]``, three lengths in metres."""
        nodes = self.items(key)
        note_key(self.node, key, Key("position", dimension="length"))
        lengths = [self.measure(node, key, "length") for node in nodes]
        if len(lengths) == 3:
            return (lengths[0], lengths[1], lengths[2])
        if nodes:
            self.fault(nodes[0].mark, f"'{key}' needs three lengths: [x, y, z]")
        return default

    def section(self, key: str, *, required: bool = False) -> "Fields | None":
        """Return the mapping under ``key``."""
        note_key(self.node, key, Key("section", required))
        node = self.node_of(key, required=required)
        return None if node is None else Fields(self.source, node, self.faults, what=f"'{key}'", torn=self._torn)

    def items(self, key: str, *, required: bool = False) -> list[Node]:
        """Return the nodes of the list under ``key``."""
        note_key(self.node, key, Key("list", required))
        node = self.node_of(key, required=required)
        if node is None:
            return []
        if not isinstance(node, Listing):
            self.fault(node.mark, f"'{key}' needs a list")
            return []
        return node.items

    def entries(self) -> Iterator[tuple[Scalar, Node]]:
        """Every key with its node, for a mapping whose keys are names that the file chooses."""
        note_free(self.node)
        if isinstance(self.node, Mapping):
            for key, value in self.node.entries:
                self._known.add(key.text)
                yield key, value

    def done(self) -> None:
        """Note every key that nobody asked for."""
        if not isinstance(self.node, Mapping):
            return
        for key, _ in self.node.entries:
            if key.text not in self._known:
                self.fault(
                    key.mark, f"{self.what} has no key '{key.text}'", key_meant(key.text, self._known), sure=True
                )
                for meant in ours_for(key.text, KEYS, self._lacking):  # one mistake, not two
                    self.faults[:] = [each for each in self.faults if each != self._lacking.get(meant)]

    def _within(
        self, key: str, mark: Mark, value: float, low: float | None, high: float | None, show: Callable[[float], str]
    ) -> float:
        if low is not None and value < low:
            self.fault(mark, f"'{key}' must be at least {show(low)}")
            return low
        if high is not None and value > high:
            self.fault(mark, f"'{key}' must be at most {show(high)}")
            return high
        return value


def value_of(node: Node) -> object:
    """Return what a scalar means; an empty list or mapping stands for one."""
    return node.value if isinstance(node, Scalar) else [] if isinstance(node, Listing) else {}


def read_fields(path: Path, *, what: str, name: str | None = None) -> Fields:
    """Read a YAML file whose top is one mapping. Raises InvalidFileError when it is not."""
    return fields_of(read_source(path, name), what=what)


def fields_of(source: Source, *, what: str) -> Fields:
    """Read a text in YAML whose top is one mapping. Raises InvalidFileError when it is not."""
    faults: list[Fault] = []
    fields = Fields(source, compose(source, faults), faults, what=what)
    if not isinstance(fields.node, Mapping):
        raise InvalidFileError(faults)
    return fields
