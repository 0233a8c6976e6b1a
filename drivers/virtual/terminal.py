"""A pseudo-terminal with a device behind it: the real driver opens it as it would open a serial port.

The device itself is pure: bytes and the time go in, bytes come out. So the same device runs here in real time, in a
unit test without any terminal, and in simulated time.
"""

import contextlib
import os
import secrets
import select
import shutil
import tempfile
import termios
import tty
import weakref
from collections.abc import Callable
from pathlib import Path
from threading import Event, RLock, Thread
from typing import Protocol, TypeVar

from drivers.clock import Clock

T = TypeVar("T")


class WireDevice(Protocol):
    """A device as its wire shows it."""

    @property
    def baud(self) -> int:
        """The rate it listens at; at any other rate it hears nothing."""
        ...

    def feed(self, data: bytes, now: float) -> bytes:
        """Take bytes from the computer at time ``now``; return the answer, often empty."""
        ...

    def poll(self, now: float) -> bytes:
        """Let time pass until ``now``; return what the device says unasked."""
        ...


class Terminal:
    """Runs a device on a pseudo-terminal, on a thread of its own.

    ``path`` is a stable name (a symbolic link) that survives ``unplug`` and ``replug``, as a udev name does.
    ``distort`` may be set at any time: it sees all bytes that the device sends, and returns what arrives instead
    (nothing for silence, flipped bits for noise).
    """

    def __init__(self, name: str, device: WireDevice, clock: Clock, *, period: float = 0.005) -> None:
        self.name = name
        self.device = device
        self.distort: Callable[[bytes], bytes] = bytes
        self._clock = clock
        self._period = period
        self._folder = Path(tempfile.gettempdir()) / f"missiontree-{secrets.token_hex(8)}"
        self.path = str(self._folder / name)
        self._forget: weakref.finalize[[Path], Terminal] | None = None  # removes the folder, at exit if nobody did
        self._lock = RLock()
        self._master = self._slave = -1
        self._ending = Event()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Plug the device in and start it. Does nothing while it is open."""
        if self._thread is not None:
            return
        self._folder.mkdir(mode=0o700)
        self._forget = weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        self.replug()
        self._ending.clear()
        self._thread = Thread(target=self._run, name=f"virtual {self.name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Unplug, end the thread and remove the name. Safe more than once."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self.unplug()
        if self._forget is not None:
            self._forget()

    def unplug(self) -> None:
        """Pull the plug: the port vanishes under whoever has it open. The device goes on without a wire."""
        with self._lock:
            Path(self.path).unlink(missing_ok=True)
            for descriptor in (self._master, self._slave):
                if descriptor >= 0:
                    os.close(descriptor)
            self._master = self._slave = -1

    def replug(self) -> None:
        """Put the plug in again: a new port under the same name."""
        with self._lock:
            if self._master >= 0:
                return
            self._master, self._slave = os.openpty()
            # Raw before anyone opens it, else the first bytes are echoed and cooked. We keep the slave open, else the
            # master reads EIO whenever the last client has closed.
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            Path(self.path).symlink_to(os.ttyname(self._slave))

    def ask(self, question: Callable[[], T]) -> T:
        """Ask the device something while it stands still: its own thread waits until ``question`` is answered."""
        with self._lock:
            return question()

    def client_baud(self) -> int | None:
        """The rate that the computer has set on its side; None for one that termios cannot name, and when unplugged."""
        try:
            return _RATES.get(termios.tcgetattr(self._master)[5])
        except (termios.error, ValueError):  # ValueError: the descriptor is -1, unplugged
            return None

    def _run(self) -> None:
        while not self._ending.is_set():
            with self._lock:
                master = self._master
            if master < 0:
                self._ending.wait(self._period)
            else:
                with contextlib.suppress(OSError, ValueError):  # unplugged while we waited
                    select.select([master], [], [], self._period)
            with self._lock:
                self._exchange()

    def _exchange(self) -> None:
        """Pass on what has arrived, and what the device has to say."""
        now = self._clock.now()
        data = b""
        if self._master >= 0:
            with contextlib.suppress(OSError):
                data = os.read(self._master, 4096)
        heard = data if self.client_baud() in (self.device.baud, None) else b""
        answer = (self.device.feed(heard, now) if heard else b"") + self.device.poll(now)
        if answer and self._master >= 0 and self.client_baud() in (self.device.baud, None):
            with contextlib.suppress(OSError):  # nobody reads: the buffer is full, and the bytes are lost as on a wire
                os.write(self._master, self.distort(answer))


_RATES = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}
