"""What a range finder needs of its line: DTR, which stays as it is set, and bytes that gather before they are read."""

import errno
import termios
from collections.abc import Iterator
from threading import Event

import pytest

from drivers.api import Health
from drivers.clock import SystemClock
from drivers.errors import NotConnected
from drivers.transport.link import SerialLink
from drivers.transport.ports import open_port
from drivers.virtual.terminal import PseudoTerminal
from tests.waiting import wait_until

BAUD = 115200


class Source:
    """Says a byte every five milliseconds."""

    baud = BAUD

    def feed(self, data: bytes, now: float) -> bytes:
        del data, now
        return b""

    def poll(self, now: float) -> bytes:
        del now
        return b"x"


class Reader:
    """A talker that counts what it gets, and in how many pieces."""

    def __init__(self) -> None:
        self.pieces: list[int] = []
        self.ended = Event()

    def on_connected(self) -> None: ...

    def on_data(self, data: bytes) -> None:
        self.pieces.append(len(data))

    def on_poll(self) -> None: ...

    def on_closing(self) -> None:
        self.ended.set()


@pytest.fixture
def terminal() -> Iterator[PseudoTerminal]:
    terminal = PseudoTerminal("source", Source(), SystemClock())
    terminal.open()
    yield terminal
    terminal.close()


@pytest.mark.parametrize("on", [True, False])
def test_dtr_is_kept_when_the_port_closes(terminal: PseudoTerminal, on: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[bool] = []
    with open_port("range", terminal.path, BAUD) as port:
        monkeypatch.setattr(port, "_update_dtr_state", lambda: lines.append(port.dtr))
        settings = termios.tcgetattr(port.fileno())
        settings[2] |= termios.HUPCL
        termios.tcsetattr(port.fileno(), termios.TCSANOW, settings)
        port.set_dtr(on=on)
        assert lines == [on]
        assert not termios.tcgetattr(port.fileno())[2] & termios.HUPCL
        wait_until(lambda: port.read(1) == b"x")  # the port is as usable as before


def test_a_terminal_without_modem_lines_is_no_error(terminal: PseudoTerminal) -> None:
    with open_port("range", terminal.path, BAUD) as port:
        port.set_dtr(on=True)


def test_any_other_trouble_with_the_line_is_an_error(terminal: PseudoTerminal, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks() -> None:
        raise OSError(errno.EIO, "broken")

    with open_port("range", terminal.path, BAUD) as port:
        monkeypatch.setattr(port, "_update_dtr_state", breaks)
        with pytest.raises(OSError, match="broken"):
            port.set_dtr(on=True)


def test_lost_port_raises_an_error_with_errno(terminal: PseudoTerminal) -> None:
    with open_port("range", terminal.path, BAUD) as port:
        terminal.unplug()
        found: list[int | None] = []

        def fails() -> bool:
            try:
                port.set_dtr(on=True)
            except OSError as error:
                found.append(error.errno)
            return bool(found)

        wait_until(fails)  # the terminal's thread may still be looking at it
        assert found == [errno.EIO]


def test_a_link_passes_dtr_on_and_is_offline_once_the_port_has_gone(terminal: PseudoTerminal) -> None:
    link, reader = SerialLink("range", terminal.path, BAUD, retry_interval=0.05), Reader()
    with pytest.raises(NotConnected, match="not opened yet"):
        link.set_dtr(on=True)
    link.open(reader)
    wait_until(lambda: link.online)
    link.set_dtr(on=True)
    terminal.unplug()

    def fails() -> Health | None:
        try:
            link.set_dtr(on=True)
        except NotConnected:
            return link.health()
        return None

    wait_until(fails)
    assert not link.health().online
    link.close()


def test_gather_time_batches_bytes_without_delaying_close(terminal: PseudoTerminal) -> None:
    plain, patient = Reader(), Reader()
    for reader, gather in ((plain, 0.0), (patient, 0.1)):
        link = SerialLink("range", terminal.path, BAUD, gather_time=gather)
        link.open(reader)
        wait_until(lambda: sum(reader.pieces) >= 60)  # noqa: B023 - it is waited for in the loop
        link.close()
        assert reader.ended.is_set()
    assert sum(patient.pieces) / len(patient.pieces) > 2 * sum(plain.pieces) / len(plain.pieces)
