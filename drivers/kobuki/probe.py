"""Probe for a Kobuki: it is recognised by its reports, which it sends fifty times a second without a request."""

from collections.abc import Generator

from drivers.api.probing import Answer, Ask
from drivers.kobuki.feedback import FEEDBACK, Core
from drivers.kobuki.wire import BAUD, FrameFinder, decode

LISTEN = 0.3
"""Seconds of reading: fifteen reports arrive."""


def probe() -> Generator[Ask, bytes, Answer | None]:
    """Recognise a Kobuki by two reports."""
    heard = yield Ask(BAUD, wait=LISTEN, enough=lambda heard: len(_reports(heard)) >= 2)
    reports = _reports(heard)
    return Answer(f"a Kobuki, its battery at {reports[-1].voltage:.1f} V") if reports else None


def _reports(heard: bytes) -> list[Core]:
    parts = (part for payload in FrameFinder().feed(heard) for part in decode(payload, FEEDBACK).parts)
    return [part for part in parts if isinstance(part, Core)]
