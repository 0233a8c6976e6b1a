"""The bus over a real port, a pseudo-terminal: opened for one owner, unplugged, shared by threads."""

import os
import pty
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Thread

import pytest
import serial

from drivers.clock import SystemClock
from drivers.errors import NoReply, NotConnected
from drivers.servos.bus import ServoAddress, ServoBus
from drivers.servos.models import MODELS
from drivers.servos.wire import status
from drivers.transport.adapter import latency_timer_path, open_transport, reduce_latency
from drivers.virtual.patient_clock import PatientClock
from drivers.virtual.terminal import PseudoTerminal
from tests.drivers.chains import chain

REPLY_TIMEOUT = 0.1  # twice what the clock waits for
AX = MODELS["AX-12A"].table
LED, SPEED, POSITION = AX["led"], AX["moving_speed"], AX["present_position"]


class Bench:
    """A chain of three on a terminal, and the bus that has it open."""

    def __init__(self, *, patience: float = REPLY_TIMEOUT) -> None:
        self.clock = PatientClock()
        self.terminal = PseudoTerminal("servos", chain(3), self.clock)
        self.terminal.open()
        self.bus = ServoBus(self.terminal.path, self.clock, name="arm", reply_timeout=patience)
        self.bus.open()

    def close(self) -> None:
        self.bus.close()
        self.terminal.close()


def until_lost(act: Callable[[], object]) -> NotConnected:
    """Act until the pulled plug is felt: the terminal lets go of it when its own thread next looks."""
    clock, pause = SystemClock(), Event()
    end = clock.now() + 10
    while clock.now() < end:
        try:
            act()
        except NotConnected as error:
            return error
        except NoReply:
            pass
        pause.wait(0.01)
    raise AssertionError("the bus never noticed")


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.close()


@pytest.fixture
def patient_bench() -> Iterator[Bench]:
    """One on which no reply counts as late: a busy machine holds up 600 exchanges somewhere."""
    bench = Bench(patience=10.0)
    yield bench
    bench.close()


@pytest.fixture
def bare() -> Iterator[tuple[int, str]]:
    """A pseudo-terminal whose other end the test plays: its descriptor, and the name of the port."""
    master, slave = pty.openpty()
    yield master, os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_two_threads_on_one_bus_wait_for_each_other(patient_bench: Bench) -> None:
    bench = patient_bench
    failures: list[Exception] = []

    def ask(servo: int) -> None:
        try:
            for value in range(100):
                bench.bus.write(ServoAddress(servo), SPEED, value)
                assert bench.bus.read(ServoAddress(servo), SPEED) == value
        except Exception as error:  # handed to the test's own thread
            failures.append(error)

    threads = [Thread(target=ask, args=(servo,)) for servo in (1, 2, 3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert failures == []
    assert sum(bench.bus.statistics(servo).corrupt for servo in (1, 2, 3)) == 0


def test_unplugged_bus_is_reported_and_works_after_replugging(bench: Bench) -> None:
    bench.terminal.unplug()
    assert str(until_lost(lambda: bench.bus.read(ServoAddress(1), LED))).startswith(f"arm: {bench.terminal.path}: ")
    assert not bench.bus.is_open
    with pytest.raises(NotConnected):
        bench.bus.sync_write(1, LED, {1: 1})
    with pytest.raises(NotConnected, match="no such device"):
        bench.bus.open()
    bench.terminal.replug()
    bench.bus.open()
    assert bench.bus.ping(ServoAddress(1)) == 12


def test_sync_write_notices_an_unplugged_bus(bench: Bench) -> None:
    bench.terminal.unplug()
    until_lost(lambda: bench.bus.sync_write(1, LED, {1: 1}))
    assert not bench.bus.is_open


def test_baud_rate_changes_without_closing_the_port(bench: Bench) -> None:
    bench.bus.baud = 57_600
    with pytest.raises(NoReply):
        bench.bus.read_block(ServoAddress(1), 36, 2, tries=1)
    assert bench.terminal.client_baud() == 57_600
    bench.bus.baud = 1_000_000
    assert bench.bus.ping(ServoAddress(1)) == 12


def test_open_port_is_not_shared(bench: Bench) -> None:
    second = ServoBus(bench.terminal.path, bench.clock, name="head")
    with pytest.raises(NotConnected, match=r"head: .*: in use"):
        second.open()
    bench.bus.close()
    second.open()
    second.close()


def test_closed_bus_gives_the_reason_and_may_be_closed_repeatedly(tmp_path: Path) -> None:
    bus = ServoBus(str(tmp_path / "servos"), SystemClock(), name="arm")
    with pytest.raises(NotConnected, match="not opened yet"):
        bus.read(ServoAddress(1), LED)
    with pytest.raises(NotConnected, match="no such device"):
        bus.open()
    with pytest.raises(NotConnected, match="no such device"):
        bus.require_open()
    bus.close()
    bus.close()
    with pytest.raises(NotConnected, match="closed"):
        bus.require_open()


@pytest.mark.real_time
def test_babbling_bus_does_not_prevent_the_timeout(bare: tuple[int, str]) -> None:
    master, path = bare
    bus = ServoBus(path, SystemClock(), reply_timeout=0.02)
    bus.open()
    ending = Event()
    os.set_blocking(master, False)

    def babble() -> None:
        while not ending.is_set():
            try:
                os.write(master, status(7) * 20)
            except BlockingIOError:
                ending.wait(0.001)

    babbler = Thread(target=babble)
    babbler.start()
    try:
        with pytest.raises(NoReply):
            bus.read(ServoAddress(1), POSITION)
    finally:
        ending.set()
        babbler.join(10)
        bus.close()


def test_line_that_accepts_no_bytes_is_lost(bare: tuple[int, str]) -> None:
    _, path = bare  # nobody reads at the other end
    line = open_transport("arm", path, 1_000_000, SystemClock())
    try:
        with pytest.raises(NotConnected, match="accepts no more bytes"):
            line.send(bytes(1_000_000))
    finally:
        line.close()
        line.close()


def test_unsupported_baud_rate_of_the_port_is_reported(bare: tuple[int, str]) -> None:
    _, path = bare
    bus = ServoBus(path, SystemClock(), name="arm")
    bus.open()
    with pytest.raises(NotConnected, match=f"arm: {path}"):
        bus.baud = -1
    assert not bus.is_open


def test_adapter_with_a_high_latency_timer_is_detected(bare: tuple[int, str], tmp_path: Path) -> None:
    _, path = bare
    with serial.Serial(path, 1_000_000) as line:
        assert reduce_latency(line, adapters=tmp_path) == 0
        timer = latency_timer_path(path, adapters=tmp_path)
        timer.parent.mkdir()
        timer.write_text("16\n")
        assert reduce_latency(line, adapters=tmp_path) == 0.016
