"""Who has done what, and when: a line of JSON for each command that changes something, kept for the user alone."""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from threading import Lock

from drivers.clock import time_of_day

LARGEST = 4_000_000
"""Bytes of the log; then it begins anew, and the one before is kept."""

UNTOLD = frozenset(
    {"hello", "watch", "seen", "drive", "look", "library", "mission", "world", "records", "moment", "tasks"}
)
"""Commands that change nothing, or come twenty times a second: `take` and `give` say who drove."""


class Audit:
    """Writes lines to ``path``, for its owner alone. A disk that is full costs lines, and nothing else."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = Lock()

    def tell(self, who: str, role: str, what: Mapping[str, object], outcome: str) -> None:
        """Write who has commanded what, and what came of it: ``ok``, or the name of the error."""
        line = {"time": time_of_day().isoformat(timespec="milliseconds"), "who": who, "role": role, "outcome": outcome}
        with self._lock, suppress(OSError):
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if self.path.exists() and self.path.stat().st_size > LARGEST:
                self.path.replace(self.path.with_suffix(".1.log"))
            number = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW, 0o600)
            with open(number, "w", encoding="utf-8") as file:  # noqa: PTH123 - of a descriptor
                file.write(json.dumps(line | dict(what), ensure_ascii=True) + "\n")
