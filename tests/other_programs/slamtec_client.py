"""What Slamtec's own SDK sees of a range finder of theirs: PORT as argument, one JSON object as the answer.

A program of its own, which knows nothing of ours. The SDK comes compiled, in a package for Python.
"""

import json
import sys
from threading import Event
from time import monotonic

from pyrplidarsdk import RplidarDriver

PATIENCE = 20.0
"""Seconds in which a whole turn must have been measured."""


def main(port: str) -> dict[str, object]:
    """Ask who it is and how it is, and have it scan for a turn."""
    finder = RplidarDriver(port=port, baudrate=115200)
    seen: dict[str, object] = {"connected": finder.connect()}
    try:
        told, health = finder.get_device_info(), finder.get_health()
        seen |= {"model": told.model, "firmware": told.firmware_version, "health": health.status}
        seen["scans"] = finder.start_scan()
        end = monotonic() + PATIENCE
        while not (scan := finder.get_scan_data()) and monotonic() < end:
            Event().wait(0.05)
        seen["bearings"], seen["distances"], _ = scan or ([], [], [])
        finder.stop_scan()
    finally:
        finder.disconnect()
    return seen


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(sys.argv[1])))
