"""What six Feetech STS3215 cost to read and to send to goals at 1 Mbps, beside the wire, Feetech's SDK and LeRobot.

And how late a follower is that copies a leader, a hundred times a second: each arm on a port of its own, both in a
process beside this one, which swings the leader to and fro and looks at both. Every figure is the least of several
runs. The virtual servos have no inertia: what a motor takes to speed up is not in it.
"""

import contextlib
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib.util import find_spec
from math import radians
from pathlib import Path
from threading import Event, Thread
from types import MethodType
from typing import Any

from behaviours.joint_motion import JointMirror
from drivers.api import Coupling
from drivers.clock import SystemClock
from drivers.servos.bus import ServoAddress, ServoBus
from drivers.servos.driver import DynamixelJoints
from drivers.servos.joint import JointSpec
from drivers.servos.models import MODELS
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.terminal import PseudoTerminal
from tests.benchmarks.servoing import AWAKE, BAUD, ROUNDS, RUNS, chain
from tests.benchmarks.table import Row

STS = "STS3215"
SERVOS = range(1, 7)
PATIENCE = 0.5
"""Seconds for which a reply is waited for where only the median counts: a shared machine may stop for a while."""
BLOCK = MODELS[STS].table.fast_block
ORDER = 6
"""Bytes of a goal, no time, and its speed."""

CLIENT = Path(__file__).parent.parent / "other_programs" / "lerobot_client.py"
NAMES = {f"joint {number}": JointSpec(number, STS, lower=-2.0, upper=2.0, speed=3.0) for number in SERVOS}
PERIOD = 0.01
SWING, PACE = radians(40), radians(60)
"""The leader swings so far either way, at this speed (rad/s): 1.3 s each way."""

SETTLED = 0.2
"""Seconds after a turn in which the follower is not looked at: there a lag is no distance."""

WARM = 4.0
"""Seconds after which the follower has come over for sure."""

LOOK = 0.002
"""Seconds between two looks, and between two places of the leader."""

WATCHED = 8.0
"""Seconds for which a pair is watched in one run."""


def rows() -> Iterator[Row]:
    """Yield what the wire, the others and a leader say."""
    with chain(len(SERVOS), STS) as port:
        runs = [(ours(port), theirs(port), lerobots(port)) for _ in range(RUNS)]
    period, sdk, lerobot = map(min, zip(*runs, strict=True))
    beside = on_wire(BLOCK.size, ORDER)
    yield Row("6 STS read, 6 goals, beside the wire", period, beside, period / beside, 1.3)
    if find_spec("scservo_sdk"):
        yield Row("6 STS, the same by Feetech's SDK, beside it", sdk, beside, sdk / beside)
    if find_spec("lerobot"):
        less = on_wire(2, 2)
        yield Row("6 STS, positions alone, LeRobot beside wire", lerobot, less, lerobot / less)
    lags = [watched() for _ in range(2)]
    median, worst = (min(lag[place] for lag in lags) for place in (0, 1))
    yield Row("follower behind its leader: median", median, PERIOD, median / PERIOD, 2.0)
    yield Row("follower behind its leader: 99th percentile", worst, PERIOD, worst / PERIOD)


def on_wire(read: int, order: int) -> float:
    """Return the seconds that a sync read of so many bytes, and a sync write, take on the wire."""
    return (8 + len(SERVOS) + len(SERVOS) * (6 + read) + 8 + len(SERVOS) * (1 + order)) * 10 / BAUD


def ours(port: str) -> float:
    """Return the median seconds from one round to the next, as fast as the bus can."""
    bus = ServoBus(port, SystemClock(), reply_timeout=PATIENCE)
    bus.open()
    wanted = {ServoAddress(number, "STS"): BLOCK for number in SERVOS}

    def turn(number: int) -> bool:
        found = bus.read_many(wanted, mode="sync")
        goal = (2000 + number % 20).to_bytes(2, "little") + b"\0\0\xe8\x03"
        bus.sync_write_block("STS", 42, dict.fromkeys(SERVOS, goal))
        for at in wanted.keys() - found.keys():
            bus.read_block(at, BLOCK.address, BLOCK.size)
        return len(found) == len(wanted)

    try:
        return median_of(turn)
    finally:
        bus.close()


