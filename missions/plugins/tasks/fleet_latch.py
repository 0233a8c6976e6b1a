"""The stop of a fleet, stored on disk so that it survives a restart of the robot."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from threading import Lock

from config.file_io import parse_object, read_regular_text, sync_folder

LATCH_FILE = "fleet_stop.json"


class FleetLatch:
    """Stop latch of a robot in a fleet, stored in ``folder``. Thread-safe.

    ``by`` names the client of the latched stop, empty without one; ``number`` counts stops.
    """

    def __init__(self, folder: Path) -> None:
        self._path, self._lock, self._disk = folder / LATCH_FILE, Lock(), Lock()
        self.by, self.number = "", 0

    def load(self) -> None:
        """Read the stored latch. A file that cannot be read counts as a stop, so that a person checks it."""
        try:
            stored = parse_object(read_regular_text(self._path))
            self.by, self.number = str(stored["by"]), int(stored["number"])
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError, OverflowError) as error:
            self.by = f"unknown: {self._path} cannot be read ({type(error).__name__})"

    @property
    def is_latched(self) -> bool:
        """Whether a stop of the fleet is latched for this robot."""
        return bool(self.by)

    def stop(self, by: str) -> tuple[int, Callable[[], str]]:
        """Latch a stop; return its number, and a function that stores it and returns a warning or an empty text."""
        with self._lock:
            self.by, self.number = by or "somebody", self.number + 1
            return self.number, self._save_stop

    def _save_stop(self) -> str:
        try:
            with self._disk:  # slow disk: another stop does not wait for it
                self._write(self.by)
        except OSError as error:
            return f"; a restart will release it: {error.strerror}"
        return ""

    def release(self, number: int) -> bool:
        """Release the stop with this number if it is the last one; return whether it was released.

        If the release cannot be stored, OSError is raised and the stop stays latched.
        """
        with self._lock:
            if number != self.number or not self.by:
                return False
            with self._disk:
                self._write("")
                self.by = ""  # only after it is stored
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
