"""Serial link that owns its port, reads it on a thread of its own, and reconnects."""

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
"""Maximum seconds to wait for bytes: the interval of ``on_poll`` on a silent port."""


class LinkHandler(Protocol):
    """Handler of the protocol on a link. All methods are called from the link's thread.

    An exception does not end that thread. After NotConnected the link opens the port again; any other exception is
    reported as a fault, unless it repeats the last one.
    """

    def on_connected(self) -> None:
        """Reset the state and start the session, since the port was just opened. An exception closes the port again."""
        ...

    def on_data(self, data: bytes) -> None:
        """Handle received bytes; a chunk may begin and end within a message."""
        ...

    def on_poll(self) -> float | None:
        """Handle timeouts, and send due data. Called every ``POLL_INTERVAL`` seconds while the port is open.

        May return the seconds for which no call is needed. Received bytes are buffered in that time, unless ``wake`` is
        called.
        """
        ...

    def on_closing(self) -> None:
        """Send the last commands, such as a stop. Called once before the thread ends and the port is closed."""
        ...


class LinkPort(Protocol):
    """Open serial port of a link. All methods but ``close`` raise OSError if it is gone."""

    def read_available(self, timeout: float) -> bytes:
        """Return received bytes; wait up to ``timeout`` seconds for the first one."""
        ...

    def write(self, data: bytes) -> object:
        """Send ``data`` completely."""
        ...

    def set_dtr(self, *, on: bool) -> None:
        """Set the modem line DTR, and keep it when the port is closed."""
        ...

    def close(self) -> None:
        """Close the port."""
        ...


PortOpener = Callable[[str, str, int], LinkPort]
"""Opens a port: name of the part, port, baud rate. Raises NotConnected, with a hint."""


def open_link_port(part: str, port: str, baud: int) -> SerialPort:
    """Open a serial port for a link. Raises NotConnected, with a hint."""
    return open_port(part, port, baud, timeout=POLL_INTERVAL)


class SerialLink:
    """Owner of a serial port: opens it when it appears, and again after each disconnect.

    ``name`` is the part in messages. ``retry_interval`` is the time in seconds between attempts to open the port. After
    the first byte, received bytes are collected for ``gather_time`` seconds: a device that sends continuously would
    otherwise wake the thread a thousand times per second. ``opener`` opens the port, ``make_loop`` makes the loop that
    serves it. Only the thread of that loop opens and closes the port.
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
        self._gathered = b""  # first bytes, while more are gathered
        self._paused = False  # bytes were buffered since the last poll
        self._offline_cause: NotConnected | None = None  # why the port is not open, or must be closed
        self._fault = ""  # last reported one
        self._was_connected = False  # the handler's ``on_connected`` has returned on this port
        self._lock = RLock()  # held while the port is written, opened and closed
        self._loop = make_loop(f"link {name}", self._run_once, self._finish)
        self._connections = 0

    def open(self, handler: LinkHandler) -> None:
        """Start the thread that opens the port and calls ``handler``."""
        self._handler = handler
        self._loop.start()

    def close(self) -> None:
        """End the thread and close the port. Safe from any state, more than once, from any thread but its own."""
        self._loop.end()

    def wake(self) -> None:
        """Call the handler's ``on_poll`` now, before it is due. Callable from any thread."""
        self._loop.wake()

    @property
    def online(self) -> bool:
        """True while the port is open without an error. It is closed when the thread ends."""
        return self._port is not None and self._offline_cause is None

    def health(self) -> Health:
        """Return whether the port is open, and if not, the reason."""
        if self.online:
            return Health(online=True, counters={"connections": self._connections})
        error = self._offline_error()
        return Health(online=False, detail=str(error), hint=error.hint)

    def write(self, data: bytes) -> None:
        """Send ``data`` completely; not for concurrent writers. Raises NotConnected if the port is not open."""
        self._use(lambda port: port.write(data))

    def set_dtr(self, *, on: bool) -> None:
        """Set the modem line DTR, and keep it when the port is closed. Raises NotConnected if the port is not open."""
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
        """Return a new error with the reason why the port is not open.

        It is a new one at each call, since several threads may raise it at the same time.
        """
        cause = self._offline_cause
        if cause is None:
            return NotConnected(f"{self.name}: {self.port}: not opened yet")
        return NotConnected(str(cause), hint=cause.hint)

    # --- the link's thread --------------------------------------------------------------------------------------------

    def _run_once(self) -> float:
        handler = self._handler
        try:
            if handler is None:
                return POLL_INTERVAL
            if self._port is None:
                return self._connect(handler)
            if self._offline_cause is None:
                return self._serve(handler, self._port)
            self._release()
            if self._was_connected:
                self._report(DeviceStatus(self.name, "offline", str(self._offline_cause), self._offline_cause.hint))
            return self._retry_interval
        except NotConnected:
            return 0.0  # the next pass closes the port, if it is gone
        except BaseException as error:  # SystemExit too: only this thread can stop the motion that it has started
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
            # An incomplete start is unusable: the next pass closes the port.
            port_error = NotConnected(f"{self.name}: {self.port}: {_error_text(error)}")
            self._offline_cause = error if isinstance(error, NotConnected) else port_error
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
        finally:  # invalid data must not keep a driver from renewing its commands
            pause = handler.on_poll() or 0.0
            self._paused = pause > 0
        return pause

    def _report_fault(self, error: BaseException) -> None:
        """Report an exception of the handler as a fault, unless it is the same as the last one."""
        if (fault := _error_text(error)) != self._fault:
            self._fault = fault
            self._report(DeviceStatus(self.name, "fault", fault))

    def _finish(self) -> None:
        """Let the handler send its last commands, then close the port in any case."""
        try:
            if self._port is not None and self._handler is not None:
                self._handler.on_closing()
        except NotConnected:
            return  # the device is unreachable
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
