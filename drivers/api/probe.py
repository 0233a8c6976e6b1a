"""How a device is recognised on a serial port: what it is asked, and what of its answers proves that it is there.

A driver declares its probe by a dotted name. A probe is pure: it yields what is to be asked, is sent the bytes that
came back, and returns what they prove. It asks for nothing that could move or change a device.
"""

from collections.abc import Callable, Generator, Mapping
from dataclasses import field

from drivers.api.fast_dataclass import dataclass


def _never(heard: bytes) -> bool:
    del heard
    return False


@dataclass(frozen=True, slots=True)
class ProbeRequest:
    """A question: ``send`` these bytes at ``baud``, and listen for ``timeout`` seconds, or until what came is ``is_complete``.

    Without bytes it is only listened. The echo of an adapter is left out of the answer, unless with ``keep_echo``: a
    device may reply with the very bytes of the question.
    """

    baud: int
    send: bytes = b""
    timeout: float = 0.01
    is_complete: Callable[[bytes], object] = _never
    keep_echo: bool = False


@dataclass(frozen=True, slots=True)
class BusDevice:
    """One of several devices on a wire, such as a servo: its number there, its model, and what is wrong with it."""

    id: int
    model: str
    trouble: str = ""


@dataclass(frozen=True, slots=True)
class ProbeResult:
    """What answered: ``about`` says it in words; ``keys`` are what its section of a robot file has of it.

    ``trouble`` says what is wrong with it, and ``hint`` what to try.
    """

    about: str
    keys: Mapping[str, object] = field(default_factory=dict)
    units: tuple[BusDevice, ...] = ()
    trouble: str = ""
    hint: str = ""


Probe = Callable[[], Generator[ProbeRequest, bytes, ProbeResult | None]]
"""Asks a port for one kind of device; returns None where nothing proves that it is there."""
