"""Finds lines of text in a stream of bytes. No I/O."""

MAX_LINE_LENGTH = 512
"""Maximum bytes of a line; longer ones are dropped."""


class LineFinder:
    """Finds lines and strips their ends. ``overlong`` counts lines of more than ``max_length`` bytes."""

    def __init__(self, max_length: int = MAX_LINE_LENGTH) -> None:
        self.overlong = 0
        self._max_length = max_length
        self._partial_line = b""
        self._skipping = False  # the rest of an overlong line

    def feed(self, data: bytes) -> list[bytes]:
        """Add received bytes; return the complete lines that are not empty."""
        *complete, self._partial_line = (self._partial_line + data).split(b"\n")
        lines = []
        for line in complete:
            if self._skipping:
                self._skipping = False
            elif len(line) > self._max_length:
                self.overlong += 1
            elif stripped := line.strip():
                lines.append(stripped)
        if len(self._partial_line) > self._max_length:
            self.overlong += not self._skipping
            self._partial_line, self._skipping = b"", True
        return lines
