"""The pseudo-terminal as a thing with a life: nothing before it is opened, nothing after it was closed."""

from collections.abc import Callable
from pathlib import Path
from threading import Event

import pytest
import serial

from drivers.arduino.virtual import VirtualRodney
from drivers.clock import ManualClock, SystemClock
from drivers.virtual.terminal import MultiRateDevice, PseudoTerminal, TimedDevice, baud_rates_match


class Echo:
    """Gives back what it hears ``delay`` seconds later, at the moment; it hears every rate and keeps the newest."""

    def __init__(self, clock: SystemClock, delay: float) -> None:
        self.baud = 9600
        self.late: list[float] = []
        self._clock = clock
        self._delay = delay
        self._due: float | None = None
        self._data = b""

    def set_baud(self, baud: int) -> None:
        self.baud = baud

    def next_poll_time(self) -> float | None:
        return self._due

    def feed(self, data: bytes, now: float) -> bytes:
        self._data, self._due = data, now + self._delay
        return b""

    def poll(self, now: float) -> bytes:
        if self._due is None or now < self._due:
            return b""
        self.late.append(now - self._due)
        self._due = None
        return self._data


def eventually(condition: Callable[[], bool]) -> bool:
    for _ in range(1000):
        if condition():
            return True
        Event().wait(0.01)
    return False


def test_terminal_creates_nothing_before_open_and_leaves_nothing() -> None:
    terminal = PseudoTerminal("nano", VirtualRodney(), ManualClock())
    folder = Path(terminal.path).parent
    assert not folder.exists()
    terminal.close()
    for _ in range(2):
        terminal.open()
        terminal.open()
        assert Path(terminal.path).is_char_device()
        assert folder.stat().st_mode & 0o777 == 0o700
        terminal.close()
        terminal.close()
        assert not folder.exists()


@pytest.mark.real_time
def test_timed_device_is_polled_on_time() -> None:
    clock = SystemClock()
    echo = Echo(clock, 0.002)
    assert isinstance(echo, TimedDevice)
    terminal = PseudoTerminal("echo", echo, clock, poll_interval=1.0)
    terminal.open()
    try:
        with serial.Serial(terminal.path, 115_200, timeout=5) as port:
            for number in range(20):
                port.write(bytes((number,)))
                assert port.read(1) == bytes((number,))
    finally:
        terminal.close()
    assert min(echo.late) >= 0
    assert sorted(echo.late)[10] < 0.1  # a tenth of the period, however busy the machine is


@pytest.mark.real_time
def test_busy_waiting_terminal_answers_sleeps_and_can_be_unplugged() -> None:
    clock = SystemClock()
    terminal = PseudoTerminal("awake", Echo(clock, 0.001), clock, busy_wait=0.05)
    terminal.open()
    try:
        with serial.Serial(terminal.path, 9600, timeout=2.0) as port:
            for data in (b"one", b"two", b"three"):
                port.write(data)
                assert port.read(len(data)) == data
                Event().wait(0.03 * len(data) - 0.06)
        terminal.unplug()
        terminal.replug()
        with serial.Serial(terminal.path, 9600, timeout=2.0) as port:
            port.write(b"again")
            assert port.read(5) == b"again"
    finally:
        terminal.close()


def test_device_is_notified_of_unusual_baud_rates() -> None:
    clock = SystemClock()
    echo = Echo(clock, 0.0)
    assert isinstance(echo, MultiRateDevice)
    terminal = PseudoTerminal("echo", echo, clock)
    terminal.open()
    try:
        for baud in (57_600, 250_000, 4_500_000, 117_647):
            with serial.Serial(terminal.path, baud, timeout=5) as port:
                port.write(b"?")
                assert port.read(1) == b"?"
                assert terminal.client_baud() == echo.baud == baud
        terminal.unplug()
        assert terminal.client_baud() is None
    finally:
        terminal.close()


def test_a_waiting_moment_ends_when_the_terminal_is_closed() -> None:
    clock = ManualClock(10.0)
    echo = Echo(SystemClock(), 1e-4)
    terminal = PseudoTerminal("echo", echo, clock)  # its clock stands still just before the reply is due
    terminal.open()
    with serial.Serial(terminal.path, 9600) as port:
        port.write(b"?")
        assert eventually(lambda: echo.next_poll_time() is not None)
        terminal.close()


@pytest.mark.parametrize(
    ("one", "other", "understood"),
    [(115_200, 117_647, True), (57_600, 57_143, True), (57_600, 115_200, False), (1_000_000, 1_152_000, False)],
)
def test_two_rates_agree_within_three_hundredths(one: int, other: int, understood: bool) -> None:
    assert baud_rates_match(one, other) is baud_rates_match(other, one) is understood
