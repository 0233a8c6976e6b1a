"""Lines of text in a stream of bytes that is cut anywhere and may hold noise. Pure."""

MAX_LINE_LENGTH = 512
"""Bytes of a line at most; what is longer is none."""


class LineFinder:
    """Finds lines, without what ends them. ``overlong`` counts those that were longer than ``longest`` bytes."""

    def __init__(self, max_length: int = MAX_LINE_LENGTH) -> None:
        self.overlong = 0
        self._max_length = max_length
        self._partial_line = b""
        self._skipping = False  # the rest of a line that was too long already

    def feed(self, data: bytes) -> list[bytes]:
        """Take what has arrived; return the lines that are now complete, and not empty."""
        *whole, self._partial_line = (self._partial_line + data).split(b"\n")
        found = []
        for line in whole:
            if self._skipping:
                self._skipping = False
            elif len(line) > self._max_length:
                self.overlong += 1
            elif stripped := line.strip():
                found.append(stripped)
        if len(self._partial_line) > self._max_length:
            self.overlong += not self._skipping
            self._partial_line, self._skipping = b"", True
        return found
