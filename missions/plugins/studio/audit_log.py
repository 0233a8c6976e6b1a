"""Audit log of the studio: one JSON line for each command that changes something, readable by its owner alone."""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from threading import Lock

from drivers.clock import Clock, SystemClock, time_of_day
from missions.control.commands import COMMAND_KEY

MAX_LOG_BYTES = 4_000_000
"""Maximum size of the audit log in bytes; then a new file begins, and the previous file is kept."""

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
"""Commands that are not logged: they change nothing, or come 20 times a second.

The commands `take` and `give`, which are logged, show who drives.
"""

BURST_LINES, REFILL_RATE = 20.0, 0.1
"""Lines of viewers per command: burst, and rate per second, so that a flood cannot displace older lines."""


class AuditLog:
    """Writes the audit log at ``path``, mode 0600. If the disk is full, lines are lost, and the studio goes on.

    Commands of viewers are written at a limited rate; ``unwritten`` in a line counts the lines dropped before it.
    """

    def __init__(self, path: Path, *, clock: Clock | None = None) -> None:
        self.path = path
        self._lock = Lock()
        self._clock = clock or SystemClock()
        self._allowed: dict[object, tuple[float, float]] = {}  # by command word: number of lines, and their time
        self._dropped: dict[object, int] = {}

    def write(self, client: str, role: str, command: Mapping[str, object], outcome: str) -> None:
        """Write a line: client, role, command and ``outcome``, which is ``ok`` or the name of the error."""
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
        """Return the number of lines about the command ``word`` that were dropped before this line.

        Return None if this line is to be dropped too.
        """
        now = self._clock.now()
        had, since = self._allowed.get(word, (BURST_LINES, now))
        had = min(BURST_LINES, had + (now - since) * REFILL_RATE)
        self._allowed[word] = (had - 1.0 if had >= 1.0 else had), now
        if had < 1.0:
            self._dropped[word] = self._dropped.get(word, 0) + 1
            return None
        return self._dropped.pop(word, 0)
