"""What ten AX-12A cost to read and to send to goals, against the time that the bytes alone take on the wire.

The virtual chain plays that time at 1 Mbps, with a return delay of 0, and runs in a process of its own: this module as
a program. In one process the two would wait for each other's thread. Every figure is the least of several runs, for
whatever else the machine does can only make it worse.
"""

import contextlib
import itertools
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

from drivers.api import Coupling
from drivers.clock import SystemClock
from drivers.servos.bus import ServoAddress, ServoBus
from drivers.servos.driver import DynamixelJoints
from drivers.servos.joint import JointSpec
from drivers.servos.models import MODELS
from drivers.servos.poll_rate import MOVING_INTERVAL
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.terminal import PseudoTerminal
from tests.benchmarks.table import Row

SERVOS = 10
BAUD = 1_000_000
ROUNDS = 200
RUNS = 5
RATE = 100.0
"""Rounds a second of the arm's loop."""
FASTEST = 1000.0
"""A rate beyond what the wire can carry: the loop goes round as fast as it can."""
REPLY_TIMEOUT = 0.1
"""Seconds for which a reply is waited for where only the median counts: a shared machine may stop for a while."""
AWAKE = 0.003
"""Seconds for which the chain does not sleep after a byte: a wire needs no time to wake up, and a process does."""
WATCHED = 2.0
"""Seconds for which the driver is watched in one run."""

BLOCK = MODELS["AX-12A"].table.fast_block
ORDER = 4
"""Bytes of a goal with its speed."""

WIRE = (SERVOS * (8 + 6 + BLOCK.size) + 8 + SERVOS * (1 + ORDER)) * 10 / BAUD
"""Seconds that a read of each servo and a goal for each take on the wire: ten bits a byte, nothing between them."""


def rows() -> Iterator[Row]:
    """Yield what the wire, a missing servo and the processor say."""
    with chain(SERVOS) as port:
        period = min(round_time(port) for _ in range(RUNS))
        yield Row(f"{SERVOS} servos read, {SERVOS} goals, beside the wire", period, WIRE, period / WIRE, 1.3)
        period, share = map(min, zip(*(loop(port, SERVOS, RATE, moving=True) for _ in range(RUNS)), strict=True))
        yield Row(f"{SERVOS} joints on their way: period", period, MOVING_INTERVAL, period / MOVING_INTERVAL, 1.05)
        yield Row(f"{SERVOS} joints on their way: share of a core", share, 1.0, share, 0.15)
    with chain(SERVOS - 1) as port:
        pairs = [(loop(port, SERVOS - 1, FASTEST), loop(port, SERVOS, FASTEST)) for _ in range(RUNS)]
        nine, missing = (min(period for period, _ in runs) for runs in zip(*pairs, strict=True))
        yield Row(f"{SERVOS - 1} servos, beside without a missing one", missing, nine, missing / nine, 1.1)


def round_time(port: str) -> float:
    """Return the median seconds from one round to the next, as fast as the bus can."""
    bus = ServoBus(port, SystemClock(), reply_timeout=REPLY_TIMEOUT)
    bus.open()
    starts = []
    try:
        for number in range(ROUNDS):
            starts.append(time.perf_counter())
            for servo in range(1, SERVOS + 1):
                bus.read_block(ServoAddress(servo), BLOCK.address, BLOCK.size)
            goal = (500 + number % 20).to_bytes(2, "little") + b"\x64\x00"
            bus.sync_write_block(1, 30, dict.fromkeys(range(1, SERVOS + 1), goal))
    finally:
        bus.close()
    return statistics.median(later - earlier for earlier, later in itertools.pairwise(starts))


def loop(port: str, servos: int, rate: float, *, moving: bool = False) -> tuple[float, float]:
    """Let the driver go round; return the seconds between readings of a servo, and the share of a core that it takes.

    Only servos that are there count, and the whole process. ``moving`` sends every joint to a new goal in every round;
    else all follow the first, and are read as often as they can be.
    """
    joints = {f"joint {number}": JointSpec(number) for number in range(1, servos + 1)}
    turn = threading.Semaphore(0)
    clock = SystemClock()
    bus = ServoBus(port, clock)
    arm = DynamixelJoints(bus, joints, clock, rate=rate, changed=turn.release)
    arm.open()
    try:
        while not arm.health().online:
            if not turn.acquire(timeout=10.0):
                raise RuntimeError(f"the chain on {port} does not answer: {arm.health().detail}")
        arm.move(dict.fromkeys(joints, 0.0))
        if not moving:
            arm.follow([Coupling("joint 1", joint) for joint in joints if joint != "joint 1"])
        before, cpu, start = readings(bus), time.process_time(), time.perf_counter()
        while (passed := time.perf_counter() - start) < WATCHED:
            turn.acquire(timeout=1.0)
            if moving:
                arm.move(dict.fromkeys(joints, 0.3 * passed % 0.5))
        share = (time.process_time() - cpu) / passed
        return passed / (readings(bus) - before), share
    finally:
        arm.close()


def readings(bus: ServoBus) -> float:
    """Return how often each of the servos that every chain has was read, on average."""
    tallies = [bus.statistics(servo) for servo in range(1, SERVOS)]
    return statistics.mean(tally.tries - tally.misses - tally.corrupt for tally in tallies)


@contextlib.contextmanager
def chain(servos: int, model: str = "AX-12A") -> Iterator[str]:
    """Run a chain of so many servos in another process, and give its port."""
    command = [sys.executable, "-m", "tests.benchmarks.servoing", str(servos), model]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        if process.stdout is None:
            raise RuntimeError("the chain cannot tell its port")
        yield process.stdout.readline().strip()
        # Its input is closed next, and so it ends.


def run_chain(servos: int, model: str) -> None:
    """Be the chain until the input ends; tell its port first."""
    members = [VirtualServo(number, model=model) for number in range(1, servos + 1)]
    bus = VirtualServoBus(members, BAUD, paced=True)
    for servo in members:
        servo.set("return_delay", 0)
    terminal = PseudoTerminal("servos", bus, SystemClock(), busy_wait=AWAKE)
    terminal.open()
    try:
        print(terminal.path, flush=True)
        sys.stdin.read()
    finally:
        terminal.close()


if __name__ == "__main__":
    run_chain(int(sys.argv[1]), sys.argv[2])
