"""What a run hands to its record, and how that goes from the run's process to the one that writes.

The way over is pickle: it is by far the quickest for whoever ticks. But the writer shall not import what makes a run,
py_trees and cv2 above all; so of the classes in there only those of drivers and perception's values come back as they
were. All others, events among them, become ``OpaqueValue``: the name of the class, and its fields.
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
"""What stands before a batch of items in a pipe: how many bytes it has."""


class ViewItem(NamedTuple):
    """What perception found, and when it said so."""

    t: float
    view: View


class PictureItem(NamedTuple):
    """A searched frame as JPEG, when it was taken, and where the camera looked then as far as that was known."""

    t: float
    jpeg: bytes
    gaze: Gaze | None


class HealthItem(NamedTuple):
    """How the devices were."""

    t: float
    health: Mapping[str, Health]


class FeedbackItem(NamedTuple):
    """The message of a node that goes on running, where it is another than before: when, in which tick, of which."""

    t: float
    tick: int
    node: str
    reason: str


class LossItem(NamedTuple):
    """How many messages will not come into the record, by topic, and why."""

    counts: Mapping[str, int]
    reason: str


class OpaqueValue:
    """A value of a class that is not imported here, as far as its fields tell of it."""

    def __new__(cls, *_args: object) -> Self:
        """Make one, whatever its own class would ask for."""
        return super().__new__(cls)

    def __setstate__(self, state: object) -> None:
        for part in state if isinstance(state, tuple) else (state,):
            if isinstance(part, dict):
                vars(self).update(part)

    def append(self, _item: object) -> None:
        """Take no notice of what it holds besides its fields, such as a list of a class of its own."""

    def __setitem__(self, _key: object, _item: object) -> None:
        """Take no notice, as of items."""

    def __str__(self) -> str:
        return f"<{type(self).__name__}>"


class PlainNumber(float):
    """A number that knew more of itself, such as its unit."""

    def __new__(cls, value: float, *_more: object) -> Self:
        """Make one, whatever its own class would ask for."""
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
"""The topic of each event that has one; the others are contained in the head, the moments and the views."""

ITEM_TOPICS: Mapping[type, str] = {
    TickRecord: "/moments",
    ViewItem: "/percepts",
    PictureItem: "/camera",
    HealthItem: "/state/devices",
    FeedbackItem: "/feedback",
}
"""The main topic of everything else."""


def topic_of(item: object) -> str:
    """Return the topic of an item, that under which it is counted where it is lost."""
    return ITEM_TOPICS.get(type(item)) or EVENT_TOPICS[type(item).__name__]


def pack_items(items: Sequence[object]) -> bytes:
    """Return items as bytes. Raises whatever a class raises that cannot be pickled.

    Ways of pickling that libraries have registered for the whole program do not count: Dask has one for exceptions.
    """
    file = io.BytesIO()
    pickler = pickle.Pickler(file, pickle.HIGHEST_PROTOCOL)
    pickler.dispatch_table = {}
    pickler.dump(items)
    return file.getvalue()


def unpack_items(data: bytes) -> list[Any]:
    """Return what ``pack_items`` made bytes of; only for what this program has packed itself."""
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
    """Imports what is known and light, and nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        if module in _IMPORTABLE_MODULES or any(
            module == known or module.startswith(f"{known}.") for known in _IMPORTABLE_PACKAGES
        ):
            return super().find_class(module, name)
        return PlainNumber if module == "config.units" else type(name, (OpaqueValue,), {"__module__": module})
