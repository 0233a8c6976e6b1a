"""Probe of the rover on a serial port."""

from collections.abc import Generator

from drivers.api.probe import ProbeRequest, ProbeResult

BAUD = 38_400


def rover() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Listen for reports, of which it sends fifty per second."""
    data = yield ProbeRequest(BAUD, timeout=0.2, is_complete=lambda data: data.count(b"\no ") > 1)
    return ProbeResult("a rover", {"baud": BAUD}) if data.count(b"\no ") > 1 else None
