"""Whether a scan can be worked with: a range finder from outside, or a node, may send anything."""

from math import isfinite

from drivers.api import RangeScan


def flaw_of(scan: RangeScan) -> str:
    """Return why a scan cannot be used, or nothing. One that sees nothing can be."""
    if getattr(scan.ranges, "ndim", 0) != 1:
        return "its scan is not an array of one dimension"
    if not len(scan.ranges):
        return "its scan has no beams"
    if not (isfinite(scan.start) and isfinite(scan.step) and scan.step > 0.0):
        return f"its scan begins at {scan.start} rad with a step of {scan.step} rad between beams"
    if not isfinite(scan.stamp):
        return f"its scan has the time {scan.stamp}"
    return ""
