"""The Chrome DevTools Protocol over two pipes, as Chromium speaks it with ``--remote-debugging-pipe``.

Messages are JSON ended by a NUL byte. The browser reads them at its file descriptor 3 and writes them at 4, so neither
a port nor a library is needed.
"""

import json
import os
import select
from typing import Any

from drivers.clock import SystemClock

REPLY_TIMEOUT = 30.0
"""Seconds that the browser has for an answer; machines are shared."""


class Pipe:
    """The two pipes to a browser: a question and its answer at a time, and what it says unasked in between."""

    def __init__(self, write: int, read: int) -> None:
        self._write, self._read = write, read
        self._clock = SystemClock()
        self._rest = bytearray()
        self._asked = 0
        self.unasked: list[dict[str, Any]] = []

    def ask(self, method: str, session: str | None, **params: object) -> dict[str, Any]:
        """Return the answer to one question; raise RuntimeError if it is an error, TimeoutError if none comes."""
        self._asked += 1
        question = {"id": self._asked, "method": method, "params": params} | ({"sessionId": session} if session else {})
        left = json.dumps(question).encode() + b"\0"
        while left:
            left = left[os.write(self._write, left) :]
        deadline = self._clock.now() + REPLY_TIMEOUT
        while (message := self._next(deadline)).get("id") != self._asked:
            self.unasked.append(message)
        if "error" in message:
            raise RuntimeError(f"{method}: {message['error']}")
        answer: dict[str, Any] = message["result"]
        return answer

    def wait_for(self, method: str, **params: object) -> None:
        """Wait until the browser says ``method`` with these ``params``, unless it did already."""
        deadline = self._clock.now() + REPLY_TIMEOUT
        while not any(said["method"] == method and params.items() <= said["params"].items() for said in self.unasked):
            self.unasked.append(self._next(deadline))

    def _next(self, deadline: float) -> dict[str, Any]:
        seen = 0
        while (end := self._rest.find(0, seen)) < 0:
            seen = len(self._rest)
            if not select.select([self._read], [], [], max(0.0, deadline - self._clock.now()))[0]:
                raise TimeoutError(f"the browser did not answer within {REPLY_TIMEOUT:g} s")
            if not (piece := os.read(self._read, 1 << 16)):
                raise EOFError("the browser has gone")
            self._rest += piece
        message: dict[str, Any] = json.loads(self._rest[:end])
        del self._rest[: end + 1]
        return message

    def close(self) -> None:
        """Close both ends: the browser leaves when it reads the end."""
        os.close(self._write)
        os.close(self._read)
