"""A serial line that is owned, read on a thread of its own, and found again after it was lost."""

from collections.abc import Callable
from contextlib import suppress
from threading import RLock
from typing import Protocol

import serial

from drivers.api import DeviceStatus, Health, StatusCallback, ignore
from drivers.errors import NotConnected
from drivers.transport.loop import LoopFactory, ThreadLoop, guard_callback
from drivers.transport.ports import SerialPort, make_port_error, open_port

POLL_INTERVAL = 0.02
"""Seconds for which bytes are waited for at most: how often ``on_poll`` is called when nothing arrives."""


class LinkHandler(Protocol):
    """The protocol on top of a link. All four are called from the link's thread.

    Whatever they raise does not end that thread: NotConnected makes the link look for the port again, anything else
    is reported as a fault when it is new.
    """

    def on_connected(self) -> None:
        """The port has just been opened: forget old state, say hello. If this raises, the port is given up again."""
        ...

    def on_data(self, data: bytes) -> None:
        """Bytes have arrived, cut anywhere."""
        ...

    def on_poll(self) -> float | None:
        """Called at least every ``POLL_INTERVAL`` seconds while the port is open: time-outs and renewals go here.

        May return for how many seconds it need not be called again, and bytes may gather, unless the link is woken.
        """
        ...

    def on_closing(self) -> None:
        """The thread ends, whatever the reason, and the port is released next: say the last word."""
        ...


class LinkPort(Protocol):
    """What a link needs of an open serial port. All but ``close`` raise OSError when it has gone."""

    def read_available(self, timeout: float) -> bytes:
        """Return what has arrived; wait up to ``patience`` seconds for the first byte of it."""
        ...

    def write(self, data: bytes) -> object:
        """Send ``data`` whole."""
        ...

    def set_dtr(self, *, on: bool) -> None:
        """Set the modem line DTR, so that it stays when the port is closed."""
        ...

    def close(self) -> None:
        """Let it go."""
        ...


PortOpener = Callable[[str, str, int], LinkPort]
"""Opens a port for somebody: who, which port, baud rate. Raises NotConnected, with what to try."""


def open_link_port(part: str, port: str, baud: int) -> SerialPort:
    """Open a serial port for a link. Raises NotConnected, with what to try."""
    return open_port(part, port, baud, timeout=POLL_INTERVAL)


