"""Who has done what, and when: a line of JSON for each command that changes something, kept for the user alone."""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from threading import Lock

from drivers.clock import Clock, SystemClock, time_of_day
from missions.control.commands import COMMAND_KEY

MAX_LOG_BYTES = 4_000_000
"""Bytes of the log; then it begins anew, and the one before is kept."""

UNLOGGED_COMMANDS = frozenset(
    {
        "hello",
        "watch",
        "seen",
        "show_person",
        "drive",
        "look",
        "library",
        "mission",
        "world",
        "records",
        "record",
        "moment",
        "tasks",
        "fleet",
        "tuning",
        "faults",
        "failsafe",
    }
)
"""Commands that change nothing, or come twenty times a second: `take` and `give` say who drove."""

BURST_LINES, REFILL_RATE = 20.0, 0.1
"""Lines of viewers for each word at once, and a second after that: who floods the log pushes nothing out of it."""


class AuditLog:
    """Writes lines to ``path``, for its owner alone. A disk that is full costs lines, and nothing else.

    What viewers do is written at a bounded rate; ``unwritten`` in a line says how many before it were left out.
    """

    def __init__(self, path: Path, *, clock: Clock | None = None) -> None:
        self.path = path
        self._lock = Lock()
        self._clock = clock or SystemClock()
        self._allowed: dict[object, tuple[float, float]] = {}  # by word: how many lines, as of when
        self._dropped: dict[object, int] = {}

    def write(self, client: str, role: str, command: Mapping[str, object], outcome: str) -> None:
        """Write who has commanded what, and what came of it: ``ok``, or the name of the error."""
        line: dict[str, object] = {}
        if role == "viewer":
            with self._lock:
                left_out = self._count_dropped(command.get(COMMAND_KEY))
            if left_out is None:
                return
            line = {"unwritten": left_out} if left_out else {}
        line |= {
            "time": time_of_day().isoformat(timespec="milliseconds"),
            "who": client,
            "role": role,
            "outcome": outcome,
        }
        with self._lock, suppress(OSError):
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if self.path.exists() and self.path.stat().st_size > MAX_LOG_BYTES:
                self.path.replace(self.path.with_suffix(".1.log"))
            number = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
            with open(number, "w", encoding="utf-8") as file:  # noqa: PTH123 - of a descriptor
                file.write(json.dumps(line | dict(command), ensure_ascii=True) + "\n")

    def _count_dropped(self, word: object) -> int | None:
        """Return how many lines of a word were left out before this one; None where this one is to be, too."""
        now = self._clock.now()
        had, since = self._allowed.get(word, (BURST_LINES, now))
        had = min(BURST_LINES, had + (now - since) * REFILL_RATE)
        self._allowed[word] = (had - 1.0 if had >= 1.0 else had), now
        if had < 1.0:
            self._dropped[word] = self._dropped.get(word, 0) + 1
            return None
        return self._dropped.pop(word, 0)
