"""An IMU of WitMotion's is recognised by its reports: it is only listened to."""

from collections.abc import Generator

from drivers.api.probing import Answer, Ask
from drivers.witmotion.wire import Finder

RATES = (115_200, 9_600)
"""The rate that it should be set to, and the one that it comes with."""


def probe() -> Generator[Ask, bytes, Answer | None]:
    """Listen for reports, of which it sends ten a second as it comes."""
    for baud in RATES:
        heard = yield Ask(baud, wait=0.4, enough=_reports)
        if _reports(heard):
            return Answer("an IMU of WitMotion's", {"baud": baud})
    return None


def _reports(heard: bytes) -> bool:
    return next(Finder().feed(heard), None) is not None
