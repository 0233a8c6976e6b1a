"""The sketch of docs/keeper_head, compiled for the host and run against the driver, in simulated time."""

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from math import radians
from pathlib import Path
from random import Random

import pytest

from drivers.api import DeviceStatus, HeadPose
from drivers.errors import DriverError
from drivers.head.angle_store import ServoAngleStore
from drivers.head.axis import ServoAxis
from drivers.head.guardian_head import MAX_REPORT_AGE, GuardianHead
from drivers.head.pantilt import MAX_CATCH_UP
from drivers.sim.timeline import Timeline
from drivers.transport import guardian_wire
from tests.drivers.cranked import HandWire, pass_until
from tests.drivers.damaged import MISHAPS, Damaged
from tests.tries import tries

ROOT = Path(__file__).parents[2]
SKETCH = ROOT / "docs/keeper_head/keeper_head.ino"
HOST = Path(__file__).parent / "sketch"
TRANSACTIONS = tries(2500, most=10_000)
SPEED = 120
STEP = 3
"""Degrees of the widest step: one that the sketch makes, and two that it made unheard before it began anew."""

RAMP = SPEED * (MAX_REPORT_AGE + MAX_CATCH_UP) + 2
"""The same where its answers are lost: what the driver leads it on between two of them."""


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sketch as a program of the host."""
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("no g++ here: apt install g++")
    made = tmp_path_factory.mktemp("sketch") / "sketch"
    subprocess.run(
        [
            *(compiler, "-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsanitize=undefined", "-fno-sanitize-recover"),
            *("-include", str(HOST / "Arduino.h"), "-I", str(HOST), f'-DSKETCH="{SKETCH}"'),
            *(str(HOST / "host.cpp"), "-o", str(made)),
        ],
        check=True,
    )
    return made


class Board:
    """A ``drivers.virtual.terminal.WireDevice``: the sketch as it runs. ``sent`` is all that its servos got."""

    baud = guardian_wire.BAUD

    def __init__(self, program: Path) -> None:
        self._program = program
        self._kept = 0xFFFF
        self._process: subprocess.Popen[str] | None = None
        self.sent: list[tuple[int, int]] = []
        self.starts = 0

    def feed(self, data: bytes, now: float) -> bytes:
        """Let the computer say something."""
        process = self._running()
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(f"{round(1000 * now)} {data.hex()}\n")
        process.stdin.flush()
        said, first, second, kept = process.stdout.readline().split()
        at = (int(first), int(second))
        if at != (-1, -1) and at != (self.sent[-1] if self.sent else None):
            self.sent.append(at)
        self._kept = int(kept)
        return bytes.fromhex(said[1:])

    def poll(self, now: float) -> bytes:
        """Let time pass."""
        return self.feed(b"", now)

    @property
    def widest(self) -> int:
        """The widest step in degrees that a servo was sent."""
        return max(
            (abs(b - a) for one, other in pairwise(self.sent) for a, b in zip(one, other, strict=True)), default=0
        )

    def reset(self) -> None:
        """Press its reset button, or take its power away: its EEPROM stays."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def _running(self) -> "subprocess.Popen[str]":
        if self._process is None:
            self.starts += 1
            command = [str(self._program), str(self._kept)]
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        return self._process


class Bench:
    """The sketch, and its driver on a wire that is turned by hand."""

    def __init__(self, program: Path, remembered: ServoAngleStore | None = None) -> None:
        self.timeline = Timeline()
        self.timeline.run_until(1.0)
        self.clock = self.timeline.clock
        self.notices: list[DeviceStatus] = []
        self.board = Board(program)
        self.wire = HandWire(self.board, self.timeline)
        self.head = self.driver(remembered)

    def driver(self, remembered: ServoAngleStore | None = None) -> GuardianHead:
        """Return another driver for the same board."""
        return GuardianHead(
            self.wire.link("head", report=self.notices.append),
            self.clock,
            pan=ServoAxis(0, radians(-80), radians(80), start=90),
            tilt=ServoAxis(1, radians(-60), radians(20), flip=True, start=90),
            speed=radians(SPEED),
            acceleration=radians(400),
            report=self.notices.append,
            angle_store=remembered,
        )

    def start(self) -> "Bench":
        self.head.open()
        pass_until(self.timeline, lambda: self.head.health().online)
        return self

    def passes(self, seconds: float) -> None:
        self.timeline.run_until(self.clock.now() + seconds)

    def looks(self, pan: float, tilt: float = 0.0, *, lasting: float = 2.0) -> None:
        self.head.look(HeadPose(radians(pan), radians(tilt)))
        self.passes(lasting)

    def faults(self) -> list[str]:
        return [notice.message for notice in self.notices if notice.kind == "fault"]


