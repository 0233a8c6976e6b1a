"""What pyax12 sees and does on a chain of AX servos: PORT as argument, one JSON object as the answer.

A program of its own, which knows nothing of ours. The chain holds the IDs 1 and 2.
"""

import json
import sys
from threading import Event
from time import monotonic

from pyax12.connection import Connection

REPLY_TIMEOUT = 10.0
"""Seconds in which a servo must have arrived."""


def main(port: str) -> dict[str, object]:
    """Scan, read and move. (It waits a fixed time for each reply.)"""
    servos = Connection(port=port, baudrate=1_000_000, waiting_time=0.1)
    try:
        seen: dict[str, object] = {
            "found": list(servos.scan(range(1, 4))),
            "model": servos.get_model_number(1),
            "volts": servos.get_present_voltage(1),
            "degrees celsius": servos.get_present_temperature(1),
            "rate": servos.get_baud_rate(1),
        }
        servos.goto(2, 45, speed=400, degrees=True)
        end = monotonic() + REPLY_TIMEOUT
        while servos.is_moving(2) and monotonic() < end:
            Event().wait(0.01)
        seen["position"] = servos.get_present_position(2, degrees=True)
        seen["bytes"] = len(servos.dump_control_table(2))
        return seen
    finally:
        servos.close()


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(sys.argv[1])))
