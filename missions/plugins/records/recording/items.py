"""Items that a run sends to its record, and their transfer to the writer process.

Items are pickled, which costs the ticking process least. The writer must not import py_trees, cv2 and the runner.
Therefore only classes of drivers and perception values are unpickled as such. All others, including events, become an
``OpaqueValue``: the class name and the fields.
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
"""Header of a batch of items in the pipe: its number of bytes."""


class ViewItem(NamedTuple):
    """Percepts, and the time of their report (s)."""

    t: float
    view: View


class PictureItem(NamedTuple):
    """A searched frame as JPEG, its time (s), and the camera's direction if known."""

    t: float
    jpeg: bytes
    gaze: Gaze | None


class HealthItem(NamedTuple):
    """Health of the devices at time ``t`` (s)."""

    t: float
    health: Mapping[str, Health]


class FeedbackItem(NamedTuple):
    """New message of a node that is still running: time (s), tick, node key and message."""

    t: float
    tick: int
    node: str
    reason: str


class LossItem(NamedTuple):
    """Number of messages that are missing from the record, by topic, and the reason."""

    counts: Mapping[str, int]
    reason: str


class OpaqueValue:
    """A value of a class that is not imported here, with its fields as attributes."""

    def __new__(cls, *_args: object) -> Self:
        """Create a value without calling the original constructor."""
        return super().__new__(cls)

    def __setstate__(self, state: object) -> None:
        for part in state if isinstance(state, tuple) else (state,):
            if isinstance(part, dict):
                vars(self).update(part)

    def append(self, _item: object) -> None:
        """Ignore list content."""

    def __setitem__(self, _key: object, _item: object) -> None:
        """Ignore mapping content."""

    def __str__(self) -> str:
        return f"<{type(self).__name__}>"


class PlainNumber(float):
    """A number that had more attributes, such as a unit."""

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
"""Topic of each recorded event; the record header, tick records and views contain all others."""

ITEM_TOPICS: Mapping[type, str] = {
    TickRecord: "/moments",
    ViewItem: "/percepts",
    PictureItem: "/camera",
    HealthItem: "/state/devices",
    FeedbackItem: "/feedback",
}
"""Main topic of each item that is not an event."""


def topic_of(item: object) -> str:
    """Return the topic of an item; losses are counted under it."""
    return ITEM_TOPICS.get(type(item)) or EVENT_TOPICS[type(item).__name__]


def pack_items(items: Sequence[object]) -> bytes:
    """Return items as bytes. Raises any exception of a class that cannot be pickled.

    The global dispatch table is not used: libraries register reducers there, such as Dask for exceptions.
    """
    file = io.BytesIO()
    pickler = pickle.Pickler(file, pickle.HIGHEST_PROTOCOL)
    pickler.dispatch_table = {}
    pickler.dump(items)
    return file.getvalue()


def unpack_items(data: bytes) -> list[Any]:
    """Return the items of bytes from ``pack_items``. Unsafe for data of other programs."""
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
    """Unpickler that imports only the allowed modules."""

    def find_class(self, module: str, name: str) -> Any:
        if module in _IMPORTABLE_MODULES or any(
            module == known or module.startswith(f"{known}.") for known in _IMPORTABLE_PACKAGES
        ):
            return super().find_class(module, name)
        return PlainNumber if module == "config.units" else type(name, (OpaqueValue,), {"__module__": module})
