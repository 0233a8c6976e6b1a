"""The bus against a virtual chain over a pseudo-terminal, with every fault that a wire has."""

import os
import pty
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Thread

import pytest
import serial

from drivers.clock import SystemClock
from drivers.dynamixel import models as m
from drivers.dynamixel.bus import TRIES, Bus
from drivers.dynamixel.port import quicken, timer_of
from drivers.dynamixel.wire import Fault, status
from drivers.errors import BadRequest, NoReply, NotConnected
from drivers.virtual.dynamixel import VirtualServoBus
from drivers.virtual.terminal import Terminal
from tests.drivers.chains import chain

PATIENCE = 0.05  # a shared machine may be late by tens of milliseconds


class Bench:
    """A chain of three on a terminal, and the bus that has it open."""

    def __init__(self) -> None:
        self.clock = SystemClock()
        self.chain: VirtualServoBus = chain(3)
        self.terminal = Terminal("servos", self.chain, self.clock)
        self.terminal.open()
        self.bus = Bus(self.terminal.path, self.clock, name="arm", patience=PATIENCE)
        self.bus.open()

    def close(self) -> None:
        self.bus.close()
        self.terminal.close()

    def distort_first(self, change: Callable[[bytes], bytes], times: int = 1) -> None:
        """Change the next ``times`` answers, then play fair again."""
        left = times

        def distort(data: bytes) -> bytes:
            nonlocal left
            left -= 1
            return change(data) if left >= 0 else data

        self.terminal.distort = distort


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


def test_it_pings_reads_writes_and_writes_to_many(bench: Bench) -> None:
    bus = bench.bus
    assert bus.ping(2) == 12
    bus.write(1, m.GOAL_POSITION, 600)
    assert bus.read(1, m.GOAL_POSITION) == 600
    bus.sync_write(m.MOVING_SPEED, {1: 11, 2: 22, 3: 33})
    assert [bus.read(servo, m.MOVING_SPEED) for servo in (1, 2, 3)] == [11, 22, 33]
    block = bus.read_block(3, m.GOAL_POSITION.address, 4)
    assert (m.GOAL_POSITION.decode(block, 30), m.MOVING_SPEED.decode(block, 30)) == (512, 33)
    assert bus.tally(9).tries == 0


def test_a_silent_servo_says_what_to_try(bench: Bench) -> None:
    with pytest.raises(
        NoReply, match=r"arm: servo 9: no reply to a read of 2 bytes at 36 on .* at 1000000 baud"
    ) as caught:
        bench.bus.read(9, m.PRESENT_POSITION)
    assert "power" in caught.value.hint
    assert "9" in caught.value.hint
    tally = bench.bus.tally(9)
    assert (tally.tries, tally.misses, tally.corrupt) == (TRIES, TRIES, 0)
    assert bench.bus.read(1, m.PRESENT_POSITION) == 512


def test_a_missing_servo_is_waited_for_no_longer_than_its_reply_can_take(bench: Bench) -> None:
    quick = Bus(bench.terminal.path, bench.clock, patience=0.002)
    bench.bus.close()
    quick.open()
    try:
        before = bench.clock.now()
        with pytest.raises(NoReply):
            quick.read_block(9, 36, 8, tries=1)
        assert bench.clock.now() - before >= 0.002
    finally:
        quick.close()


def test_a_read_survives_a_wrong_checksum_and_counts_it(bench: Bench) -> None:
    bench.distort_first(lambda data: data[:-1] + bytes((data[-1] ^ 1,)), times=TRIES - 1)
    assert bench.bus.read(1, m.PRESENT_POSITION) == 512
    assert bench.bus.tally(1).corrupt == TRIES - 1


def test_replies_that_stay_damaged_name_the_likely_cause(bench: Bench) -> None:
    bench.distort_first(lambda data: data[:-1] + bytes((data[-1] ^ 1,)), times=TRIES)
    with pytest.raises(NoReply, match=r"3 of 3 replies .* damaged") as caught:
        bench.bus.read(1, m.PRESENT_POSITION)
    assert "two with ID 1" in caught.value.hint


@pytest.mark.parametrize("noise", [b"\x00", b"\xff", b"\x00\xff\x13", b"\xff\x00\xff\x01"])
def test_noise_before_the_header_is_passed_over(bench: Bench, noise: bytes) -> None:
    bench.distort_first(lambda data: noise + data)
    assert bench.bus.read(1, m.PRESENT_POSITION) == 512
    assert bench.bus.tally(1).tries == 1


@pytest.mark.parametrize(
    "reply",
    [
        status(1, 0, b"\x07"),  # one byte where two were asked for
        status(1, 0, b"\x07\x08\x09"),
        status(1, Fault.CHECKSUM),  # our request arrived damaged
        bytes.fromhex("FF FF 01 01 FD 00"),  # shorter than any packet, with a right checksum
        status(2, 0, b"\x07\x08"),  # somebody else's
    ],
)
def test_a_reply_of_the_wrong_length_or_servo_is_never_taken_for_a_number(bench: Bench, reply: bytes) -> None:
    bench.distort_first(lambda _: reply)
    assert bench.bus.read(1, m.PRESENT_POSITION) == 512
    assert bench.bus.tally(1).tries == 2
    assert bench.bus.tally(1).misses + bench.bus.tally(1).corrupt == 1


def test_a_write_without_a_reply_is_not_repeated(bench: Bench) -> None:
    bench.distort_first(lambda _: b"", times=9)
    with pytest.raises(NoReply, match="write of 01 at 25"):
        bench.bus.write(1, m.LED, 1)
    assert bench.bus.tally(1).tries == 1
    assert bench.chain.servo(1).get(m.LED) == 1  # it was carried out: only the reply was lost


