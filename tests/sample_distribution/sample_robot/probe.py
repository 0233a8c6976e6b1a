"""How the rover is recognised on a serial port."""

from collections.abc import Generator

from drivers.api.probing import Answer, Ask

BAUD = 38_400


def rover() -> Generator[Ask, bytes, Answer | None]:
    """Listen for its reports, of which it sends fifty a second."""
    heard = yield Ask(BAUD, wait=0.2, enough=lambda heard: heard.count(b"\no ") > 1)
    return Answer("a rover", {"baud": BAUD}) if heard.count(b"\no ") > 1 else None
