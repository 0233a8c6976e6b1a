"""What the plain Dynamixel SDK sees and does on a chain of servos: PROTOCOL (1 or 2) and PORT as arguments.

A program of its own, which knows nothing of ours; one JSON object is its answer. With protocol 1.0 the chain holds an
AX with the ID 1 and MX with the IDs 2 and 3; with 2.0 XL430 with the IDs 1 to 3, of which 3 has shut down.
"""

import json
import sys
from collections.abc import Callable
from threading import Event
from time import monotonic
from typing import Any

import dynamixel_sdk as sdk
from dynamixel_sdk import port_handler

LATENCY = 150
"""Milliseconds; the SDK waits twice as long for each reply. Its own 16 are too few on a busy machine."""

REPLY_TIMEOUT = 10.0
"""Seconds in which a servo must have arrived, or started anew."""

BROADCAST = 254


def until(done: Callable[[], bool]) -> bool:
    """Wait until ``done``; return whether it was in time."""
    end = monotonic() + REPLY_TIMEOUT
    while not done() and monotonic() < end:
        Event().wait(0.01)
    return done()


def little(value: int, size: int) -> list[int]:
    """Return the bytes of ``value``."""
    return list(value.to_bytes(size, "little"))


def read_together(group: Any, wanted: dict[int, tuple[int, int]], exchange: Callable[[], int]) -> list[int | None]:
    """Ask for what is wanted of each servo; return the values that came."""
    result = exchange()
    return [group.getData(n, *what) if result == sdk.COMM_SUCCESS else None for n, what in wanted.items()]


def bulk_read(port: Any, bus: Any, group: Any, count: int) -> int:
    """Do what ``group.txRxPacket`` should: release 4.1.0 hands its packet handler one argument too many there."""
    group.makeParam()
    bus.bulkReadTx(port, group.param, 3 * count)
    return int(group.rxPacket())


def first_protocol(port: Any) -> dict[str, object]:
    """Do everything that the SDK can with protocol 1.0."""
    bus = sdk.Protocol1PacketHandler()
    seen: dict[str, object] = {"found": [n for n in range(1, 5) if bus.ping(port, n)[1] == sdk.COMM_SUCCESS]}
    seen["models"] = [bus.ping(port, n)[0] for n in (1, 2, 3)]
    seen["refused"] = bus.write1ByteTxRx(port, 1, 24, 5)
    goals = sdk.GroupSyncWrite(port, bus, 30, 4)
    for servo, goal in ((1, 600), (2, 2500), (3, 1500)):
        goals.addParam(servo, little(goal, 2) + little(400, 2))
    goals.txPacket()
    until(lambda: not any(bus.read1ByteTxRx(port, servo, 46)[0] for servo in (1, 2, 3)))
    seen["positions"] = [bus.read2ByteTxRx(port, servo, 36)[0] for servo in (1, 2, 3)]
    group, wanted = sdk.GroupBulkRead(port, bus), {2: (30, 2), 3: (36, 2)}
    for servo, what in wanted.items():
        group.addParam(servo, *what)
    seen["bulk read"] = read_together(group, wanted, lambda: bulk_read(port, bus, group, len(wanted)))
    bus.regWriteTxRx(port, 1, 25, 1, [1])
    bus.action(port, BROADCAST)
    seen["led"] = bus.read1ByteTxRx(port, 1, 25)[0]
    seen["reset of the AX"] = bus.factoryReset(port, 1)
    port.setBaudRate(57_600)
    seen["at another rate"] = bus.ping(port, 1)[1] == sdk.COMM_RX_TIMEOUT
    return seen


def second_protocol(port: Any) -> dict[str, object]:
    """Do everything that the SDK can with protocol 2.0."""
    bus = sdk.Protocol2PacketHandler()
    found, _ = bus.broadcastPing(port)
    seen: dict[str, object] = {"found": {str(n): model for n, (model, _) in found.items()}}
    seen["alert of 3"] = bus.read1ByteTxRx(port, 3, 70)
    bus.reboot(port, 3)
    seen["silent while it starts"] = bus.ping(port, 3)[1] == sdk.COMM_RX_TIMEOUT
    until(lambda: bool(bus.ping(port, 3)[1] == sdk.COMM_SUCCESS))
    seen["error of 3 after a reboot"] = bus.read1ByteTxRx(port, 3, 70)
    for servo in (1, 2, 3):
        bus.write1ByteTxRx(port, servo, 64, 1)
    goals = sdk.GroupSyncWrite(port, bus, 112, 8)
    for servo, goal in ((1, 2148), (2, 1948), (3, 2248)):
        goals.addParam(servo, little(100, 4) + little(goal, 4))
    goals.txPacket()
    until(lambda: not any(bus.read1ByteTxRx(port, servo, 122)[0] for servo in (1, 2, 3)))
    together, places = sdk.GroupSyncRead(port, bus, 132, 4), {1: (132, 4), 2: (132, 4), 3: (132, 4)}
    for servo in places:
        together.addParam(servo)
    seen["sync read"] = read_together(together, places, together.txRxPacket)
    seen["fast sync read"] = read_together(together, places, together.fastSyncRead)
    bulk, wanted = sdk.GroupBulkRead(port, bus), {1: (144, 2), 3: (146, 1)}
    for servo, what in wanted.items():
        bulk.addParam(servo, *what)
    seen["bulk read"] = read_together(bulk, wanted, bulk.txRxPacket)
    seen["fast bulk read"] = read_together(bulk, wanted, bulk.fastBulkRead)
    writes = sdk.GroupBulkWrite(port, bus)
    writes.addParam(1, 65, 1, [1])
    writes.addParam(2, 104, 4, little(50, 4))
    writes.txPacket()
    seen["bulk write"] = [bus.read1ByteTxRx(port, 1, 65)[0], bus.read4ByteTxRx(port, 2, 104)[0]]
    seen["EEPROM under torque"] = bus.write1ByteTxRx(port, 1, 9, 0)
    seen["beyond the limits"] = bus.write4ByteTxRx(port, 1, 116, 4096)
    bus.write1ByteTxRx(port, 1, 64, 0)
    seen["EEPROM without"] = bus.write1ByteTxRx(port, 1, 9, 0)
    return seen


def main(protocol: str, path: str) -> dict[str, object]:
    """Open the port and do what the protocol allows."""
    port_handler.LATENCY_TIMER = LATENCY
    port = sdk.PortHandler(path)
    port.openPort()
    try:
        return first_protocol(port) if protocol == "1" else second_protocol(port)
    finally:
        port.closePort()


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(*sys.argv[1:])))
