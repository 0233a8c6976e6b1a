"""What LeRobot's own bus of Feetech motors sees and does on a chain of STS3215.

What it does and a PORT are its arguments: ``all`` with three servos of the IDs 1 to 3, ``alone`` with one of any ID,
``timed`` with six, ``recognised`` with those of a calibration file, which comes last. A program of its own, which knows
nothing of ours; one JSON object is its answer. Of torch and its like LeRobot's motors use nothing, but a module that
they import does: here stand-ins are in their place, and in that of deepdiff.
"""

import io
import json
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from statistics import median
from threading import Event
from time import monotonic, perf_counter
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

for missing in ("torch", "accelerate", "datasets", "datasets.utils", "datasets.utils.logging", "deepdiff"):
    sys.modules.setdefault(missing, MagicMock())

from lerobot.motors import Motor, MotorNormMode, motors_bus  # noqa: E402 - once torch is stood in for
from lerobot.motors.feetech import FeetechMotorsBus  # noqa: E402

NAMES = ("pan", "elbow", "jaw")
PATIENCE = 2000.0
"""Milliseconds in which a servo must have answered."""

REPLY_TIMEOUT = 10.0
"""Seconds in which a servo must have arrived."""


def until(done: Callable[[], bool]) -> bool:
    """Wait until ``done``; return whether it was in time."""
    end = monotonic() + REPLY_TIMEOUT
    while not done() and monotonic() < end:
        Event().wait(0.01)
    return done()


def made(port: str, *, bodies: MotorNormMode = MotorNormMode.DEGREES) -> Any:
    """Return LeRobot's bus for the three; it waits for longer than its 50 ms, since servos share a busy machine."""
    modes = (bodies, bodies, MotorNormMode.RANGE_0_100)
    bus = FeetechMotorsBus(
        port, {n: Motor(i, "sts3215", m) for i, (n, m) in enumerate(zip(NAMES, modes, strict=True), 1)}
    )
    bus.port_handler.setPacketTimeout = lambda _: bus.port_handler.setPacketTimeoutMillis(PATIENCE)
    return bus


def calibrated(bus: Any, seen: dict[str, Any]) -> None:
    """Calibrate as ``lerobot-calibrate`` does: the middle, then ranges that are swept here, not by hand."""
    bus.disable_torque()
    seen["unlocked"] = [bus.read("Lock", name) for name in NAMES]
    seen["homings"] = bus.set_half_turn_homings()
    seen["homed"] = bus.sync_read("Present_Position", normalize=False, num_retry=5)
    looks = iter(({"pan": 1000, "elbow": 1000, "jaw": 2000}, {"pan": 3000, "elbow": 3100, "jaw": 3500}, None))
    bus.enable_torque()

    def swept() -> bool:
        goals = next(looks)
        if goals is None:
            return True
        bus.sync_write("Goal_Position", goals, normalize=False, num_retry=5)
        until(lambda: bus.sync_read("Present_Position", normalize=False, num_retry=5) == goals)
        return False

    motors_bus.enter_pressed = swept
    with redirect_stdout(io.StringIO()):
        lowest, highest = bus.record_ranges_of_motion()
    bus.disable_torque()
    offsets = seen["homings"]
    kinds = {n: motors_bus.MotorCalibration(i, 0, offsets[n], lowest[n], highest[n]) for i, n in enumerate(NAMES, 1)}
    bus.write_calibration(kinds)
    seen["calibration"] = {name: vars(each) for name, each in kinds.items()}
    seen["is calibrated"] = bus.is_calibrated