def theirs(port: str) -> float:
    """Return the same by Feetech's own SDK; infinity without it."""
    if find_spec("scservo_sdk") is None:
        return float("inf")
    import scservo_sdk as sdk  # noqa: PLC0415

    line, packets = sdk.PortHandler(port), sdk.PacketHandler(0)

    def patient(self: Any, length: int) -> None:
        self.packet_start_time = self.getCurrentTime()
        self.packet_timeout = self.tx_time_per_byte * length + 1000 * PATIENCE

    line.openPort()
    line.setBaudRate(BAUD)
    line.setPacketTimeout = MethodType(patient, line)
    reader = sdk.GroupSyncRead(line, packets, BLOCK.address, BLOCK.size)
    writer = sdk.GroupSyncWrite(line, packets, 42, ORDER)
    for servo in SERVOS:
        reader.addParam(servo)

    def turn(number: int) -> bool:
        complete: bool = reader.txRxPacket() == sdk.COMM_SUCCESS
        line.is_using = False  # it stays set after a miss
        writer.clearParam()
        for servo in SERVOS:
            writer.addParam(servo, [*(2000 + number % 20).to_bytes(2, "little"), 0, 0, 0xE8, 3])
        writer.txPacket()
        return complete

    try:
        return median_of(turn)
    finally:
        line.closePort()


def median_of(turn: Callable[[int], bool]) -> float:
    """Return the median seconds of a turn, of those in which all have answered."""
    taken = []
    for number in range(ROUNDS):
        begun = time.perf_counter()
        if turn(number):
            taken.append(time.perf_counter() - begun)
    return statistics.median(taken) if len(taken) > ROUNDS / 2 else float("inf")


def lerobots(port: str) -> float:
    """Return what LeRobot's bus takes to read positions and send goals; infinity without it."""
    if find_spec("lerobot") is None:
        return float("inf")
    done = subprocess.run([sys.executable, str(CLIENT), "timed", port], capture_output=True, text=True, check=False)
    return float(json.loads(done.stdout)["median"]) if done.returncode == 0 else float("inf")


def watched() -> tuple[float, float]:
    """Mirror for a while; return the median and the 99th percentile of how late (s) the follower is."""
    with swinging() as (process, ports):
        clock = SystemClock()
        leader, follower = (
            DynamixelJoints(ServoBus(port, clock, reply_timeout=PATIENCE), NAMES, clock) for port in ports
        )
        try:
            for arm in (leader, follower):
                arm.open()
                while not all(reading.good for reading in arm.states().values()):
                    Event().wait(0.05)
            leader.relax()
            read, end = Event(), clock.now() + WATCHED
            leader.poll_fast(NAMES, read.set)
            mirroring = JointMirror(leader, follower, [Coupling(name, name) for name in NAMES])
            while clock.now() < end:
                read.wait(0.05)
                read.clear()
                mirroring.step(clock.now())
            told, _ = process.communicate("")
        finally:
            follower.close()
            leader.close()
    lags: list[float] = sorted(json.loads(told))
    return statistics.median(lags), lags[int(0.99 * len(lags))]


@contextlib.contextmanager
def swinging() -> Iterator[tuple[subprocess.Popen[str], list[str]]]:
    """Run two arms in another process; give their ports. It tells all lags once its input ends."""
    command = [sys.executable, "-m", "tests.benchmarks.teleoperating"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        if process.stdout is None:
            raise RuntimeError("the arms cannot tell their ports")
        yield process, process.stdout.readline().split()


def run_arms() -> None:
    """Be both arms, swing the leader and look at both, until the input ends; tell the ports first, all lags at last."""
    clock, ended, lags = SystemClock(), Event(), list[tuple[float, float]]()
    chains = [VirtualServoBus([VirtualServo(n, model=STS) for n in SERVOS], BAUD, paced=True) for _ in range(2)]
    leader, follower = (PseudoTerminal(f"arm{n}", chain, clock, busy_wait=AWAKE) for n, chain in enumerate(chains))
    for terminal in (leader, follower):
        terminal.open()
    print(leader.path, follower.path, flush=True)
    Thread(target=wait_for_the_end, args=(ended,), daemon=True).start()
    now = clock.now()
    while not ended.wait(LOOK):
        now = clock.now()
        turns, part = divmod(now * PACE / SWING, 2.0)  # it turns round where a part is 0
        way = 1 if turns % 2 else -1
        place = way * (part - 1.0) * SWING
        leader.call_paused(partial(turn, chains[0].servos, place))
        angles = follower.call_paused(partial(seen, chains[1].servos, now))
        if now > WARM and part * SWING / PACE > SETTLED:
            lags += [(now, (place - there) * way / PACE) for there in angles]
    for terminal in (leader, follower):
        terminal.close()
    print(json.dumps([lag for at, lag in lags if at < now - SETTLED]))  # at the very end nobody mirrors any more


def wait_for_the_end(ended: Event) -> None:
    """Set ``ended`` once there is no more input."""
    sys.stdin.read()
    ended.set()


def turn(servos: Sequence[VirtualServo], place: float) -> None:
    """Turn servos by hand."""
    for servo in servos:
        servo.turn_by_hand(place)


def seen(servos: Sequence[VirtualServo], now: float) -> list[float]:
    """Return where servos stand by ``now``."""
    for servo in servos:
        servo.advance(now)
    return [servo.angle for servo in servos]


if __name__ == "__main__":
    run_arms()
