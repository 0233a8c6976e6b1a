"""A game pad beside a mission: it takes the wheels and gives them back, and may come and go."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread

import pytest

from drivers.api import DeviceStatus, Source, Velocity
from drivers.clock import ManualClock, SystemClock
from drivers.errors import NotConnected
from drivers.kobuki.driver import kobuki_base
from drivers.kobuki.virtual import VirtualKobuki
from drivers.kobuki.wire import BAUD
from drivers.transport.link import SerialLink
from drivers.virtual.terminal import PseudoTerminal
from missions.plugins.teleop import layout
from missions.plugins.teleop.hand_driving import PadDevice
from missions.plugins.teleop.layout import AxisRange
from missions.plugins.teleop.layout import PadEvent as Told
from missions.plugins.teleop.pad import Pad
from missions.plugins.testing.recorders import RecordedBase
from tests.missions.command import command
from tests.waiting import wait_until

BACK = Told(layout.ABS, layout.STICK_Y, 32767)
HOLD, LET_GO = (Told(layout.KEY, layout.SHOULDER_LEFT, value) for value in (1, 0))


class Node:
    """The node of a pad, which may be plugged in and pulled out: a named pipe."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._hand = -1

    def pad(self) -> Pad:
        return Pad(str(self.path), SystemClock(), read_range=lambda *_: AxisRange(-32768, 32767))

    def plug(self) -> None:
        os.mkfifo(self.path)
        self._hand = os.open(self.path, os.O_RDWR)

    def pull(self) -> None:
        if self._hand >= 0:
            self.path.unlink()
            os.close(self._hand)
            self._hand = -1

    def do(self, *done: Told) -> None:
        os.write(self._hand, b"".join(each.pack() for each in done))


@pytest.fixture
def node(tmp_path: Path) -> Iterator[Node]:
    found = Node(tmp_path / "event7")
    yield found
    found.pull()


@pytest.mark.real_time
def test_pad_drives_while_held_and_mission_resumes_on_release(node: Node) -> None:
    clock, ending = SystemClock(), Event()
    terminal = PseudoTerminal("kobuki", VirtualKobuki(), clock)
    base = kobuki_base(SerialLink("base", terminal.path, BAUD), clock)
    beside = PadDevice(base, node.pad, clock)
    node.plug()

    def mission() -> None:
        while not ending.wait(0.05):
            with suppress(NotConnected):  # where this machine stops for a while, the base seems to be silent
                base.drive(Velocity(0.2, 0.0))

    def steers(source: Source, ahead: float) -> bool:
        steering = base.steering()
        return (steering.source, steering.allowed) == (source, Velocity(ahead, 0.0))

    driving = Thread(target=mission)
    terminal.open()
    base.open()
    beside.open()
    try:
        wait_until(lambda: base.health().online and beside.health().online)
        driving.start()
        wait_until(lambda: steers(Source.MISSION, 0.2))
        node.do(BACK, HOLD)
        wait_until(lambda: steers(Source.TELEOP, -0.25))
        node.do(LET_GO)
        wait_until(lambda: steers(Source.TELEOP, 0.0))
        wait_until(lambda: steers(Source.MISSION, 0.2))
    finally:
        ending.set()
        if driving.ident is not None:
            driving.join()
        beside.close()
        base.close()
        terminal.close()


@pytest.mark.real_time
def test_a_pad_may_come_late_and_go_and_come_again(node: Node) -> None:
    base, told = RecordedBase(ManualClock()), list[DeviceStatus]()
    beside = PadDevice(base, node.pad, SystemClock(), report=told.append)
    beside.close()
    beside.open()
    try:
        wait_until(lambda: "no such device" in beside.health().detail)
        node.plug()
        wait_until(lambda: beside.health().online)
        node.do(BACK, HOLD)
        wait_until(lambda: base.commands)
        node.pull()
        wait_until(lambda: not beside.health().online)
        assert "stop" in base.commands
        node.plug()
        wait_until(lambda: beside.health().online)
    finally:
        beside.close()
    assert [notice.kind for notice in told] == ["online", "offline", "online"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--simulate", "fast", "motions/forward"), "--pad needs real time"),
        (("hello.yaml",), "--pad drives the base, which hello does not use"),
    ],
)
def test_pad_option_without_a_base_to_drive_is_refused(
    arguments: tuple[str, ...],
    words: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("hello.yaml").write_text("mission: hello\ntree:\n  say: Hello\n", encoding="utf-8")
    outcome = command(capsys, "run", "--pad", *arguments)
    assert (outcome.code, words in outcome.err) == (2, True)


def test_missing_pad_device_is_reported_as_disconnected_part(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("missions.assembly.assembled_robot.CONNECT_TIMEOUT", 0.5)
    outcome = command(capsys, "run", "motions/forward", "--pad", "/dev/input/event999")
    assert outcome.code == 3
    assert "pad: /dev/input/event999: no such device" in outcome.err
