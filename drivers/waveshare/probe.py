"""A rover of Waveshare's is recognised by one report that it is asked for."""

from collections.abc import Generator
from contextlib import suppress

from drivers.api.probing import Answer, Ask
from drivers.transport.lines import LineFinder
from drivers.waveshare import wire

BAUD = 115_200


def probe() -> Generator[Ask, bytes, Answer | None]:
    """Ask for a report, behind the end of whatever line was begun."""
    heard = yield Ask(BAUD, b"\n" + wire.command(wire.REPORT), 0.3, _reports)
    reports = _reports(heard)
    return Answer(f"a rover of Waveshare's, its battery at {reports[-1].volts:.1f} V") if reports else None


def _reports(heard: bytes) -> list[wire.Feedback]:
    found = []
    for line in LineFinder().feed(heard):
        with suppress(ValueError):
            if isinstance(told := wire.read(line), wire.Feedback):
                found.append(told)
    return found