@pytest.fixture
def bench(program: Path) -> Iterator[Bench]:
    bench = Bench(program)
    yield bench
    bench.head.close()
    bench.board.reset()


def test_servos_do_not_move_before_the_first_command(bench: Bench) -> None:
    bench.start().passes(2.0)
    assert bench.board.sent == []
    assert ["may leap" in fault for fault in bench.faults()] == [True]
    bench.looks(45, 10)
    assert bench.board.sent[-1] == (135, 80)
    pose = bench.head.pose().value
    assert pose is not None
    assert (pose.pan, pose.tilt) == pytest.approx((radians(45), radians(10)))
    bench.looks(-80, -60)
    assert bench.board.sent[-1] == (10, 150)
    assert bench.board.widest <= STEP


def test_watchdog_stops_the_ramp_without_commands(bench: Bench) -> None:
    bench.start().looks(0)
    (report,) = {
        guardian_wire.parse_line(line)
        for line in bench.board.feed(guardian_wire.REPORT_REQUEST, bench.clock.now()).splitlines()
    }
    assert isinstance(report, guardian_wire.GuardianReport)
    bench.head.close()
    bench.board.feed(guardian_wire.pack_command(report.boot, 180, 90), bench.clock.now())
    for step in range(100):
        bench.board.poll(bench.clock.now() + 0.02 * step)
    pan, tilt = bench.board.sent[-1]
    assert 90 < pan < 180
    assert tilt == 90
    assert bench.board.widest <= STEP


def test_commands_for_an_earlier_boot_move_nothing(bench: Bench) -> None:
    bench.start().looks(0)
    before = len(bench.board.sent)
    for boot in (0, 1, 31999):
        bench.board.feed(guardian_wire.pack_command(boot, 180, 180), bench.clock.now())
    bench.passes(1.0)
    assert len(bench.board.sent) == before


def test_reset_in_mid_move_stops_the_head_until_a_new_command(bench: Bench) -> None:
    bench.start().looks(70, lasting=0.4)
    bench.board.reset()
    bench.passes(2.0)
    left = bench.board.sent[-1]
    assert left[0] < 155
    assert any("has restarted" in fault for fault in bench.faults())
    assert bench.head.health().reconnected_at is not None
    bench.looks(70)
    assert bench.board.sent[-1][0] == 160
    assert bench.board.widest <= STEP
    assert bench.board.starts == 2


def test_unplugged_in_mid_move_and_plugged_in_again_nothing_leaps(bench: Bench) -> None:
    bench.start().looks(70, lasting=0.4)
    bench.wire.unplug()
    bench.board.reset()  # the plug is where it has its power from
    bench.passes(1.5)
    bench.wire.plug_in()
    pass_until(bench.timeline, lambda: bench.head.health().online)
    moved = len(bench.board.sent)
    bench.passes(1.0)
    assert len(bench.board.sent) == moved
    bench.looks(0)
    assert bench.board.sent[-1] == (90, 90)
    assert bench.board.widest <= STEP


def test_servo_angles_are_restored_by_the_next_program(bench: Bench, tmp_path: Path) -> None:
    port = tmp_path / "nano"
    port.touch()
    bench.head = bench.driver(ServoAngleStore(tmp_path, str(port)))
    bench.start().looks(40)
    bench.head.close()
    bench.board.reset()  # a Nano starts anew when its port is opened
    bench.notices.clear()
    bench.head = bench.driver(ServoAngleStore(tmp_path, str(port)))
    bench.start().passes(2.0)
    assert bench.faults() == []
    assert bench.board.sent[-1] == (90, 90), "it goes to its start"
    assert bench.board.widest <= STEP


def test_thousands_of_questions_with_every_mishap_and_resets_and_no_leap(bench: Bench) -> None:
    random = Random(5)  # noqa: S311 - it must be repeatable, and guards nothing
    bench.start()
    damaged = Damaged(bench.wire, seed=5)
    reports = 0
    while (reports := bench.head.health().counters["reports"]) < TRANSACTIONS:
        with suppress(DriverError):
            bench.head.enable()
            bench.head.look(HeadPose(radians(random.uniform(-80, 80)), radians(random.uniform(-60, 20))))
        bench.passes(random.choice((0.1, 0.5, 1.5)))
        if random.random() < 0.02:
            bench.board.reset()
            bench.passes(1.0)
    assert reports >= TRANSACTIONS
    assert bench.board.widest <= RAMP
    assert bench.board.starts > TRANSACTIONS / 2000
    assert len(bench.board.sent) > TRANSACTIONS / 2
    assert bench.head.health().counters["malformed"] > TRANSACTIONS / 100
    assert min(damaged.faults.happened[kind] for kind in MISHAPS) > TRANSACTIONS / 200
