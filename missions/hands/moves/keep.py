"""Where a behaviour keeps a movement that it records: a gesture file, never written over."""

from collections.abc import Iterable
from math import radians
from pathlib import Path

from config.faults import InvalidFileError
from config.units import seen
from config.writing import gesture_text, write_new
from drivers.errors import BadRequest
from missions.hands.moves.record import Recording

RESOLUTION = radians(0.3)
"""What a joint does within this angle is not told from its standing still: one step of the coarsest servos."""


class Take(Recording):
    """A recording of ``joints`` that is to become a file at ``path``."""

    def __init__(self, path: Path, joints: Iterable[str]) -> None:
        super().__init__(dict.fromkeys(joints, RESOLUTION))
        self._path = path

    def write(self) -> None:
        """Write the file. Raises BadRequest where it is there already, cannot be written, or nothing has moved."""
        gesture = self.gesture(self._path.stem, f"Recorded by a mission, {self.seconds:.1f} s.")
        try:
            write_new(self._path, gesture_text(gesture, str(self._path)))
        except (OSError, InvalidFileError) as error:
            raise BadRequest(f"{self._path} cannot be written: {error}") from error


class NewMove:
    """A file for a movement that is yet to be recorded; ``name`` stands for NAME.yaml in the current folder.

    Raises LookupError for what cannot be the name of a file.
    """

    def __init__(self, name: str) -> None:
        path = Path(name.strip())
        if not path.name or "\0" in name:
            raise LookupError(f"needs the name of a new file, got {seen(name)}")
        self.path = path if path.suffix in (".yaml", ".yml") else path.with_name(f"{path.name}.yaml")

    def begin(self, joints: Iterable[str]) -> Take:
        """Return an empty recording of ``joints``."""
        return Take(self.path, joints)
