"""The RPLIDAR's driver: how it brings a finder to scan, in simulated time; then as a whole over a pseudo-terminal."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from random import Random
from time import thread_time

import numpy as np
import pytest

from drivers.api import Angles, DeviceStatus, Health, Quality
from drivers.clock import ManualClock, SystemClock
from drivers.errors import NotConnected
from drivers.rplidar import wire
from drivers.rplidar.make import GATHER_TIME, RETRY_INTERVAL, SCAN_TIMEOUT, STALE_AFTER, RPLidar
from drivers.rplidar.session import BOOT_TIME, MAX_TRIES, QUIET_TIME, REPLY_TIMEOUT, STOP_PAUSE
from drivers.rplidar.virtual import VirtualRPLidar
from drivers.rplidar.wire import BAUD, RPLidarCommand, RPLidarHealth, RPLidarStatus, request
from drivers.transport.link import SerialLink
from drivers.virtual.terminal import PseudoTerminal
from tests.waiting import wait_until

FAR = 3.0


def all_round(bearings: Angles, time: float) -> Angles:
    """A round room."""
    del time
    return np.full(len(bearings), FAR)


class Directly(SerialLink):
    """A link without a port or thread: a virtual finder is at its end, on a clock that stands still."""

    def __init__(self, lidar: VirtualRPLidar, clock: ManualClock) -> None:
        super().__init__("range", "/dev/rplidar", BAUD)
        self.sent: list[tuple[float, bytes]] = []
        self.dtr: list[bool] = []
        self.plugged = True
        self.distort: Callable[[bytes], bytes] = bytes
        self._lidar = lidar
        self._time = clock
        self._inbox = b""

    def write(self, data: bytes) -> None:
        if not self.plugged:
            raise NotConnected("range: gone")
        self.sent.append((self._time.now(), data))
        self._inbox += self._lidar.feed(data, self._time.now())

    def set_dtr(self, *, on: bool) -> None:
        self.dtr.append(on)

    def health(self) -> Health:
        return Health(self.plugged, counters={"connections": 1})

    def read(self) -> bytes:
        data, self._inbox = self._inbox + self._lidar.poll(self._time.now()), b""
        return self.distort(data)


class Bench:
    """A driver, a virtual finder, and the hand that lets time pass."""

    def __init__(
        self,
        *,
        driven_as: str = "a1",
        model: str = "a1",
        streaming: bool = False,
        firmware: tuple[int, int] = (1, 15),  # which has plain scans alone
    ) -> None:
        self.clock = ManualClock()
        self.notices: list[DeviceStatus] = []
        self.lidar = VirtualRPLidar(all_round, model=model, streaming=streaming, firmware=firmware)
        self.link = Directly(self.lidar, self.clock)
        self.device = RPLidar(self.link, self.clock, model=driven_as, report=self.notices.append)
        self.device.on_connected()

    def run(self, seconds: float) -> None:
        end = self.clock.now() + seconds
        while self.clock.now() < end:
            if data := self.link.read():
                self.device.on_data(data)
            self.device.on_poll()
            self.clock.advance(0.01)

    def asked(self) -> list[bytes]:
        return [data for _, data in self.link.sent]

    def told(self, kind: str) -> list[str]:
        return [notice.message for notice in self.notices if notice.kind == kind]

    def nearest(self) -> float:
        scan = self.device.scan()
        assert scan.good
        assert scan.value is not None
        return scan.value.nearest()


STOP, RESET, SCAN, INFO, HEALTH = (
    request(command)
    for command in (
        RPLidarCommand.STOP,
        RPLidarCommand.RESET,
        RPLidarCommand.SCAN,
        RPLidarCommand.INFO,
        RPLidarCommand.HEALTH,
    )
)


def test_range_finder_is_stopped_identified_and_started() -> None:
    bench = Bench()
    bench.run(1.0)
    assert bench.asked() == [STOP, INFO, HEALTH, SCAN]
    assert bench.link.sent[1][0] >= STOP_PAUSE
    assert bench.link.dtr == [False]
    assert bench.nearest() == pytest.approx(FAR, rel=0.06)
    assert bench.device.health().online
    assert bench.device.info is not None
    assert bench.device.info.series == 1
    assert bench.notices == []


def test_an_a2_is_turned_by_pulse_width_and_stopped_at_the_end() -> None:
    bench = Bench(driven_as="a2", model="a2")
    bench.run(1.0)
    assert bench.asked() == [STOP, INFO, HEALTH, wire.BOARD_REQUEST, wire.motor_request(660), SCAN]
    assert bench.device.scan().good
    bench.device.on_closing()
    assert bench.asked()[-2:] == [STOP, wire.motor_request(0)]
    assert (bench.lidar.pwm, bench.lidar.streaming, bench.link.dtr) == (0, False, [False, True])


def test_an_a1_is_stopped_by_the_line_dtr() -> None:
    bench = Bench()
    bench.run(1.0)
    bench.device.on_closing()
    assert bench.asked()[-1] == STOP
    assert bench.link.dtr == [False, True]


def test_already_scanning_range_finder_is_flushed_first() -> None:
    bench = Bench(streaming=True)
    bench.run(1.5)
    assert bench.asked() == [STOP, INFO, HEALTH, SCAN]
    assert bench.link.sent[1][0] >= QUIET_TIME
    assert bench.nearest() == pytest.approx(FAR, rel=0.06)
    assert bench.device.health().counters["skipped bytes"] == 0


def test_missed_stop_request_is_repeated() -> None:
    bench = Bench(streaming=True)
    bench.lidar.is_deaf = True
    bench.run(0.5)
    bench.lidar.is_deaf = False
    bench.run(2.5)
    assert bench.asked() == [STOP, STOP, INFO, HEALTH, SCAN]
    assert bench.device.scan().good


def test_lost_reply_is_requested_again() -> None:
    bench = Bench()
    bench.link.distort = lambda data: data[2:]
    bench.run(REPLY_TIMEOUT)
    bench.link.distort = bytes
    bench.run(2.0)
    assert bench.asked() == [STOP, INFO, INFO, HEALTH, SCAN]
    assert bench.device.scan().good


def test_silent_port_gives_one_hint_and_is_retried() -> None:
    bench = Bench()
    bench.lidar.is_deaf = True
    bench.run(10.0)
    (notice,) = bench.notices
    assert (notice.kind, notice.message) == ("offline", "range: /dev/rplidar: open but silent")
    assert "power" in notice.hint
    health = bench.device.health()
    assert (health.online, health.detail, health.hint) == (False, notice.message, notice.hint)
    assert bench.asked().count(INFO) >= 2 * MAX_TRIES
    assert len(bench.asked()) < 30  # and not all the time
    bench.lidar.is_deaf = False
    bench.run(RETRY_INTERVAL + REPLY_TIMEOUT * MAX_TRIES + 2.0)
    assert bench.told("online") == ["/dev/rplidar: complete turns arrive again"]
    assert bench.device.health().online
    assert bench.device.scan().good


def test_foreign_device_is_distinguished_from_silence() -> None:
    bench = Bench()
    bench.link.distort = lambda data: b"hello" if data else b""
    bench.run(3.0)
    assert "15 bytes received at 115200 baud, none of them a reply of an RPLIDAR" in bench.told("offline")[0]


def test_faulty_range_finder_is_reset_once_and_then_scans() -> None:
    bench = Bench()
    bench.lidar.condition = RPLidarHealth(RPLidarStatus.ERROR, 0x8001)
    bench.run(BOOT_TIME + 2.0)
    assert bench.asked() == [STOP, INFO, HEALTH, RESET, STOP, HEALTH, SCAN]
    assert bench.told("fault") == ["range: /dev/rplidar: it is out of order, code 32769: reset"]
    assert bench.device.scan().good


def test_range_finder_not_fixed_by_a_reset_stays_off_until_healthy() -> None:
    bench = Bench()
    bench.lidar.condition, bench.lidar.is_fixed_by_reset = RPLidarHealth(RPLidarStatus.ERROR, 7), False
    bench.run(15.0)
    assert bench.lidar.requests[RPLidarCommand.RESET] == 1
    assert SCAN not in bench.asked()
    assert bench.told("fault")[1:] == ["range: /dev/rplidar: it is out of order, code 7, and a reset did not help"]
    assert "power" in bench.device.health().hint
    assert bench.link.dtr[-1] is True
    bench.lidar.condition = RPLidarHealth(RPLidarStatus.GOOD)
    bench.run(4.0)
    assert bench.device.scan().good


def test_warning_is_reported_and_the_scan_continues() -> None:
    bench = Bench()
    bench.lidar.condition = RPLidarHealth(RPLidarStatus.WARNING, 3)
    bench.run(1.0)
    assert bench.told("fault") == ["range: /dev/rplidar: it reports a warning, code 3"]
    assert bench.device.scan().good


def test_model_mismatch_is_reported() -> None:
    bench = Bench(driven_as="a2", model="a1")
    bench.run(3.5)
    assert bench.told("fault") == ["range: /dev/rplidar: it is an A1 (model 0x18), not an A2"]
    assert wire.motor_request(660) not in bench.asked()  # its board cannot do that
    assert bench.device.scan().good


def test_stuck_motor_is_reported_once_and_its_return_is_noticed() -> None:
    bench = Bench()
    bench.run(1.0)
    bench.lidar.is_stuck = True
    bench.run(0.2)
    assert bench.device.scan().good
    bench.run(STALE_AFTER)
    assert bench.device.scan().quality is Quality.STALE
    bench.run(15.0)
    assert bench.told("offline") == [f"range: /dev/rplidar: no complete turn for {SCAN_TIMEOUT:g} s"]
    assert not bench.device.health().online
    assert bench.link.dtr[:4] == [False, True, False, True]
    assert 3 <= bench.asked().count(SCAN) <= 6
    bench.lidar.is_stuck = False
    bench.run(SCAN_TIMEOUT + RETRY_INTERVAL + 2.0)
    assert bench.told("online") == ["/dev/rplidar: complete turns arrive again"]
    assert bench.device.scan().good


def test_noise_on_the_wire_costs_nodes_but_not_scans() -> None:
    bench = Bench()
    bench.run(0.5)
    random = Random(5)  # noqa: S311 - chance, not a secret
    seen: list[float] = []

    def noisy(data: bytes) -> bytes:
        return bytes(
            b ^ 1 << random.randrange(8) if random.random() < 0.002 else b for b in data if random.random() > 0.001
        )

    bench.link.distort = noisy
    for _ in range(40):
        bench.run(0.2)
        assert bench.device.scan().good
        scan = bench.device.scan().value
        assert scan is not None
        measured = scan.ranges[np.isfinite(scan.ranges)]
        assert len(measured) > 300
        seen.append(float(np.mean(np.abs(measured - FAR) < 0.2)))
    assert min(seen) > 0.95
    assert bench.device.health().counters["slips"] > 20


def test_port_lost_in_mid_scan_is_reopened_by_the_link() -> None:
    bench = Bench()
    bench.link.plugged = False
    with pytest.raises(NotConnected):
        bench.run(1.0)
    assert not bench.device.health().online
    bench.link.plugged = True
    bench.device.on_connected()
    bench.run(1.0)
    assert bench.device.scan().good


def test_a_new_connection_has_no_fresh_scan_of_the_one_before() -> None:
    bench = Bench()
    bench.run(1.0)
    bench.device.on_connected()
    assert bench.device.scan().quality is Quality.STALE
    assert "waiting for the first complete turn" in bench.device.health().detail


def test_an_unknown_model_is_refused() -> None:
    with pytest.raises(ValueError, match=r"unknown model 'a9' .known: a1, a2"):
        RPLidar(SerialLink("range", "/dev/rplidar", BAUD), ManualClock(), model="a9")


# --- over a pseudo-terminal -------------------------------------------------------------------------------------------


class Wired:
    """The driver on its thread, with a virtual finder on a pseudo-terminal."""

    def __init__(self, model: str) -> None:
        self.clock = SystemClock()
        self.turns: list[tuple[float, float]] = []
        """Seconds of computing of the driver's thread, and seconds of the clock, at each turn."""
        self.notices: list[tuple[str, float, float]] = []
        self.lidar = VirtualRPLidar(all_round, model=model, streaming=True)
        self.terminal = PseudoTerminal("rplidar", self.lidar, self.clock)
        self.terminal.open()
        link = SerialLink(
            "range", self.terminal.path, BAUD, retry_interval=0.05, gather_time=GATHER_TIME, report=self.tell
        )
        self.device = RPLidar(link, self.clock, model=model, report=self.tell, changed=self.turned)
        self.device.open()

    def turned(self) -> None:
        self.turns.append((thread_time(), self.clock.now()))

    def tell(self, notice: DeviceStatus) -> None:
        self.notices.append((notice.kind, thread_time(), self.clock.now()))


