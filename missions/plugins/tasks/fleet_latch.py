"""The stop of a fleet, kept on the disk: a robot that was stopped is stopped after it was switched on again."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from threading import Lock

from config.file_io import parse_object, read_regular_text, sync_folder

LATCH_FILE = "fleet_stop.json"


class FleetLatch:
    """Whether a robot was stopped over its fleet, and by whom; kept in ``folder``. From any thread."""

    def __init__(self, folder: Path) -> None:
        self._path, self._lock, self._disk = folder / LATCH_FILE, Lock(), Lock()
        self.by, self.number = "", 0

    def load(self) -> None:
        """Take up what was kept. A file that cannot be read counts as a stop: a person is to look."""
        try:
            told = parse_object(read_regular_text(self._path))
            self.by, self.number = str(told["by"]), int(told["number"])
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError, OverflowError) as error:
            self.by = f"nobody known: {self._path} cannot be read ({type(error).__name__})"

    @property
    def is_latched(self) -> bool:
        """Whether it is stopped."""
        return bool(self.by)

    def stop(self, by: str) -> tuple[int, Callable[[], str]]:
        """Latch; return the number of this stop, and what keeps it and says, in words, where that was not possible."""
        with self._lock:
            self.by, self.number = by or "somebody", self.number + 1
            return self.number, self._save_stop

    def _save_stop(self) -> str:
        try:
            with self._disk:  # which may take its time: who stops again does not wait for it
                self._write(self.by)
        except OSError as error:
            return f"; it is not kept over a restart: {error.strerror}"
        return ""

    def release(self, number: int) -> bool:
        """Release the stop of this number, if it is the last one; say whether it was. Raises OSError: it holds."""
        with self._lock:
            if number != self.number or not self.by:
                return False
            with self._disk:
                self._write("")
                self.by = ""  # not before that is on the disk
            return True

    def _write(self, by: str) -> None:
        new = self._path.with_suffix(".new")
        new.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with new.open("w", encoding="utf-8") as file:
            json.dump({"by": by, "number": self.number}, file)
            file.flush()
            os.fsync(file.fileno())
        new.replace(self._path)
        sync_folder(new.parent)
