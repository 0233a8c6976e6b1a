"""What Feetech's own SDK for Python sees and does on a chain of three STS3215 with the IDs 1 to 3, of which 3 is hot.

A program of its own, which knows nothing of ours; PORT is its argument, one JSON object its answer.
"""

import json
import sys
from collections.abc import Callable
from threading import Event
from time import monotonic
from types import MethodType
from typing import Any

import scservo_sdk as sdk

REPLY_TIMEOUT = 10.0
"""Seconds in which a servo must have arrived."""

PATIENCE = 300.0
"""Milliseconds for a reply: the SDK's own are too few on a busy machine."""


def until(done: Callable[[], bool]) -> bool:
    """Wait until ``done``; return whether it was in time."""
    end = monotonic() + REPLY_TIMEOUT
    while not done() and monotonic() < end:
        Event().wait(0.01)
    return done()


def patient(port: Any, length: int) -> None:
    """Set the time for a reply; release 1.0.0 reckons with microseconds where it means milliseconds."""
    port.packet_start_time = port.getCurrentTime()
    port.packet_timeout = port.tx_time_per_byte * length + PATIENCE


def main(name: str) -> dict[str, Any]:
    """Have its way with the chain."""
    port, bus = sdk.PortHandler(name), sdk.PacketHandler(0)
    port.openPort()
    port.setBaudRate(1_000_000)
    port.setPacketTimeout = MethodType(patient, port)
    seen: dict[str, Any] = {"found": [n for n in range(1, 5) if bus.ping(port, n)[1] == sdk.COMM_SUCCESS]}
    seen["models"] = [bus.ping(port, n)[0] for n in (1, 2, 3)]
    seen["errors"] = [bus.getRxPacketError(bus.ping(port, n)[2]) for n in (1, 3)]
    for servo in (1, 2):
        bus.write1ByteTxRx(port, servo, 40, 1)
    goals = sdk.GroupSyncWrite(port, bus, 42, 6)
    for servo, goal in ((1, 2500), (2, 1500)):
        goals.addParam(servo, [goal & 0xFF, goal >> 8, 0, 0, 0xD0, 7])
    seen["sent"] = goals.txPacket()
    group = sdk.GroupSyncRead(port, bus, 56, 4)
    for servo in (1, 2, 3):
        group.addParam(servo)

    def positions() -> list[int]:
        result = group.txRxPacket()
        return [group.getData(n, 56, 2) for n in (1, 2, 3)] if result == sdk.COMM_SUCCESS else []

    seen["arrived"] = until(lambda: positions()[:2] == [2500, 1500])
    seen["positions"] = positions()
    seen["limits"] = [bus.read2ByteTxRx(port, 1, address)[0] for address in (9, 11)]
    bus.regWriteTxRx(port, 1, 42, 2, [2048 & 0xFF, 2048 >> 8])
    bus.action(port, sdk.BROADCAST_ID)
    seen["held until action"] = until(lambda: positions()[:1] == [2048])
    port.closePort()
    return seen


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(sys.argv[1])))
