"""An IMU of WitMotion's is recognised by its reports: it is only listened to."""

from collections.abc import Generator

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.witmotion.wire import WitMotionReportFinder

BAUD_RATES = (115_200, 9_600)
"""The rate that it should be set to, and the one that it comes with."""


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Listen for reports, of which it sends ten a second as it comes."""
    for baud in BAUD_RATES:
        heard = yield ProbeRequest(baud, timeout=0.4, is_complete=_has_report)
        if _has_report(heard):
            return ProbeResult("an IMU of WitMotion's", {"baud": baud})
    return None


def _has_report(data: bytes) -> bool:
    return next(WitMotionReportFinder().feed(data), None) is not None
