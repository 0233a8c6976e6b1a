"""A serial line that is owned, read on a thread of its own, and found again after it was lost."""

from threading import Event, RLock, Thread
from typing import Protocol

import serial

from drivers.api import Health, Notice, Report, unreported
from drivers.errors import NotConnected
from drivers.ports import explain, open_port

PULSE = 0.02
"""Seconds that a read waits at most: how often ``pulse`` is called when nothing arrives."""


class Talker(Protocol):
    """The protocol on top of a link. All three are called from the link's thread."""

    def connected(self) -> None:
        """The port has just been opened: forget old state, say hello."""
        ...

    def received(self, data: bytes) -> None:
        """Bytes have arrived, cut anywhere."""
        ...

    def pulse(self) -> None:
        """Called at least every ``PULSE`` seconds while the port is open: time-outs and renewals go here."""
        ...


class Link:
    """Owns one serial port. Starts without it, opens it when it appears, and again whenever it comes back."""

    def __init__(self, name: str, port: str, baud: int, *, retry: float = 0.5, report: Report = unreported) -> None:
        self.name = name
        self.port = port
        self.baud = baud
        self._retry = retry
        self._report = report
        self._talker: Talker | None = None
        self._serial: serial.Serial | None = None
        self._trouble: NotConnected | None = None
        self._lock = RLock()
        self._ending = Event()
        self._thread: Thread | None = None
        self._connections = 0

    def open(self, talker: Talker) -> None:
        """Start the thread that looks for the port and serves ``talker``."""
        if self._thread is not None:
            return
        self._talker = talker
        self._ending.clear()
        self._thread = Thread(target=self._run, name=f"link {self.name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and release the port. Safe from any state, more than once, from any thread but its own."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    @property
    def online(self) -> bool:
        """True while the port is open."""
        return self._serial is not None

    def health(self) -> Health:
        """Say whether the port is open, and if not, why."""
        trouble = self._trouble
        if self.online:
            return Health(online=True, counters={"connections": self._connections})
        if trouble is None:
            return Health(online=False, detail=f"{self.name}: {self.port}: not opened yet")
        return Health(online=False, detail=str(trouble), hint=trouble.hint)

    def write(self, data: bytes) -> None:
        """Send ``data`` whole; at most one writer at a time. Raises NotConnected when the port is not there."""
        with self._lock:
            if self._serial is None:
                raise self._trouble or NotConnected(f"{self.name}: {self.port}: not opened yet")
            try:
                self._serial.write(data)
            except (serial.SerialException, OSError) as error:
                raise self._lost(error) from error

    def _lost(self, error: Exception) -> NotConnected:
        """Give the port up; the thread will look for it again."""
        with self._lock:
            port, self._serial = self._serial, None
            trouble = explain(self.name, self.port, error)
            self._trouble = trouble
            if port is not None:
                _release(port)
                self._report(Notice(self.name, "offline", f"{self.port} is gone: {error}", trouble.hint))
        return trouble

    def _run(self) -> None:
        talker = self._talker
        if talker is None:
            return
        while not self._ending.is_set():
            if self._serial is None and not self._connect(talker):
                self._ending.wait(self._retry)
                continue
            try:
                self._serve(talker)
            except NotConnected:
                continue  # already reported by _lost; look for the port again
            except Exception as error:
                self._report(Notice(self.name, "fault", f"{type(error).__name__}: {error}"))
                self._ending.wait(PULSE)
        with self._lock:
            if self._serial is not None:
                _release(self._serial)
                self._serial = None

    def _connect(self, talker: Talker) -> bool:
        try:
            port = open_port(self.name, self.port, self.baud, timeout=PULSE)
        except NotConnected as error:
            self._trouble = error
            return False
        with self._lock:
            self._serial, self._trouble = port, None
            self._connections += 1
        self._report(Notice(self.name, "online", f"{self.port} is open at {self.baud} baud"))
        try:
            talker.connected()
        except NotConnected:
            return False
        return True

    def _serve(self, talker: Talker) -> None:
        port = self._serial
        if port is None:
            return
        try:
            data = port.read(max(1, port.in_waiting))
        except (serial.SerialException, OSError, TypeError) as error:
            # TypeError: pyserial reads from a None descriptor when _lost closed the port under us.
            raise self._lost(error if isinstance(error, OSError) else OSError(str(error))) from error
        if data:
            talker.received(data)
        talker.pulse()


def _release(port: serial.Serial) -> None:
    """Close a port that may be gone already."""
    try:
        port.close()
    except (serial.SerialException, OSError):
        return
