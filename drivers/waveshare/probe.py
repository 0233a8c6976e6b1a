"""A rover of Waveshare's is recognised by one report that it is asked for."""

from collections.abc import Generator
from contextlib import suppress

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.transport.lines import LineFinder
from drivers.waveshare import wire

BAUD = 115_200


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Ask for a report, behind the end of whatever line was begun."""
    heard = yield ProbeRequest(BAUD, b"\n" + wire.command(wire.REPORT), 0.3, _reports)
    reports = _reports(heard)
    return ProbeResult(f"a rover of Waveshare's, its battery at {reports[-1].volts:.1f} V") if reports else None


def _reports(data: bytes) -> list[wire.WaveshareFeedback]:
    found = []
    for line in LineFinder().feed(data):
        with suppress(ValueError):
            if isinstance(told := wire.parse_line(line), wire.WaveshareFeedback):
                found.append(told)
    return found
