"""What pypot sees and does on a chain of servos: PORT as argument, one JSON object as the answer.

A program of its own, which knows nothing of ours. The chain holds the IDs 1 to 3; servo 2 is sent beyond its limits.
"""

import json
import sys
from collections.abc import Callable
from threading import Event
from time import monotonic

from pypot.dynamixel.io import DxlIO

REPLY_TIMEOUT = 10.0
"""Seconds in which all must have arrived."""


class Complaints:
    """Counts what the servos complain of."""

    def __init__(self) -> None:
        self.of_limits = 0

    def handle_angle_limit_error(self, instruction_packet: object) -> None:
        """Count it."""
        del instruction_packet
        self.of_limits += 1


def insist(write: Callable[[], None], taken: Callable[[], bool]) -> None:
    """Write until it is ``taken``.

    pypot empties the port's output before each request, and so loses a write that the other end has not read yet.
    """
    end = monotonic() + REPLY_TIMEOUT
    write()
    while not taken() and monotonic() < end:
        write()
        Event().wait(0.01)


def settle(io: DxlIO, ids: list[int]) -> None:
    """Wait until nothing moves any more."""
    end = monotonic() + REPLY_TIMEOUT
    while any(io.is_moving(ids)) and monotonic() < end:
        Event().wait(0.01)


def main(port: str) -> dict[str, object]:
    """Scan, read and move."""
    with DxlIO(port, baudrate=1_000_000, timeout=0.6) as io:
        seen: dict[str, object] = {"found": io.scan(range(1, 5))}
        ids = [1, 2, 3]
        seen["models"] = io.get_model(ids)
        seen["volts"] = io.get_present_voltage(ids)
        seen["degrees celsius"] = io.get_present_temperature(ids)
        insist(lambda: io.set_angle_limit({2: (-40, 40)}), lambda: bool(io.get_angle_limit([2])[0][1] < 50))
        seen["limits"] = io.get_angle_limit(ids)
        insist(lambda: io.enable_torque(ids), lambda: all(io.is_torque_enabled(ids)))
        insist(lambda: io.set_moving_speed(dict.fromkeys(ids, 300)), lambda: min(io.get_moving_speed(ids)) > 100)
        insist(lambda: io.set_goal_position({1: 30, 2: 90, 3: -30}), lambda: bool(io.get_goal_position([3])[0] < -20))
        settle(io, ids)
        seen["positions"] = io.get_present_position(ids)
        seen["goals"] = io.get_goal_position(ids)
        complaints = Complaints()
        io.get_present_position([2], error_handler=complaints)
        seen["complaints of limits"] = complaints.of_limits
        insist(lambda: io.disable_torque(ids), lambda: not any(io.is_torque_enabled(ids)))
        seen["stiff"] = io.is_torque_enabled(ids)
        return seen


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(sys.argv[1])))
