"""Probe of a Waveshare rover, recognised by a report."""

from collections.abc import Generator
from contextlib import suppress

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.transport.lines import LineFinder
from drivers.waveshare import wire

BAUD = 115_200


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Request a report, after the end of any incomplete line."""
    data = yield ProbeRequest(BAUD, b"\n" + wire.command(wire.REPORT), 0.3, _reports)
    reports = _reports(data)
    return ProbeResult(f"a rover of Waveshare's, its battery at {reports[-1].volts:.1f} V") if reports else None


def _reports(data: bytes) -> list[wire.WaveshareFeedback]:
    reports = []
    for line in LineFinder().feed(data):
        with suppress(ValueError):
            if isinstance(message := wire.parse_line(line), wire.WaveshareFeedback):
                reports.append(message)
    return reports
