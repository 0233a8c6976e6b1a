"""Store of the servo angles of a board, for the next program, as long as they are valid."""

import errno
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

MAX_FILE_SIZE = 10_000
"""Maximum size of a stored file in bytes."""

RECORD_SIZE = 256
"""Bytes of each write: the record, which is shorter, and spaces up to this size."""


class ServoAngleStore:
    """Servo angles of the board at ``port``, stored in ``folder`` in one file for each port.

    The angles are valid only while the device file is the same: the kernel makes a new one when a board with native USB
    restarts, or a device is plugged in again.
    """

    def __init__(self, folder: Path, port: str) -> None:
        self._port = port
        self._path = folder / f"servos{port.replace('/', '-')}.json"
        self._file = -1

    def save(self, degrees: Mapping[int, int]) -> None:
        """Store the last setpoints of the servos, by number; delete the file if that fails.

        One write of a fixed size replaces the last record. If the program is killed, the file has either the last
        record or the new one, as a whole.
        """
        try:
            text = json.dumps({"of": self._port_identity(), "degrees": dict(degrees)}).ljust(RECORD_SIZE).encode()
            if self._file < 0:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._path.unlink(missing_ok=True)  # it may be no regular file
                self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
            if os.pwrite(self._file, text, 0) < len(text):
                raise OSError(errno.ENOSPC, "not written whole")
        except OSError:
            self.delete()

    def delete(self) -> None:
        """Delete the file: a wrong angle would make the head leap."""
        self.close()
        with suppress(OSError):
            self._path.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file, which stays."""
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)

    def pop(self) -> dict[int, int]:
        """Return the stored angles if they are valid, and delete them, since the servos will be moved now."""
        try:
            if not self._path.is_file():  # opening a pipe would block
                return {}
            with self._path.open("rb") as file:
                record = json.loads(file.read(MAX_FILE_SIZE))
            self.delete()
            if record["of"] != self._port_identity():
                return {}
            return {int(index): min(max(int(angle), 0), 180) for index, angle in record["degrees"].items()}
        except (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError):
            return {}

    def _port_identity(self) -> list[int]:
        """Return the identity of the device file: device, inode, and time of creation (ns). Raises OSError."""
        status = Path(self._port).stat()
        return [status.st_dev, status.st_ino, status.st_ctime_ns]
