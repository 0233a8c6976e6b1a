"""What a process says on its two outputs, line by line, without waiting for either."""

import os
import selectors
import subprocess
from collections.abc import Iterator
from typing import IO, Self


class Pipes:
    """While it is entered, reads the two outputs of a process; they must be pipes."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self._begun = {pipe: b"" for pipe in (process.stdout, process.stderr) if pipe is not None}
        self._selector: selectors.BaseSelector

    def __enter__(self) -> Self:
        self._selector = selectors.DefaultSelector()
        for pipe in self._begun:
            os.set_blocking(pipe.fileno(), False)
            self._selector.register(pipe, selectors.EVENT_READ, pipe)
        return self

    def __exit__(self, *_: object) -> None:
        self._selector.close()

    def lines(self, seconds: float) -> Iterator[tuple[IO[bytes], str]]:
        """Yield the lines that have come, and of which pipe; wait for the first of them for so many seconds."""
        for key, _ in self._selector.select(seconds):
            pipe: IO[bytes] = key.data
            data = os.read(pipe.fileno(), 1 << 16)
            if not data:
                self._selector.unregister(pipe)
            *whole, self._begun[pipe] = (self._begun[pipe] + data).split(b"\n")
            yield from ((pipe, line.decode(errors="replace")) for line in whole)

    def rest(self) -> Iterator[tuple[IO[bytes], str]]:
        """Yield all lines that there are, the last of a pipe even where it is not ended."""
        while self._selector.select(0.0):
            yield from self.lines(0.0)
        yield from ((pipe, rest.decode(errors="replace")) for pipe, rest in self._begun.items() if rest)
