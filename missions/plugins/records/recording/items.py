"""Items that a run sends to its record, and their encoding for the pipe to the writer process.

Items are pickled, since this takes the ticking process the least time. The writer process starts fast because it does
not import py_trees, cv2 or the runner. So it unpickles only classes of drivers and perception. An object of any other
class, such as an event, becomes an ``OpaqueValue`` with its class name and fields.
"""

import io
import pickle
import struct
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

from drivers.api import Health
from missions.executive.tick_record import TickRecord
from perception.api import Gaze, View

BATCH_HEADER = struct.Struct("<Q")
"""Header of a batch of items in the pipe to the writer process: the batch's number of bytes."""


class ViewItem(NamedTuple):
    """Item with the percepts in a picture, and the time (s) at which perception reported them."""

    t: float
    view: View


class PictureItem(NamedTuple):
    """Item with a picture in which perception searched: JPEG, time (s), and the camera's direction if known."""

    t: float
    jpeg: bytes
    gaze: Gaze | None


class HealthItem(NamedTuple):
    """Item with the health of the devices at time ``t`` (s)."""

    t: float
    health: Mapping[str, Health]


class FeedbackItem(NamedTuple):
    """Item with a new message of a node that is still running: time (s), tick, node key and message."""

    t: float
    tick: int
    node: str
    reason: str


class LossItem(NamedTuple):
    """Item with the number of messages that are missing from the record, by topic, and the reason."""

    counts: Mapping[str, int]
    reason: str


class OpaqueValue:
    """An unpickled value of a class that the writer process does not import, with its fields as attributes."""

    def __new__(cls, *_args: object) -> Self:
        """Create a value without calling the original constructor."""
        return super().__new__(cls)

    def __setstate__(self, state: object) -> None:
        for part in state if isinstance(state, tuple) else (state,):
            if isinstance(part, dict):
                vars(self).update(part)

    def append(self, _item: object) -> None:
        """Ignore an element that pickle appends, if the original class was a subclass of list."""

    def __setitem__(self, _key: object, _item: object) -> None:
        """Ignore a key that pickle sets, if the original class was a subclass of dict."""

    def __str__(self) -> str:
        return f"<{type(self).__name__}>"


class PlainNumber(float):
    """A number of a class that the writer process does not import, without its other attributes, such as a unit."""

    def __new__(cls, value: float, *_more: object) -> Self:
        """Create a number; further constructor arguments are ignored."""
        return super().__new__(cls, value)


EVENT_TOPICS: Mapping[str, str] = {
    "NodeChanged": "/nodes",
    "VariableSet": "/variables",
    "CommandSent": "/commands",
    "FaultRaised": "/faults",
    "ReflexFired": "/reflexes",
    "Logged": "/log",
    "Notified": "/notices",
    "Ended": "/end",
}
"""Topic in the record by class name of the event; events of other classes are part of other items, such as ticks."""

ITEM_TOPICS: Mapping[type, str] = {
    TickRecord: "/moments",
    ViewItem: "/percepts",
    PictureItem: "/camera",
    HealthItem: "/state/devices",
    FeedbackItem: "/feedback",
}
"""Main topic in the record of each item that is not an event."""


def topic_of(item: object) -> str:
    """Return the topic of an item in the record; if the item is lost, it is counted under this topic."""
    return ITEM_TOPICS.get(type(item)) or EVENT_TOPICS[type(item).__name__]


def pack_items(items: Sequence[object]) -> bytes:
    """Return items as bytes, pickled. Raises any exception of a class that cannot be pickled.

    Pickle's global table of reducers is not used, since other libraries, such as Dask, change it.
    """
    file = io.BytesIO()
    pickler = pickle.Pickler(file, pickle.HIGHEST_PROTOCOL)
    pickler.dispatch_table = {}
    pickler.dump(items)
    return file.getvalue()


def unpack_items(data: bytes) -> list[Any]:
    """Return the items that ``pack_items`` has packed into ``data``. Unsafe for data of other programs."""
    found: list[Any] = _Unpickler(io.BytesIO(data)).load()
    return found


_IMPORTABLE_PACKAGES = (
    "builtins",
    "collections",
    "copyreg",
    "_codecs",
    "enum",
    "numpy",
    "drivers.api",
    "drivers.errors",
)
_IMPORTABLE_MODULES = (
    "perception.api",
    "missions.executive.tick_record",
    "missions.plugins.records.recording.items",
    "missions.plugins.records.recording.record_header",
)


class _Unpickler(pickle.Unpickler):
    """Unpickler that imports only drivers, perception and a few modules; other classes become ``OpaqueValue``."""

    def find_class(self, module: str, name: str) -> Any:
        if module in _IMPORTABLE_MODULES or any(
            module == known or module.startswith(f"{known}.") for known in _IMPORTABLE_PACKAGES
        ):
            return super().find_class(module, name)
        return PlainNumber if module == "config.units" else type(name, (OpaqueValue,), {"__module__": module})
