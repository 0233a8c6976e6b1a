"""Serial ports: open a port exclusively; an error names the program that uses it, or says that it is missing.

The kind of a device file is checked without opening it, since opening resets some boards.
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

PORTS_HINT = "mission ports  (lists the connected devices)"
"""Hint in the error for a wrong serial port."""

_FILE_KINDS = {
    stat.S_ISREG: "a file",
    stat.S_ISDIR: "a folder",
    stat.S_ISFIFO: "a pipe",
    stat.S_ISSOCK: "a socket",
    stat.S_ISBLK: "a disk",
}
"""Names of the kinds of files that cannot be serial ports, by the function that recognises them."""


def find_non_serial_kind(port: str) -> str | None:
    """Return the kind of the file at ``port``, such as "a folder", if it cannot be a serial port; else None.

    A missing file may still be plugged in, so the result is None for it.
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
    """Raise NotConnected if any of ``ports`` (port by part) can never be a serial port; name all of them."""
    kinds = {part: what for part, port in ports.items() if (what := find_non_serial_kind(port)) is not None}
    if kinds:
        messages = (f"{part}: {ports[part]}: not a serial port but {what}" for part, what in kinds.items())
        raise NotConnected("\n".join(messages), hint=PORTS_HINT)


DEBUG_CONNECTOR, PINS_PORT = "/dev/ttyAMA10", "/dev/ttyAMA0"
"""Serial ports of a Raspberry Pi 5: its debug connector, to which /dev/serial0 leads, and GPIO 14 and 15."""

UART_SETTING = "dtparam=uart0=on in /boot/firmware/config.txt, and a restart"
"""Setting that enables the serial port on the pins of a Raspberry Pi."""

DEBUG_CONNECTOR_PROBLEM = f"leads to the debug connector of this Raspberry Pi 5 ({DEBUG_CONNECTOR}), not to its pins"
PINS_HINT = f"port: {PINS_PORT}  (GPIO 14 and 15, after {UART_SETTING})"
"""Hint for a port that is a link to the debug connector: use the port on the pins."""

_PI_5 = re.compile(r"Raspberry Pi (5|500|Compute Module 5)\b")


def is_raspberry_pi_5(root: Path = Path("/")) -> bool:
    """Return whether the machine whose files are under ``root`` has the chip of a Raspberry Pi 5."""
    tree = root / "proc/device-tree"
    with suppress(OSError):
        if _PI_5.search((tree / "model").read_text(errors="replace")):
            return True
    with suppress(OSError):
        return "brcm,bcm2712" in (tree / "compatible").read_text(errors="replace").split("\0")
    return False


def leads_to_debug_connector(port: str, root: Path = Path("/")) -> bool:
    """Return whether a port is a link, such as /dev/serial0, to the debug connector of a Raspberry Pi 5.

    False for ``DEBUG_CONNECTOR`` itself: a device may be wired to it on purpose.
    """
    link = root / port.lstrip("/")
    return link.is_symlink() and link.resolve().name == Path(DEBUG_CONNECTOR).name and is_raspberry_pi_5(root)


_CONTROL_FLAGS_INDEX = 2
"""Index of the control modes in the list of ``termios.tcgetattr``."""

READ_SIZE = 4096
"""Maximum bytes of a read: the size of Linux' buffer of a serial line."""


class SerialPort(serial.Serial):
    """Serial port with few system calls, which keeps DTR as it was set when it is closed."""

    def read_available(self, timeout: float) -> bytes:
        """Return received bytes; wait up to ``timeout`` seconds for the first one.

        Raises OSError if the port is gone, which shows as an empty read of a ready port.
        """
        if not select.select([self.fileno()], [], [], timeout)[0]:
            return b""
        data = os.read(self.fileno(), READ_SIZE)
        if not data:
            raise OSError(errno.EIO, "empty read: the device is gone, or another program reads it too")
        return data

    def write(self, data: "ReadableBuffer", /) -> int:
        """Send ``data`` completely. In contrast to pyserial there is no ``select`` after a successful write."""
        view = memoryview(data)
        try:
            sent = os.write(self.fileno(), view)
        except BlockingIOError:
            sent = 0
        if sent < len(view):
            super().write(view[sent:])
        return len(view)

    def set_dtr(self, *, on: bool) -> None:
        """Set the modem line DTR.

        Linux drops the line with the last close unless HUPCL is off (termios(3)). On a pseudo-terminal, which has no
        DTR, this does nothing. Raises OSError if the port is gone.
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

    Raises NotConnected, with a hint, if the port is missing, is not a serial port, may not be opened by the user, is
    used by another program, or is the debug connector of a Raspberry Pi 5.
    """
    if leads_to_debug_connector(port):
        raise NotConnected(f"{part}: {port}: {DEBUG_CONNECTOR_PROBLEM}", hint=PINS_HINT)
    require_serial_ports({part: port})
    # Before it is opened: opening would change the baud rate for its holder, and disconnect a running robot.
    if holders := device_holders(port):
        raise _make_in_use_error(part, port, holders)
    try:
        return SerialPort(port, baud, timeout=timeout, write_timeout=0.5, exclusive=True)
    except (serial.SerialException, OSError) as error:
        raise make_port_error(part, port, error) from error


class PortLostError(OSError):
    """Error for a port that was lost, with a hint."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.hint = hint


def make_port_error(part: str, port: str, error: BaseException) -> NotConnected:
    """Return an error with a hint for an error of the operating system at ``port``."""
    number = _errno_of(error)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return NotConnected(
            f"{part}: {port}: no such device",
            hint=PORTS_HINT,
        )
    if number == errno.EACCES:
        message, hint = explain_denied(Path(port))
        return NotConnected(f"{part}: {port}: {message}", hint=hint)
    if number in (errno.EAGAIN, errno.EBUSY):
        return _make_in_use_error(part, port, device_holders(port))
    message = str(error).removeprefix(f"{part}: {port}: ")  # a prefix that the opener may have added
    return NotConnected(
        f"{part}: {port}: {message}", hint=error.hint if isinstance(error, PortLostError) else f"ls -l {port}"
    )


def _make_in_use_error(part: str, port: str, holders: Sequence[Program]) -> NotConnected:
    by = f" by {', '.join(map(str, holders))}" if holders else ""
    hint = end_command(holders, f"fuser -v {port}  (shows its holder)")
    return NotConnected(f"{part}: {port}: in use{by}", hint=hint)


def _errno_of(error: BaseException) -> int | None:
    """Return the error number of an exception of pyserial, or of the exception that caused it; None if unknown."""
    if isinstance(error, OSError) and error.errno is not None:
        return error.errno
    return _errno_of(error.__context__) if error.__context__ is not None else None
