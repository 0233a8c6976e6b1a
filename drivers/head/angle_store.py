"""Where the servos of a board were left, kept from one program to the next, for as long as that can be true."""

import errno
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

MAX_FILE_SIZE = 10_000
"""Bytes of such a file at most."""

RECORD_SIZE = 256
"""Bytes that are written at once: a record is shorter, and filled up with spaces."""


class ServoAngleStore:
    """What is kept of the board at ``port``, in a file of its own in ``folder``.

    It holds only while the port is the very one that the kernel made then: a board with native USB that starts anew
    gets another, and so does whatever is plugged in again.
    """

    def __init__(self, folder: Path, port: str) -> None:
        self._port = port
        self._path = folder / f"servos{port.replace('/', '-')}.json"
        self._file = -1

    def save(self, degrees: Mapping[int, int]) -> None:
        """Keep where the servos were sent last, by their numbers; where that cannot be, nothing is kept.

        One write of a fixed size replaces the one before, so that a program that is killed leaves either of them.
        """
        try:
            text = json.dumps({"of": self._port_identity(), "degrees": dict(degrees)}).ljust(RECORD_SIZE).encode()
            if self._file < 0:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._path.unlink(missing_ok=True)  # whatever stands there
                self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
            if os.pwrite(self._file, text, 0) < len(text):
                raise OSError(errno.ENOSPC, "not written whole")
        except OSError:
            self.delete()

    def delete(self) -> None:
        """Keep nothing: a wrong place would make the head leap."""
        self.close()
        with suppress(OSError):
            self._path.unlink(missing_ok=True)

    def close(self) -> None:
        """Let go of the file, which stays."""
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)

    def pop(self) -> dict[int, int]:
        """Return what was kept, if it still holds, and keep it no longer: from now on the servos are moved."""
        try:
            if not self._path.is_file():  # a pipe would be waited for
                return {}
            with self._path.open("rb") as file:
                found = json.loads(file.read(MAX_FILE_SIZE))
            self.delete()
            if found["of"] != self._port_identity():
                return {}
            return {int(index): min(max(int(angle), 0), 180) for index, angle in found["degrees"].items()}
        except (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError):
            return {}

    def _port_identity(self) -> list[int]:
        """Return what tells this port from all others: its inode, and when that was made (ns). Raises OSError."""
        status = Path(self._port).stat()
        return [status.st_dev, status.st_ino, status.st_ctime_ns]
