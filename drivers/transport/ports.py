"""Serial ports: opened for one owner, with an error that says who holds them or what is missing.

What stands at the place of one is found out without opening it: that alone resets some boards.
"""

import errno
import os
import re
import select
import stat
import termios
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import serial

from drivers.errors import NotConnected
from drivers.transport.programs import Program, device_holders, end_command, explain_denied

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

PORTS_HINT = "mission ports  (what is plugged in, and what answers there)"
"""What to type where a port is not what it should be."""

_FILE_KINDS = {
    stat.S_ISREG: "a file",
    stat.S_ISDIR: "a folder",
    stat.S_ISFIFO: "a pipe",
    stat.S_ISSOCK: "a socket",
    stat.S_ISBLK: "a disk",
}
"""What stands in a file system besides devices of characters, which serial ports are."""


def find_non_serial_kind(port: str) -> str | None:
    """Say what stands at ``port`` where that is of no kind that a serial port can be.

    None for one that may be, and where there is nothing: it may be plugged in yet.
    """
    try:
        status = Path(port).stat()
    except (OSError, ValueError):
        return None
    for is_kind, word in _FILE_KINDS.items():
        if is_kind(status.st_mode):
            return word
    number = f"{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}"
    try:
        subsystem = (Path("/sys/dev/char") / number / "subsystem").resolve(strict=True).name
    except OSError:  # a pseudo-terminal is not listed
        return None
    return None if subsystem == "tty" else f"a device of another kind ({subsystem})"


def require_serial_ports(ports: Mapping[str, str]) -> None:
    """Raise NotConnected where a part's port can never be one, with all that are not."""
    wrong = {part: what for part, port in ports.items() if (what := find_non_serial_kind(port)) is not None}
    if wrong:
        found = (f"{part}: {ports[part]}: no serial port, but {what}" for part, what in wrong.items())
        raise NotConnected("\n".join(found), hint=PORTS_HINT)


DEBUG_CONNECTOR, PINS_PORT = "/dev/ttyAMA10", "/dev/ttyAMA0"
"""Serial ports of a Raspberry Pi 5: of its debug connector, where /dev/serial0 leads, and of GPIO 14 and 15."""

UART_SETTING = "dtparam=uart0=on in /boot/firmware/config.txt, and a restart"
"""The setting that switches the port of the pins on."""

DEBUG_CONNECTOR_PROBLEM = f"leads to the debug connector of this Raspberry Pi 5 ({DEBUG_CONNECTOR}), not to its pins"
PINS_HINT = f"port: {PINS_PORT}  (GPIO 14 and 15, after {UART_SETTING})"
"""The message about a link to the debug connector, and its hint."""

_PI_5 = re.compile(r"Raspberry Pi (5|500|Compute Module 5)\b")


def is_raspberry_pi_5(root: Path = Path("/")) -> bool:
    """Return whether the machine whose files lie under ``root`` has the chip of a Raspberry Pi 5."""
    tree = root / "proc/device-tree"
    with suppress(OSError):
        if _PI_5.search((tree / "model").read_text(errors="replace")):
            return True
    with suppress(OSError):
        return "brcm,bcm2712" in (tree / "compatible").read_text(errors="replace").split("\0")
    return False


def leads_to_debug_connector(port: str, root: Path = Path("/")) -> bool:
    """Return whether a port is a link, such as /dev/serial0, to the debug connector of a Raspberry Pi 5.

    ``DEBUG_CONNECTOR`` itself is none: a device may be wired to it on purpose.
    """
    link = root / port.lstrip("/")
    return link.is_symlink() and link.resolve().name == Path(DEBUG_CONNECTOR).name and is_raspberry_pi_5(root)


_CONTROL_FLAGS_INDEX = 2
"""Where ``termios.tcgetattr`` has the control modes in its list."""

READ_SIZE = 4096
"""Bytes that are read at once at most: all that Linux keeps of a serial line."""


