"""A Raspberry Pi car: its chip, its pins, and that its motors stand whatever becomes of the program that drives it."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from gpiozero import Device
from gpiozero.pins.mock import MockFactory, MockPWMPin

from drivers.clock import SystemClock
from drivers.errors import NotConnected
from drivers.pi_car import guardian
from drivers.pi_car.guardian import REST_TRIES, Pca9685, make_channel_motor, make_pin_motor, make_servos
from drivers.pi_car.make import COMMAND, GuardianLauncher, GuardianProcess, offline_hint
from drivers.transport import guardian_wire
from drivers.transport.ports import PortLostError, make_port_error
from tests.waiting import wait_until

MOCK = (sys.executable, "-m", "tests.drivers.mock_guardian")
ROOT = Path(__file__).parents[2]

THREE = {"forward": 17, "backward": 27, "enable": 12}
TWO = {"forward": 5, "backward": 6, "enable": None}
GPIO = {"motors": "gpio", "left": THREE, "right": TWO}
CHIP = {
    "motors": "pca9685",
    "bus": 1,
    "address": 0x40,
    "left": {"forward": 8, "backward": 9, "enable": None},
    "right": {"forward": 11, "backward": 12, "enable": 10},
}
HEAD = {"bus": 1, "address": 0x40, "pan": 0, "tilt": 1}

WITHIN = 1.0
"""Seconds in which motors stand: a watchdog of 0.3 s, and what a busy machine adds."""


class Chip:
    """A PCA9685 that was just switched on, at the other end of a bus."""

    def __init__(self) -> None:
        self.registers = {0x00: 0x11, 0x01: 0x04, 0xFE: 0x1E, **{9 + 4 * channel: 0x10 for channel in range(16)}}
        self.written: list[int] = []

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> Sequence[int]:
        assert i2c_addr == 0x40
        return [self.registers.get(register + place, 0) for place in range(length)]

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        assert i2c_addr == 0x40
        self.written.append(register)
        self.registers.update({register + place: byte for place, byte in enumerate(data)})

    def share(self, channel: int) -> float:
        """How much of the time a channel is on."""
        low, high, off_low, off_high = self.read_i2c_block_data(0x40, 6 + 4 * channel, 4)
        if off_high & 0x10:
            return 0.0
        return 1.0 if high & 0x10 else ((off_low + 256 * off_high) - (low + 256 * high)) / 4096


def woken(chip: Chip) -> Pca9685:
    """Return a chip as another program finds it."""
    board = Pca9685(chip, 0x40)
    board.wake()
    return board


# --- the chip and the pins --------------------------------------------------------------------------------------------


def test_chip_is_woken_at_50_hz_and_a_running_chip_is_left_alone() -> None:
    chip = Chip()
    Pca9685(chip, 0x40).wake()
    assert chip.registers[0xFE] == 121  # the data sheet's formula: 25 MHz / (4096 * 50 Hz) - 1
    assert not chip.registers[0x00] & 0x10
    assert chip.registers[0x00] & 0x20
    chip.written.clear()
    Pca9685(chip, 0x40).wake()
    assert chip.written == []


@pytest.mark.parametrize("degree", [0, 45, 90, 120, 180])
def test_servo_angle_becomes_arduino_pulses_and_is_read_back(degree: int) -> None:
    chip = Chip()
    board = woken(chip)
    assert board.read_angle(3) is None, "after it was switched on it sends nobody anywhere"
    board.set_angle(3, degree)
    assert chip.share(3) * 20_000 == pytest.approx(544 + (2400 - 544) * degree / 180, abs=3)
    board = woken(chip)
    assert board.read_angle(3) == degree
    board.set_duty_cycle(4, 1.0)
    assert board.read_angle(4) is None, "a motor's channel is no servo's"


def test_servos_start_at_the_angles_of_the_chip() -> None:
    chip = Chip()
    assert make_servos(woken(chip), 0, 1).positions() == (guardian_wire.UNKNOWN_ANGLE, guardian_wire.UNKNOWN_ANGLE)
    woken(chip).set_angle(1, 70)
    assert make_servos(woken(chip), 0, 1).positions() == (guardian_wire.UNKNOWN_ANGLE, 70)


def test_pulses_at_another_frequency_are_unknown_and_switched_off() -> None:
    chip = Chip()
    woken(chip).set_angle(0, 90)
    chip.registers[0xFE] = 101  # 60 Hz: the same counts are shorter pulses
    assert make_servos(woken(chip), 0, 1).positions() == (guardian_wire.UNKNOWN_ANGLE, guardian_wire.UNKNOWN_ANGLE)
    assert chip.share(0) == 0.0
    assert make_servos(woken(chip), 0, 1).positions() == (guardian_wire.UNKNOWN_ANGLE, guardian_wire.UNKNOWN_ANGLE)


OF_ADAFRUIT = {0: (111, 0), 45: (206, 0), 90: (45, 1), 135: (140, 1), 180: (235, 1)}
"""The off counts, low and high, that adafruit-circuitpython-pca9685 3.4.22 and -motor write for a servo's degrees, at
50 Hz and pulses of 544 to 2400 us; it cuts where we round."""


def test_chip_registers_match_the_vendor_library() -> None:
    chip = Chip()
    for degree, (low, high) in OF_ADAFRUIT.items():
        woken(chip).set_angle(0, degree)
        assert chip.registers[8] + 256 * chip.registers[9] == pytest.approx(low + 256 * high, abs=1)
        assert chip.registers[6] == chip.registers[7] == 0
    woken(chip).set_duty_cycle(1, 0.0)
    assert [chip.registers[register] for register in range(10, 14)] == [0, 0, 0, 16]
    woken(chip).set_duty_cycle(1, 1.0)
    assert [chip.registers[register] for register in range(10, 14)] == [0, 16, 0, 0]


@pytest.mark.parametrize(
    ("share", "expected"), [(0.5, (0.5, 0.0)), (-0.25, (0.0, 0.25)), (1.0, (1.0, 0.0)), (0.0, (0.0, 0.0))]
)
def test_a_motor_on_channels_turns_both_ways(share: float, expected: tuple[float, float]) -> None:
    chip = Chip()
    make_channel_motor(Pca9685(chip, 0x40), {"forward": 8, "backward": 9, "enable": None})(share)
    assert (chip.share(8), chip.share(9)) == pytest.approx(expected, abs=0.001)
    make_channel_motor(Pca9685(chip, 0x40), {"forward": 11, "backward": 12, "enable": 10})(share)
    assert (chip.share(11), chip.share(12), chip.share(10)) == pytest.approx(
        (float(share > 0), float(share < 0), abs(share)), abs=0.001
    )


@pytest.fixture
def pins() -> Iterator[Callable[[int], float]]:
    before = Device.pin_factory
    Device.pin_factory = factory = MockFactory(pin_class=MockPWMPin)
    yield lambda number: float(factory.pin(number).state)
    factory.close()
    Device.pin_factory = before


def test_pin_motor_turns_both_ways_and_stops(pins: Callable[[int], float]) -> None:
    two, three = make_pin_motor(TWO), make_pin_motor(THREE)
    for share in (0.6, -0.3, 1.0, 0.0):
        two(share)
        three(share)
        assert (pins(5), pins(6)) == pytest.approx((max(share, 0.0), max(-share, 0.0)))
        assert (pins(17), pins(27), pins(12)) == pytest.approx((float(share > 0), float(share < 0), abs(share)))


LGPIO = """
import json, os, sys
os.mkfifo(os.path.join(os.environ["LG_WD"], ".lgd-nfy0"))
os.stat(".lgd-nfy0")  # as old versions look for it
told = [os.environ["LG_WD"], os.getcwd(), oct(os.stat(os.environ["LG_WD"]).st_mode)]
open(os.environ["JOURNAL"], "w").write(json.dumps(told))
raise ImportError("no such pins")
"""
"""What lgpio does as it is imported."""


@pytest.mark.parametrize("chosen", [False, True])
def test_lgpio_writes_into_a_private_folder_wherever_the_guardian_is_started(tmp_path: Path, *, chosen: bool) -> None:
    (tmp_path / "lgpio.py").write_text(LGPIO)
    journal, own = tmp_path / "journal", tmp_path / "own"
    own.mkdir(mode=0o700)
    environment = {
        **os.environ, "JOURNAL": str(journal), "GPIOZERO_PIN_FACTORY": "lgpio", "TMPDIR": str(tmp_path),
        "PYTHONPATH": f"{tmp_path}:{ROOT}", **({"LG_WD": str(own)} if chosen else {}),
    }  # fmt: skip
    command = [sys.executable, "-W", "ignore", "-m", "drivers.pi_car.guardian", json.dumps(GPIO)]
    # No file can be made in /proc, not even by root.
    done = subprocess.run(
        command, check=False, cwd="/proc", env=environment, stdin=subprocess.DEVNULL, capture_output=True
    )
    assert b"no such pins" in done.stdout, done
    folder, here, mode = json.loads(journal.read_text())
    assert (folder == str(own)) is chosen
    assert (here, mode) == (folder, "0o40700")
    assert Path(folder).exists() is chosen, "its own is removed"


# --- the guardian, a process ------------------------------------------------------------------------------------------


class Journal:
    """What the pins and the chip of mock guardians were told."""

    def __init__(self, path: Path) -> None:
        self.path = path
        path.touch()

    def entries(self) -> list[tuple[str, Any]]:
        return [tuple(json.loads(line)) for line in self.path.read_text(encoding="utf-8").splitlines()]

    def motors(self) -> dict[str, float]:
        """How much each output of a motor is on, by the newest word."""
        found: dict[str, float] = {}
        for who, what in self.entries():
            if who.startswith("pin"):
                found[who] = what
            elif what[0] >= 6 + 4 * 8 and what[0] != 0xFE:
                _, on_high, off_low, off_high = what[1]
                always = float(bool(on_high & 0x10))
                found[f"channel {(what[0] - 6) // 4}"] = 0.0 if off_high & 0x10 else always + off_low + 256 * off_high
        return found

    def turns(self) -> bool:
        return any(self.motors().values())


@pytest.fixture
def journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Journal:
    journal = Journal(tmp_path / "journal")
    monkeypatch.setenv("JOURNAL", str(journal.path))
    monkeypatch.chdir(ROOT)
    return journal


@pytest.fixture
def drive(journal: Journal) -> Iterator[Callable[[Mapping[str, object]], "subprocess.Popen[bytes]"]]:
    """Start a program that drives; it is ended with the test."""
    started: list[subprocess.Popen[bytes]] = []

    def start(told: Mapping[str, object]) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", "tests.drivers.doomed_car", json.dumps(told), *MOCK]
        started.append(subprocess.Popen(command))
        wait_until(journal.turns)
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()
    wait_until(lambda: not journal.turns())


@pytest.mark.real_time
@pytest.mark.parametrize("told", [GPIO, CHIP], ids=["gpio", "pca9685"])
def test_killed_driver_leaves_stopped_motors(
    told: Mapping[str, object], journal: Journal, drive: Callable[[Mapping[str, object]], "subprocess.Popen[bytes]"]
) -> None:
    driver = drive(told)
    clock = SystemClock()
    os.kill(driver.pid, signal.SIGKILL)
    wait_until(lambda: not journal.turns())
    assert clock.now() <= WITHIN


class Stubborn:
    """A keeper whose bus fails the first times."""

    def __init__(self, fails: int) -> None:
        self.fails, self.rested = fails, 0

    def rest(self, now: float) -> None:
        self.fails -= 1
        if self.fails >= 0:
            raise OSError(f"no acknowledgement at {now > 0}")
        self.rested += 1


@pytest.mark.parametrize(("fails", "is_told"), [(0, False), (REST_TRIES - 1, False), (REST_TRIES, True)])
def test_guardian_that_cannot_rest_reports_a_fault(
    fails: int, is_told: bool, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    keeper = Stubborn(fails)
    monkeypatch.setattr(guardian, "make_actuators", lambda _: None)
    monkeypatch.setattr(guardian, "ActuatorGuardian", lambda *_: keeper)
    monkeypatch.setattr(guardian, "serve", lambda *_: None)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    assert guardian.main("{}") == int(is_told)
    assert keeper.rested == max(0, REST_TRIES - fails)
    assert ("the actuators may not be at rest: OSError: no acknowledgement" in capfd.readouterr().out) == is_told


def test_restarted_guardian_stops_the_motors_first(
    journal: Journal, drive: Callable[[Mapping[str, object]], "subprocess.Popen[bytes]"]
) -> None:
    driver = drive(CHIP)
    (guardian,) = (int(line) for line in children(driver.pid))
    os.kill(guardian, signal.SIGKILL)
    before = len(journal.entries())

    def stopped() -> bool:
        """Whether both motors were told to stand since then."""
        since = [what for _, what in journal.entries()[before:]]
        return all([6 + 4 * channel, [0, 0, 0, 0x10]] in since for channel in (8, 9, 10, 11, 12))

    wait_until(stopped)


def children(pid: int) -> list[str]:
    """Return the processes that one has started."""
    return Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split() or [
        line for task in Path(f"/proc/{pid}/task").iterdir() for line in (task / "children").read_text().split()
    ]


@pytest.mark.real_time
def test_suspended_driver_leaves_stopped_motors(
    journal: Journal, drive: Callable[[Mapping[str, object]], "subprocess.Popen[bytes]"]
) -> None:
    driver = drive(CHIP)
    clock = SystemClock()
    os.kill(driver.pid, signal.SIGSTOP)
    wait_until(lambda: not journal.turns())
    assert clock.now() <= guardian_wire.WATCHDOG_TIMEOUT + WITHIN
    os.kill(driver.pid, signal.SIGKILL)


@pytest.mark.real_time
def test_guardian_ignores_terminal_signals_and_ends_with_its_driver(journal: Journal) -> None:
    guardian = GuardianLauncher(CHIP, MOCK)("base", "the guardian", guardian_wire.BAUD)
    try:
        boot = hello(guardian)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            os.kill(guardian.pid, number)
        guardian.write(guardian_wire.pack_command(boot, 500, -500))
        wait_until(journal.turns)
        guardian.write(guardian_wire.pack_command(boot + 1, 1000, 1000))  # meant for another
        assert hello(guardian) == boot
        assert journal.motors()["channel 8"] == pytest.approx(2048)
        wait_until(lambda: not journal.turns())  # nobody says anything any more
    finally:
        guardian.close()
    assert guardian._process.returncode == 0


@pytest.mark.usefixtures("journal")
def test_restarted_guardian_knows_the_servo_angles() -> None:
    for expected, goal in (
        ((guardian_wire.UNKNOWN_ANGLE, guardian_wire.UNKNOWN_ANGLE), (80, 100)),
        ((80, 100), (81, 101)),
    ):
        guardian = GuardianLauncher(HEAD, MOCK)("head", "the guardian", guardian_wire.BAUD)
        try:
            report = asked(guardian)
            assert (report.first, report.second) == expected
            guardian.write(guardian_wire.pack_command(report.boot, *goal))
            wait_until(lambda: (asked(guardian).first, asked(guardian).second) == goal)  # noqa: B023 - of this round
        finally:
            guardian.close()


def test_computer_without_pins_is_reported() -> None:
    dials = GuardianLauncher({"motors": "gpio", "left": {}, "right": {}}, COMMAND)
    guardian = dials("base", "the guardian", guardian_wire.BAUD)
    said = ""
    try:
        while not said:
            guardian.write(guardian_wire.REPORT_REQUEST)
            said = ended(guardian)
    finally:
        guardian.close()
    assert said == dials.last_message == "KeyError: 'enable'"
    assert "raspi-config" in make_port_error("base", "the guardian", PortLostError(said, offline_hint())).hint
    with pytest.raises(NotConnected, match="KeyError: 'enable'"):
        dials("base", "the guardian", guardian_wire.BAUD)  # not at once again
    with pytest.raises(NotConnected, match="the guardian"):
        GuardianLauncher({}, ["/nowhere/python"])("base", "the guardian", guardian_wire.BAUD)


def ended(guardian: GuardianProcess) -> str:
    """Return why it has ended; nothing while it runs."""
    try:
        guardian.read_available(0.1)
    except PortLostError as lost:
        return str(lost)
    return ""


def asked(guardian: GuardianProcess) -> guardian_wire.GuardianReport:
    """Return how it is."""
    guardian.write(guardian_wire.REPORT_REQUEST)
    said = b""
    while not said.endswith(b"\n"):
        said += guardian.read_available(5.0)
    found = guardian_wire.parse_line(said.splitlines()[-1])
    assert isinstance(found, guardian_wire.GuardianReport)
    return found


def hello(guardian: GuardianProcess) -> int:
    """Return its boot."""
    return asked(guardian).boot
