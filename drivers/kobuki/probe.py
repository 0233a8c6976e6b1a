"""Probe for a Kobuki: recognises the base by the reports that it sends 50 times a second."""

from collections.abc import Generator

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.kobuki.feedback import FEEDBACK, Core
from drivers.kobuki.wire import BAUD, KobukiFrameFinder, decode

LISTEN_TIME = 0.3
"""Seconds of listening: a Kobuki sends fifteen reports in that time."""


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Recognise a Kobuki by two reports."""
    heard = yield ProbeRequest(BAUD, timeout=LISTEN_TIME, is_complete=lambda heard: len(_reports(heard)) >= 2)
    reports = _reports(heard)
    return ProbeResult(f"a Kobuki, its battery at {reports[-1].voltage:.1f} V") if reports else None


def _reports(heard: bytes) -> list[Core]:
    parts = (part for payload in KobukiFrameFinder().feed(heard) for part in decode(payload, FEEDBACK).parts)
    return [part for part in parts if isinstance(part, Core)]