class SerialLink:
    """Owns one serial port. Starts without it, opens it when it appears, and again whenever it comes back.

    Only the link's own thread opens and closes the port: who meets trouble on another one leaves it in ``_offline_cause``.
    ``gather`` is for how many seconds bytes may gather once the first has come: a device that talks without a pause
    otherwise wakes the thread a thousand times a second. ``open_link_port`` opens the port, ``loop`` makes what serves it.
    """

    def __init__(
        self,
        name: str,
        port: str,
        baud: int,
        *,
        retry_interval: float = 0.5,
        gather_time: float = 0.0,
        report: StatusCallback = ignore,
        opener: PortOpener = open_link_port,
        make_loop: LoopFactory = ThreadLoop,
    ) -> None:
        self.name = name
        self.port = port
        self.baud = baud
        self._retry_interval = retry_interval
        self._gather_time = gather_time
        self._report = guard_callback(report)
        self._opener = opener
        self._handler: LinkHandler | None = None
        self._port: LinkPort | None = None
        self._gathered = b""  # what came first; more may gather
        self._paused = False  # bytes have gathered since the last pulse
        self._offline_cause: NotConnected | None = None  # why there is no port, or why the one that is open must go
        self._fault = ""  # the newest that was reported
        self._was_connected = False  # the talker has made its beginning on this port
        self._lock = RLock()  # over the port while it is written, opened and closed
        self._loop = make_loop(f"link {name}", self._run_once, self._finish)
        self._connections = 0

    def open(self, handler: LinkHandler) -> None:
        """Start the thread that looks for the port and serves ``talker``."""
        self._handler = handler
        self._loop.start()

    def close(self) -> None:
        """End the thread and release the port. Safe from any state, more than once, from any thread but its own."""
        self._loop.end()

    def wake(self) -> None:
        """Call ``on_poll`` now, however long it need not be called. From any thread."""
        self._loop.wake()

    @property
    def online(self) -> bool:
        """True while the port is open and sound. The thread leaves none open when it ends."""
        return self._port is not None and self._offline_cause is None

    def health(self) -> Health:
        """Say whether the port is open, and if not, why."""
        if self.online:
            return Health(online=True, counters={"connections": self._connections})
        trouble = self._offline_error()
        return Health(online=False, detail=str(trouble), hint=trouble.hint)

    def write(self, data: bytes) -> None:
        """Send ``data`` whole; at most one writer at a time. Raises NotConnected when the port is not there."""
        self._use(lambda port: port.write(data))

    def set_dtr(self, *, on: bool) -> None:
        """Set the modem line DTR, which stays so when the port is closed. Raises NotConnected as ``write``."""
        self._use(lambda port: port.set_dtr(on=on))

    def _use(self, action: Callable[[LinkPort], object]) -> None:
        with self._lock:
            if self._port is None or self._offline_cause is not None:
                raise self._offline_error()
            try:
                action(self._port)
            except (serial.SerialException, OSError) as error:
                self._offline_cause = make_port_error(self.name, self.port, error)
                raise self._offline_error() from error

    def _offline_error(self) -> NotConnected:
        """Return a new error that says why there is no port: several threads may raise one at once."""
        trouble = self._offline_cause
        if trouble is None:
            return NotConnected(f"{self.name}: {self.port}: not opened yet")
        return NotConnected(str(trouble), hint=trouble.hint)

    # --- the link's thread --------------------------------------------------------------------------------------------

    def _run_once(self) -> float:
        talker = self._handler
        try:
            if talker is None:
                return POLL_INTERVAL
            if self._port is None:
                return self._connect(talker)
            if self._offline_cause is None:
                return self._serve(talker, self._port)
            self._release()
            if self._was_connected:
                self._report(DeviceStatus(self.name, "offline", str(self._offline_cause), self._offline_cause.hint))
            return self._retry_interval
        except NotConnected:
            return 0.0  # the next turn lets the port go, if it has gone
        except BaseException as error:  # SystemExit too: this thread alone can stop what it has set in motion
            self._report_fault(error)
            return POLL_INTERVAL

    def _connect(self, handler: LinkHandler) -> float:
        try:
            port = self._opener(self.name, self.port, self.baud)
        except NotConnected as error:
            self._offline_cause = error
            return self._retry_interval
        with self._lock:
            self._port, self._offline_cause = port, None
            self._connections += 1
        self._was_connected, self._gathered, self._paused = False, b"", False
        try:
            handler.on_connected()
        except BaseException as error:
            # Half a beginning is none: the next turn lets the port go.
            unfit = NotConnected(f"{self.name}: {self.port}: {_error_text(error)}")
            self._offline_cause = error if isinstance(error, NotConnected) else unfit
            raise
        self._was_connected = True
        self._report(DeviceStatus(self.name, "online", f"{self.port} is open at {self.baud} baud"))
        return 0.0

    def _serve(self, handler: LinkHandler, port: LinkPort) -> float:
        try:
            data = self._gathered + port.read_available(0.0 if self._gathered or self._paused else POLL_INTERVAL)
        except (serial.SerialException, OSError) as error:
            self._offline_cause = make_port_error(self.name, self.port, error)
            return 0.0
        if data and self._gather_time and not self._gathered:
            self._gathered = data
            return self._gather_time
        self._gathered = b""
        try:
            if data:
                handler.on_data(data)
        finally:  # data that cannot be read must not keep a driver from renewing what it sends
            pause = handler.on_poll() or 0.0
            self._paused = pause > 0
        return pause

    def _report_fault(self, error: BaseException) -> None:
        """Report a fault, unless it is the same as before: it may come with every pulse."""
        if (fault := _error_text(error)) != self._fault:
            self._fault = fault
            self._report(DeviceStatus(self.name, "fault", fault))

    def _finish(self) -> None:
        """Let the talker say its last word, and release the port whatever comes of that."""
        try:
            if self._port is not None and self._handler is not None:
                self._handler.on_closing()
        except NotConnected:
            return  # nobody is there to hear it
        except BaseException as error:
            self._report_fault(error)
        finally:
            self._release()

    def _release(self) -> None:
        """Close the port, which may be gone already."""
        with self._lock:
            port, self._port = self._port, None
            if port is not None:
                with suppress(serial.SerialException, OSError):
                    port.close()


def _error_text(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"