@pytest.fixture(params=["a1", "a2"])
def wired(request: pytest.FixtureRequest) -> Iterator[Wired]:
    made = Wired(request.param)
    yield made
    made.device.close()
    made.terminal.close()


def share(begin: tuple[float, float], end: tuple[float, float]) -> float:
    """The part of one core that a thread took from one moment to another."""
    return (end[0] - begin[0]) / (end[1] - begin[1])


def test_a_dirty_start_ends_in_scans_and_closing_stops_everything(wired: Wired) -> None:
    wait_until(lambda: len(wired.turns) >= 3)
    assert wired.device.health().counters["skipped bytes"] == 0
    wired.device.close()
    wait_until(lambda: not wired.lidar.streaming)
    wait_until(lambda: wired.lidar.pwm == 0 or not wired.lidar.model.has_pwm)
    wired.device.close()


def test_the_thread_takes_a_small_part_of_a_core(wired: Wired) -> None:
    wait_until(lambda: len(wired.turns) >= 15)
    taken = share(wired.turns[3], wired.turns[14])
    assert taken < 0.25
    assert all(later > earlier for (_, earlier), (_, later) in pairwise(wired.turns))


def test_unplugged_range_finder_uses_little_cpu(wired: Wired) -> None:
    wait_until(lambda: len(wired.turns) >= 2)
    wired.terminal.unplug()
    wait_until(lambda: wired.notices[-1][0] == "offline")
    gone = wired.notices[-1][1:]
    wait_until(lambda: wired.clock.now() - gone[1] > 1.0)
    wired.terminal.replug()
    wait_until(lambda: wired.notices[-1][0] == "online")
    assert share(gone, wired.notices[-1][1:]) < 0.25
    before = len(wired.turns)
    wait_until(lambda: len(wired.turns) > before and wired.device.scan().good)


def test_before_anything_came_no_turn_is_known() -> None:
    device = RPLidar(SerialLink("range", "/dev/nowhere", BAUD), ManualClock(7.0))
    assert (device.scan().value, device.scan().stamp, device.scan().quality) == (None, 7.0, Quality.NONE)