def test_what_a_servo_refuses_is_a_bad_request_in_words(bench: Bench) -> None:
    with pytest.raises(BadRequest, match="servo 1 refused a write of 05 at 24: range"):
        bench.bus.write_block(1, m.TORQUE_ENABLE.address, b"\x05")
    with pytest.raises(BadRequest, match="servo 1 refused a read of 9 bytes at 48: range"):
        bench.bus.read_block(1, 48, 9)
    with pytest.raises(BadRequest, match=r"torque_limit takes 0\.\.1023, not 1024"):
        bench.bus.write(1, m.TORQUE_LIMIT, 1024)
    with pytest.raises(BadRequest, match=r"0\.\.253, not 254"):
        bench.bus.ping(254)
    assert bench.bus.tally(1).tries == 2


def test_lasting_faults_do_not_spoil_a_reading(bench: Bench) -> None:
    bench.chain.servo(1).overload()
    assert bench.bus.read(1, m.TORQUE_LIMIT) == 0
    assert bench.bus.faults(1) == Fault.OVERLOAD
    assert bench.bus.faults(2) == Fault(0)


def test_one_sync_write_holds_no_more_than_a_packet(bench: Bench) -> None:
    with pytest.raises(BadRequest, match="cannot hold 60 blocks"):
        bench.bus.sync_write_block(30, {servo: bytes(4) for servo in range(60)})
    with pytest.raises(BadRequest, match="cannot hold 2 blocks"):
        bench.bus.sync_write_block(30, {1: bytes(4), 2: bytes(2)})
    bench.bus.sync_write_block(30, {})


def test_two_threads_on_one_bus_wait_for_each_other(bench: Bench) -> None:
    failures: list[Exception] = []

    def ask(servo: int) -> None:
        try:
            for value in range(100):
                bench.bus.write(servo, m.MOVING_SPEED, value)
                assert bench.bus.read(servo, m.MOVING_SPEED) == value
        except Exception as error:  # handed to the test's own thread
            failures.append(error)

    threads = [Thread(target=ask, args=(servo,)) for servo in (1, 2, 3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert failures == []
    assert sum(bench.bus.tally(servo).corrupt for servo in (1, 2, 3)) == 0


def test_pulling_the_plug_is_told_and_the_same_bus_works_after_replugging(bench: Bench) -> None:
    bench.terminal.unplug()
    assert str(until_lost(lambda: bench.bus.read(1, m.LED))).startswith(f"arm: {bench.terminal.path}: ")
    assert not bench.bus.is_open
    with pytest.raises(NotConnected):
        bench.bus.sync_write(m.LED, {1: 1})
    with pytest.raises(NotConnected, match="no such device"):
        bench.bus.open()
    bench.terminal.replug()
    bench.bus.open()
    assert bench.bus.ping(1) == 12


def test_a_sync_write_alone_notices_the_pulled_plug(bench: Bench) -> None:
    bench.terminal.unplug()
    until_lost(lambda: bench.bus.sync_write(m.LED, {1: 1}))
    assert not bench.bus.is_open


def test_a_port_that_is_held_is_not_shared(bench: Bench) -> None:
    second = Bus(bench.terminal.path, bench.clock, name="head")
    with pytest.raises(NotConnected, match=r"head: .*: in use"):
        second.open()
    bench.bus.close()
    second.open()
    second.close()


def test_a_bus_that_is_not_open_says_so_and_may_be_closed_often(tmp_path: Path) -> None:
    bus = Bus(str(tmp_path / "servos"), SystemClock(), name="arm")
    with pytest.raises(NotConnected, match="not opened yet"):
        bus.read(1, m.LED)
    with pytest.raises(NotConnected, match="no such device"):
        bus.open()
    with pytest.raises(NotConnected, match="no such device"):
        bus.require()
    bus.close()
    bus.close()
    with pytest.raises(NotConnected, match="closed"):
        bus.require()


@pytest.fixture
def bare() -> Iterator[tuple[int, str]]:
    """A pseudo-terminal whose other end the test plays: its descriptor, and the name of the port."""
    master, slave = pty.openpty()
    yield master, os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_a_reply_may_arrive_in_pieces(bare: tuple[int, str]) -> None:
    master, path = bare
    bus = Bus(path, SystemClock(), patience=2.0)
    bus.open()
    reply = status(1, 0, b"\x00\x02")
    pause = Event()

    def play() -> None:
        heard = b""
        while len(heard) < 8:
            heard += os.read(master, 8 - len(heard))
        for byte in reply:
            os.write(master, bytes((byte,)))
            pause.wait(0.003)

    player = Thread(target=play)
    player.start()
    try:
        assert bus.read(1, m.PRESENT_POSITION) == 512
        assert bus.tally(1).tries == 1
    finally:
        player.join(10)
        bus.close()


def test_a_bus_that_babbles_ends_the_wait_all_the_same(bare: tuple[int, str]) -> None:
    master, path = bare
    bus = Bus(path, SystemClock(), patience=0.02)
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
            bus.read(1, m.PRESENT_POSITION)
    finally:
        ending.set()
        babbler.join(10)
        bus.close()


def test_an_adapter_that_holds_bytes_back_is_noticed(bare: tuple[int, str], tmp_path: Path) -> None:
    _, path = bare
    with serial.Serial(path, 1_000_000) as line:
        assert quicken(line, adapters=tmp_path) == 0
        timer = timer_of(path, adapters=tmp_path)
        timer.parent.mkdir()
        timer.write_text("16\n")
        assert quicken(line, adapters=tmp_path) == 0.016
