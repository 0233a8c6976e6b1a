"""Probe of a WitMotion IMU, recognised by its reports; nothing is sent."""

from collections.abc import Generator

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.witmotion.wire import WitMotionReportFinder

BAUD_RATES = (115_200, 9_600)
"""Baud rates of a WitMotion IMU: the recommended one, and the default."""


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Listen for reports, of which the IMU sends ten per second by default."""
    for baud in BAUD_RATES:
        data = yield ProbeRequest(baud, timeout=0.4, is_complete=_has_report)
        if _has_report(data):
            return ProbeResult("an IMU of WitMotion's", {"baud": baud})
    return None


def _has_report(data: bytes) -> bool:
    return next(WitMotionReportFinder().feed(data), None) is not None
