"""How the rover is recognised on a serial port."""

from collections.abc import Generator

from drivers.api.probe import ProbeRequest, ProbeResult

BAUD = 38_400


def rover() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Listen for its reports, of which it sends fifty a second."""
    heard = yield ProbeRequest(BAUD, wait=0.2, enough=lambda heard: heard.count(b"\no ") > 1)
    return ProbeResult("a rover", {"baud": BAUD}) if heard.count(b"\no ") > 1 else None
