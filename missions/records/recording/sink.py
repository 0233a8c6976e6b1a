"""The end of a record's file: what is written to it is there as a whole, or not at all."""

import os
from io import BytesIO


class Sink(BytesIO):
    """Collects what is written until ``flush``, which brings all of it to the file ``number``, or nothing.

    A disk that is full, a limit or a fault leave the file as it was after the last flush that succeeded; ``trouble`` is
    then what went wrong with the newest flush, and what was collected is gone. Positions are those in the file. It does
    not own the file.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.good = 0
        """Bytes that are in the file."""
        self.trouble: OSError | None = None
        self._number = number

    def tell(self) -> int:
        """Return where in the file the next byte will be."""
        return self.good + super().tell()

    def flush(self) -> None:
        """Bring what was collected to the file; never raises."""
        left = memoryview(self.getvalue())
        size = len(left)
        self.seek(0)
        self.truncate()
        self.trouble = None
        try:
            while left:
                left = left[os.write(self._number, left) :]
        except OSError as error:
            self.trouble = error
            os.ftruncate(self._number, self.good)
            os.lseek(self._number, self.good, os.SEEK_SET)
        else:
            self.good += size

    def sync(self) -> None:
        """Wait until what is in the file is on the disk. Raises OSError."""
        os.fdatasync(self._number)
