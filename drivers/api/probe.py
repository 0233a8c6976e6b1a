"""Probe of a device on a serial port: requests to send, and the replies that prove its presence.

A driver declares its probe by a dotted name. A probe is pure: it yields requests, is sent the received bytes, and
returns its conclusion. It sends nothing that could move or change a device.
"""

from collections.abc import Callable, Generator, Mapping
from dataclasses import field

from drivers.api.fast_dataclass import dataclass


def _never(heard: bytes) -> bool:
    del heard
    return False


@dataclass(frozen=True, slots=True)
class ProbeRequest:
    """Request of a probe: ``send`` bytes at ``baud``, and receive for ``timeout`` seconds, or until ``is_complete``.

    Without bytes the probe only listens. Some adapters echo the request; the echo is removed from the reply unless
    ``keep_echo`` is set, for devices that may reply with the same bytes as the request.
    """

    baud: int
    send: bytes = b""
    timeout: float = 0.01
    is_complete: Callable[[bytes], object] = _never
    keep_echo: bool = False


@dataclass(frozen=True, slots=True)
class BusDevice:
    """Device on a bus, such as a servo: its bus address and model, and the problem that the probe found.

    The problem is an empty text if there is none.
    """

    id: int
    model: str
    trouble: str = ""


@dataclass(frozen=True, slots=True)
class ProbeResult:
    """Device that a probe recognised: ``about`` describes it, ``keys`` belong into its section of a robot file.

    ``trouble`` describes a problem of the device, and ``hint`` a fix.
    """

    about: str
    keys: Mapping[str, object] = field(default_factory=dict)
    units: tuple[BusDevice, ...] = ()
    trouble: str = ""
    hint: str = ""


Probe = Callable[[], Generator[ProbeRequest, bytes, ProbeResult | None]]
"""Probes a port for one kind of device; returns None if the device was not recognised."""