class SerialPort(serial.Serial):
    """A serial port that asks the system no more often than it must, and leaves DTR as it was set when it is closed."""

    def read_available(self, timeout: float) -> bytes:
        """Return what has arrived; wait up to ``patience`` seconds for the first byte of it.

        Raises OSError when the port has gone, which an empty read of one that is ready says too.
        """
        if not select.select([self.fileno()], [], [], timeout)[0]:
            return b""
        data = os.read(self.fileno(), READ_SIZE)
        if not data:
            raise OSError(errno.EIO, "nothing left to read: the device has gone, or another program reads it too")
        return data

    def write(self, data: "ReadableBuffer", /) -> int:
        """Send ``data`` whole, as pyserial does, but without asking whether there was room for what has gone out."""
        whole = memoryview(data)
        try:
            sent = os.write(self.fileno(), whole)
        except BlockingIOError:
            sent = 0
        if sent < len(whole):
            super().write(whole[sent:])
        return len(whole)

    def set_dtr(self, *, on: bool) -> None:
        """Set the modem line DTR.

        Linux drops the line with the last close unless HUPCL is off (termios(3)). A pseudo-terminal has no such line,
        and that is no error. Raises OSError when the port has gone.
        """
        try:
            settings = termios.tcgetattr(self.fileno())
            settings[_CONTROL_FLAGS_INDEX] &= ~termios.HUPCL
            termios.tcsetattr(self.fileno(), termios.TCSANOW, settings)
        except termios.error as error:
            raise OSError(*error.args) from error
        try:
            self.dtr = on
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTTY):
                raise


def open_port(part: str, port: str, baud: int, *, timeout: float = 0.02) -> SerialPort:
    """Open ``port`` at ``baud``, 8N1, exclusively; reads wait ``timeout`` seconds at most, writes half a second.

    Raises NotConnected, with what to try: nothing there, no serial port, no right to it, or held by another
    process; a name of the debug connector of a Raspberry Pi 5.
    """
    if leads_to_debug_connector(port):
        raise NotConnected(f"{part}: {port}: {DEBUG_CONNECTOR_PROBLEM}", hint=PINS_HINT)
    require_serial_ports({part: port})
    # Before it is opened: that sets the baud rate of whoever holds it, too, and would part a robot from its program.
    if holders := device_holders(port):
        raise _make_in_use_error(part, port, holders)
    try:
        return SerialPort(port, baud, timeout=timeout, write_timeout=0.5, exclusive=True)
    except (serial.SerialException, OSError) as error:
        raise make_port_error(part, port, error) from error


class PortLostError(OSError):
    """A port that has gone, of a kind for which there is something better to try than to look at it."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.hint = hint


def make_port_error(part: str, port: str, error: BaseException) -> NotConnected:
    """Turn what the operating system says of ``port`` into an error with a cure."""
    number = _errno_of(error)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return NotConnected(
            f"{part}: {port}: no such device",
            hint=PORTS_HINT,
        )
    if number == errno.EACCES:
        what, hint = explain_denied(Path(port))
        return NotConnected(f"{part}: {port}: {what}", hint=hint)
    if number in (errno.EAGAIN, errno.EBUSY):
        return _make_in_use_error(part, port, device_holders(port))
    what = str(error).removeprefix(f"{part}: {port}: ")  # which opening it may have said
    return NotConnected(
        f"{part}: {port}: {what}", hint=error.hint if isinstance(error, PortLostError) else f"ls -l {port}"
    )


def _make_in_use_error(part: str, port: str, holders: Sequence[Program]) -> NotConnected:
    by = f" by {', '.join(map(str, holders))}" if holders else ""
    hint = end_command(holders, f"fuser -v {port}  (who holds it)")
    return NotConnected(f"{part}: {port}: in use{by}", hint=hint)


def _errno_of(error: BaseException) -> int | None:
    """Pyserial sometimes carries the number in the exception's arguments, sometimes only in the one it wraps."""
    if isinstance(error, OSError) and error.errno is not None:
        return error.errno
    return _errno_of(error.__context__) if error.__context__ is not None else None
