"""Pseudo-terminal with a virtual device, which a real driver opens as a serial port.

A device is an object without I/O: it receives bytes and times, and returns bytes. So the same device runs here in real
time, in a unit test without a terminal, and in simulated time.
"""

import contextlib
import fcntl
import os
import secrets
import select
import shutil
import struct
import tempfile
import tty
import weakref
from collections.abc import Callable
from pathlib import Path
from threading import Event, RLock, Thread
from typing import Protocol, TypeVar, runtime_checkable

from drivers.clock import Clock
from drivers.virtual.patient_clock import PatientClock

T = TypeVar("T")

SPIN_TIME = 150e-6
"""Seconds before a due time that are waited for in a busy loop, since a sleep is not that precise."""

BAUD_TOLERANCE = 0.03
"""Maximum relative difference of the baud rates of two devices that can communicate."""

_TCGETS2 = 0x802C542A
"""Request of Linux for ``struct termios2``, which has any baud rate as a number, in its last four bytes."""
_TERMIOS2_SIZE = 44


class WireDevice(Protocol):
    """Virtual device at wire level: bytes and time in, bytes out."""

    @property
    def baud(self) -> int:
        """Baud rate of the device. The terminal drops bytes at another rate."""
        ...

    def feed(self, data: bytes, now: float) -> bytes:
        """Handle bytes from the computer at time ``now``; return the reply, often empty."""
        ...

    def poll(self, now: float) -> bytes:
        """Advance to time ``now``; return the bytes that the device sends by itself."""
        ...


@runtime_checkable
class TimedDevice(Protocol):
    """Device that sends bytes at exact times: the terminal polls it at these times, and also periodically."""

    def next_poll_time(self) -> float | None:
        """Return the time at which ``poll`` will return bytes; None if no bytes are pending."""
        ...


@runtime_checkable
class MultiRateDevice(Protocol):
    """Device whose parts have different baud rates, such as a bus of servos.

    The terminal passes on all bytes and the computer's baud rate; the device decides which parts receive them.
    """

    def set_baud(self, baud: int) -> None:
        """Set the baud rate of the computer."""


@runtime_checkable
class PoweredDevice(Protocol):
    """Device that is powered by the plug of its wire, so it starts when it is plugged in."""

    def power_on(self, now: float) -> None:
        """Switch the power on at time ``now``."""


def baud_rates_match(one: int, other: int) -> bool:
    """Return whether two ends of a wire with these rates understand each other."""
    return abs(one - other) <= BAUD_TOLERANCE * max(one, other)


