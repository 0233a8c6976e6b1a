"""The link's thread: it outlives whatever is raised in it, and lets go of its port whatever ends it."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import pytest
import serial

from drivers.api import DeviceStatus, ignore
from drivers.errors import NotConnected
from drivers.sim.timeline import Timeline
from drivers.transport.link import SerialLink
from drivers.transport.loop import guard_callback
from tests.drivers.cranked import HandPort, HandWire, pass_until

ANYTHING = [ValueError("broken"), SystemExit(1), BaseException("worse")]


class Echo:
    """A device that answers with what it hears, and remembers it."""

    baud = 57600

    def __init__(self) -> None:
        self.heard = b""

    def feed(self, data: bytes, now: float) -> bytes:  # noqa: ARG002 - the time is part of the protocol
        self.heard += data
        return data

    def poll(self, now: float) -> bytes:  # noqa: ARG002
        return b""


@dataclass
class Chatter:
    """A talker that counts what it is called for, and does at each call what a test wants."""

    connections: int = 0
    pulses: int = 0
    heard: bytes = b""
    at_connected: Callable[[], object] = ignore
    at_received: Callable[[], object] = ignore
    at_pulse: Callable[[], object] = ignore
    patience: float | None = None
    at_ending: Callable[[], object] = ignore

    def on_connected(self) -> None:
        self.connections += 1
        self.at_connected()

    def on_data(self, data: bytes) -> None:
        self.heard += data
        self.at_received()

    def on_poll(self) -> float | None:
        self.pulses += 1
        self.at_pulse()
        return self.patience

    def on_closing(self) -> None:
        self.at_ending()


@dataclass
class Rig:
    """A link over a wire with an echo at its end."""

    link: SerialLink
    wire: HandWire
    timeline: Timeline
    echo: Echo
    notices: list[DeviceStatus]
    chatter: Chatter = field(default_factory=Chatter)

    def open(self) -> None:
        self.link.open(self.chatter)
        self.until(lambda: self.chatter.connections)

    def until(self, holds: Callable[[], object]) -> None:
        pass_until(self.timeline, holds)

    def lives_on(self) -> None:
        """Wait until it has pulsed a few times more."""
        enough = self.chatter.pulses + 3
        self.until(lambda: self.chatter.pulses >= enough)

    def has_heard(self, count: int) -> bool:
        return len(self.chatter.heard) >= count

    def is_free(self) -> bool:
        """Whether nobody holds the port."""
        return self.wire.holder is None

    def told(self, kind: str) -> list[str]:
        return [notice.message for notice in list(self.notices) if notice.kind == kind]


@pytest.fixture
def rig() -> Iterator[Rig]:
    echo, timeline = Echo(), Timeline()
    wire = HandWire(echo, timeline)
    notices: list[DeviceStatus] = []
    rig = Rig(wire.link("echo", report=notices.append), wire, timeline, echo, notices)
    yield rig
    rig.link.close()


def raising(error: BaseException) -> Callable[..., None]:
    def throw(*_: object) -> None:
        raise error

    return throw


# --- pauses -----------------------------------------------------------------------------------------------------------


def test_bytes_are_gathered_for_the_requested_time(rig: Rig) -> None:
    rig.open()
    rig.chatter.patience = 0.5
    rig.lives_on()
    begun, rig.chatter.pulses = rig.timeline.clock.now(), 0
    for letter in (b"a", b"b", b"c"):
        rig.wire.take(letter)
        rig.timeline.run_until(rig.timeline.clock.now() + 0.1)
        assert rig.chatter.heard == b""
    rig.until(lambda: rig.chatter.heard)
    assert (rig.chatter.heard, rig.chatter.pulses) == (b"abc", 1)
    assert rig.timeline.clock.now() - begun == pytest.approx(0.5, abs=0.02)
    rig.wire.take(b"d")
    rig.link.wake()
    rig.timeline.run_until(rig.timeline.clock.now() + 0.02)
    assert (rig.chatter.heard, rig.chatter.pulses) == (b"abcd", 2)


# --- listeners --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("error", ANYTHING)
def test_a_guarded_listener_never_raises_and_is_logged_once(
    error: BaseException, caplog: pytest.LogCaptureFixture
) -> None:
    listener = guard_callback(raising(error))
    with caplog.at_level(logging.ERROR):
        listener(1)
        listener(2)
    (record,) = caplog.records
    assert str(error) in record.getMessage()


def test_guarded_callback_passes_values_and_keyboard_interrupt() -> None:
    heard: list[int] = []
    guard_callback(heard.append)(3)
    assert heard == [3]
    with pytest.raises(KeyboardInterrupt):
        guard_callback(raising(KeyboardInterrupt()))()


def test_failing_log_is_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logging.getLogger("drivers.transport.loop"), "error", raising(SystemExit(1)))
    guard_callback(raising(SystemExit(1)))()


# --- the loop -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("error", ANYTHING)
def test_exception_in_report_does_not_end_the_thread(rig: Rig, error: BaseException) -> None:
    rig.link = rig.wire.link("echo", report=raising(error))
    rig.open()
    rig.lives_on()
    rig.wire.unplug()
    rig.until(lambda: not rig.link.online)
    rig.wire.plug_in()
    rig.until(lambda: rig.chatter.connections == 2)
    rig.lives_on()
    rig.link.close()
    assert rig.is_free()


@pytest.mark.parametrize("error", ANYTHING)
@pytest.mark.parametrize("where", ["at_received", "at_pulse"])
def test_exception_in_the_listener_does_not_end_the_thread(rig: Rig, error: BaseException, where: str) -> None:
    setattr(rig.chatter, where, raising(error))
    rig.open()
    for count in range(1, 6):
        rig.link.write(b"x")
        rig.until(partial(rig.has_heard, count))
    assert rig.link.online
    setattr(rig.chatter, where, ignore)
    rig.lives_on()
    assert rig.told("fault") == [f"{type(error).__name__}: {error}"]


@pytest.mark.parametrize("error", ANYTHING)
def test_failed_connect_callback_is_retried_on_a_reopened_port(rig: Rig, error: BaseException) -> None:
    rig.chatter.at_connected = raising(error)
    rig.open()
    rig.until(lambda: rig.chatter.connections >= 3)
    assert rig.told("fault") == [f"{type(error).__name__}: {error}"]
    assert rig.told("online") == []
    assert (rig.chatter.pulses, rig.chatter.heard) == (0, b"")
    rig.chatter.at_connected = ignore
    rig.lives_on()
    assert rig.link.online
    assert len(rig.told("online")) == 1


@pytest.mark.parametrize("error", ANYTHING)
def test_closing_releases_the_port_whatever_the_last_word_raises(rig: Rig, error: BaseException) -> None:
    rig.chatter.at_ending = raising(error)
    rig.open()
    rig.lives_on()
    rig.link.close()
    assert not rig.link.online
    assert not rig.link.health().online
    assert rig.is_free()


def test_last_write_is_sent_before_the_port_closes(rig: Rig) -> None:
    rig.chatter.at_ending = lambda: rig.link.write(b"farewell")
    rig.open()
    rig.lives_on()
    rig.link.close()
    rig.until(lambda: rig.echo.heard == b"farewell")


def test_port_lost_in_a_write_is_offline_at_once(rig: Rig) -> None:
    rig.open()
    port = rig.link._port
    assert isinstance(port, HandPort)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(port, "write", raising(serial.SerialException("gone")))
        with pytest.raises(NotConnected, match="gone"):
            rig.link.write(b"x")
        assert not rig.link.online
        assert "gone" in rig.link.health().detail
        assert not rig.is_free()
    rig.until(lambda: rig.chatter.connections == 2)
    assert len(rig.told("offline")) == 1


def test_unreadable_data_does_not_delay_the_poll(rig: Rig) -> None:
    rig.open()
    rig.chatter.at_received = raising(ValueError("broken"))
    before = rig.chatter.pulses
    for _ in range(20):  # a device that never pauses
        rig.wire.take(b"x")
        rig.timeline.run_until(rig.timeline.clock.now() + 0.01)
    assert rig.chatter.pulses - before >= 5
    assert rig.told("fault") == ["ValueError: broken"]