def main(port: str) -> dict[str, Any]:
    """Have its way with the chain."""
    bus = made(port)
    seen: dict[str, Any] = {"models": {}}
    bus.connect()
    seen["models"] = [bus.ping(name, num_retry=5) for name in NAMES]
    seen["firmware"] = sorted(set(bus._read_firmware_version(bus.ids).values()))
    seen["missing"] = bus.ping(9)
    bus.configure_motors()
    calibrated(bus, seen)
    bus.enable_torque()
    seen["locked"] = [bus.read("Lock", name) for name in NAMES]
    bus.sync_write("Goal_Position", {"pan": 30.0, "elbow": -40.0, "jaw": 25.0})
    goal = {"pan": 30.0, "elbow": -40.0, "jaw": 25.0}
    near = SimpleNamespace(at={})

    def there() -> bool:
        near.at = bus.sync_read("Present_Position", num_retry=5)
        return all(abs(near.at[name] - goal[name]) < 0.2 for name in goal)

    seen["arrived"] = until(there)
    seen["positions"] = near.at
    seen["moving"] = bus.sync_read("Moving", normalize=False, num_retry=5)
    bus.write("Goal_Position", "pan", 4000, normalize=False, num_retry=5)  # beyond its limits
    until(lambda: bus.read("Present_Position", "pan", normalize=False, num_retry=5) >= 3000)
    seen["beyond the limits"] = bus.read("Present_Position", "pan", normalize=False, num_retry=5)
    seen["negative goal"] = _signed(bus)
    seen["load"] = bus.read("Present_Load", "elbow", normalize=False, num_retry=5)
    bus.disconnect()
    return seen


def _signed(bus: Any) -> list[int]:
    """Write speeds below zero, and read them back."""
    bus.disable_torque("jaw")
    bus.write("Goal_Velocity", "jaw", -321, normalize=False, num_retry=5)
    bus.write("Homing_Offset", "jaw", -1234, normalize=False, num_retry=5)
    told = [
        bus.read("Goal_Velocity", "jaw", normalize=False, num_retry=5),
        bus.read("Homing_Offset", "jaw", normalize=False, num_retry=5),
    ]
    bus.write("Goal_Velocity", "jaw", 0, normalize=False, num_retry=5)
    return told


def alone(port: str) -> dict[str, Any]:
    """Find the one motor on the port at whatever rate, and make it the elbow, as ``lerobot-setup-motors`` does."""
    bus = made(port)
    bus.setup_motor("elbow")
    found = bus.ping("elbow", num_retry=5)
    bus.port_handler.closePort()
    return {"found": found, "at": bus.get_baudrate()}


def recognised(port: str, file: str) -> dict[str, Any]:
    """Take a calibration file for its own; tell whether the motors are set so, and where they stand by it."""
    told = json.loads(Path(file).read_text(encoding="utf-8"))
    kinds = {name: motors_bus.MotorCalibration(**each) for name, each in told.items()}
    motors = {name: Motor(each.id, "sts3215", MotorNormMode.DEGREES) for name, each in kinds.items()}
    bus = FeetechMotorsBus(port, motors, kinds)
    bus.connect()
    seen = {"is calibrated": bus.is_calibrated, "positions": bus.sync_read("Present_Position", num_retry=5)}
    bus.disconnect()
    return seen


def timed(port: str) -> dict[str, Any]:
    """Read where six motors stand and send each a goal, 200 times; return the median seconds of a round."""
    motors = {f"motor {i}": Motor(i, "sts3215", MotorNormMode.DEGREES) for i in range(1, 7)}
    bus, rounds = FeetechMotorsBus(port, motors), list[float]()
    bus.connect(handshake=False)
    for number in range(200):
        begun = perf_counter()
        bus.sync_read("Present_Position", normalize=False, num_retry=5)
        bus.sync_write("Goal_Position", dict.fromkeys(motors, 2000 + number % 20), normalize=False, num_retry=5)
        rounds.append(perf_counter() - begun)
    bus.disconnect(disable_torque=False)
    return {"median": median(rounds)}


if __name__ == "__main__":
    does: dict[str, Callable[..., dict[str, Any]]]
    does = {"alone": alone, "timed": timed, "all": main, "recognised": recognised}
    sys.stdout.write(json.dumps(does[sys.argv[1]](*sys.argv[2:])))