class PseudoTerminal:
    """Runs a virtual device on a pseudo-terminal, on a thread of its own; a ``TimedDevice`` is polled on time.

    ``path`` is a stable name (a symbolic link), which stays the same after ``unplug`` and ``replug``, as a name by a
    udev rule does. ``distort`` may be set at any time: it receives the bytes that the device sends, and returns those
    that arrive, such as none or damaged ones. For ``busy_wait`` seconds after an exchange the port is polled without
    sleeping, since waking from a sleep is too slow for exact times; this occupies a processor. A ``PatientClock`` waits
    for the device.
    """

    def __init__(
        self, name: str, device: WireDevice, clock: Clock, *, poll_interval: float = 0.005, busy_wait: float = 0.0
    ) -> None:
        self.name = name
        self.device = device
        self.distort: Callable[[bytes], bytes] = bytes
        self._timed_device = device if isinstance(device, TimedDevice) else None
        self._multi_rate_device = device if isinstance(device, MultiRateDevice) else None
        self._clock = clock
        self._patient_clock = clock if isinstance(clock, PatientClock) else None
        self._poll_interval = poll_interval
        self._busy_wait = busy_wait
        self._busy_until = 0.0
        self._folder = Path(tempfile.gettempdir()) / f"missiontree-{secrets.token_hex(8)}"
        self.path = str(self._folder / name)
        self._remove_folder: weakref.finalize[[Path], PseudoTerminal] | None = (
            None  # removes the folder, at exit at the latest
        )
        self._lock = RLock()
        self._master = self._slave = -1
        self._ending = Event()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Plug the device in and start it. Does nothing while open."""
        if self._thread is not None:
            return
        self._folder.mkdir(mode=0o700)
        self._remove_folder = weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        self.replug()
        self._ending.clear()
        self._thread = Thread(target=self._run, name=f"virtual {self.name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Unplug, end the thread and remove the path. Safe more than once."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self.unplug()
        if self._remove_folder is not None:
            self._remove_folder()

    def unplug(self) -> None:
        """Pull the plug: the port disappears, even if it is open. The device continues without a wire."""
        with self._lock:
            Path(self.path).unlink(missing_ok=True)
            for descriptor in (self._master, self._slave):
                if descriptor >= 0:
                    os.close(descriptor)
            self._master = self._slave = -1

    def replug(self) -> None:
        """Plug in again: a new port with the same path."""
        with self._lock:
            if self._master >= 0:
                return
            self._master, self._slave = os.openpty()
            # Raw before anyone opens it, else the first bytes are echoed and cooked. We keep the slave open, else the
            # master reads EIO whenever the last client has closed.
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            if isinstance(self.device, PoweredDevice):
                self.device.power_on(self._clock.now())
            Path(self.path).symlink_to(os.ttyname(self._slave))

    def call_paused(self, question: Callable[[], T]) -> T:
        """Call ``question`` while the device is paused, and return its result."""
        with self._lock:
            return question()

    def client_baud(self) -> int | None:
        """Return the baud rate that the computer has set.

        The result is None while unplugged, or if the system does not report it.
        """
        try:
            settings = fcntl.ioctl(self._master, _TCGETS2, bytes(_TERMIOS2_SIZE))
        except (OSError, ValueError):  # ValueError: the descriptor is -1, unplugged
            return None
        return int(struct.unpack_from("I", settings, _TERMIOS2_SIZE - 4)[0])

    def _run(self) -> None:
        try:
            while not self._ending.is_set():
                if self._patient_clock is not None:
                    self._patient_clock.heartbeat(self)
                self._run_once()
        finally:
            if self._patient_clock is not None:
                self._patient_clock.unregister(self)

    def _run_once(self) -> None:
        """Wait until bytes arrive or the device has bytes to send, then exchange them."""
        with self._lock:
            master, due = self._master, self._timed_device.next_poll_time() if self._timed_device else None
        rest = self._poll_interval if due is None else min(self._poll_interval, due - self._clock.now())
        if master < 0:
            self._ending.wait(self._poll_interval)
        elif self._clock.now() >= self._busy_until:
            with contextlib.suppress(OSError, ValueError):  # unplugged while we waited
                select.select([master], [], [], max(0.0, rest - SPIN_TIME))
            self._spin(due)
        with self._lock:
            self._exchange()

    def _spin(self, due: float | None) -> None:
        """Wait in a busy loop for the time ``due`` if it is less than ``SPIN_TIME`` away; else return at once."""
        while due is not None and 0 < due - self._clock.now() <= SPIN_TIME and not self._ending.is_set():
            pass

    def _exchange(self) -> None:
        """Pass received bytes to the device, and send its bytes."""
        now = self._clock.now()
        data = b""
        if self._master >= 0:
            with contextlib.suppress(OSError):
                data = os.read(self._master, 4096)
        received = data if self._baud_matches() else b""
        answer = (self.device.feed(received, now) if received else b"") + self.device.poll(now)
        if self._busy_wait and (data or answer):
            self._busy_until = now + self._busy_wait
        if answer and self._master >= 0 and self._baud_matches():
            with contextlib.suppress(OSError):  # the buffer is full: the bytes are lost, as on a wire
                os.write(self._master, self.distort(answer))

    def _baud_matches(self) -> bool:
        """Return whether computer and device have the same baud rate, as far as the system reports it."""
        rate = self.client_baud()
        if rate is not None and self._multi_rate_device is not None:
            self._multi_rate_device.set_baud(rate)
        return rate is None or baud_rates_match(rate, self.device.baud)
