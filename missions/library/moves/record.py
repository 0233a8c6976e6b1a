"""Recording of a movement of joints without torque, moved by hand, as keyframes."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf, radians
from pathlib import Path

import numpy as np
import numpy.typing as npt

from config.diagnostics import InvalidFileError
from config.gesture import GestureConfig
from config.units import quoted_value
from config.yaml_writer import gesture_text, write_new
from drivers.api import JointState, Reading
from drivers.errors import BadRequest, NoReply

MAX_READING_GAP = 0.25
"""Maximum seconds between two readings of all joints; after a longer gap the motion is unknown."""

Positions = npt.NDArray[np.float64]
"""Positions in radians, shape (readings, joints), float64."""


@dataclass(frozen=True, slots=True)
class JointSnapshot:
    """Positions of all joints (rad) at one time (s, on the driver's clock)."""

    time: float
    positions: Mapping[str, float]


class JointRecording:
    """Recording of a movement that a person makes with the joints by hand.

    ``resolutions`` are the measuring resolutions (rad) of the joints to record, by name; smaller changes count as no
    motion.
    """

    def __init__(self, resolutions: Mapping[str, float]) -> None:
        self._resolutions = dict(resolutions)
        self._last_reading_at: float | None = None  # time of the newest reading of all joints, or of the first attempt
        self.snapshots: list[JointSnapshot] = []

    @property
    def seconds(self) -> float:
        """Duration of the recording so far in seconds."""
        return self.snapshots[-1].time - self.snapshots[0].time if self.snapshots else 0.0

    def add(self, states: Mapping[str, Reading[JointState]], now: float) -> None:
        """Add the newest readings of all joints at the time ``now`` (s), unless one joint has no new reading.

        Raises NoReply if ``MAX_READING_GAP`` seconds have passed without new readings, since a recording with a gap is
        useless.
        """
        snapshot = self._snapshot(states)
        if snapshot is not None:
            self.snapshots.append(snapshot)
        if snapshot is not None or self._last_reading_at is None:
            self._last_reading_at = now
        elif now - self._last_reading_at > MAX_READING_GAP:
            silent = [name for name in self._resolutions if not states[name].good]
            raise NoReply(
                f"{', '.join(silent) or 'the joints'}: no reading for {now - self._last_reading_at:.2f} s, "
                f"{self.seconds:.1f} s after the recording began",
                hint="check the cable and the power supply, then record it again",
            )

    def _snapshot(self, states: Mapping[str, Reading[JointState]]) -> JointSnapshot | None:
        """Return the positions of all joints; None if one has no new reading."""
        readings = {name: states[name] for name in self._resolutions}
        positions = {name: each.value.position for name, each in readings.items() if each.good and each.value}
        last = self.snapshots[-1].time if self.snapshots else -inf
        stamps = [each.stamp for each in readings.values()]
        if len(positions) < len(readings) or min(stamps) <= last:
            return None
        return JointSnapshot(max(stamps), positions)

    def gesture(self, name: str, summary: str = "") -> GestureConfig:
        """Return the recording as a gesture, without the time before and after the movement.

        Readings that interpolation reproduces are left out. Raises BadRequest if no joint moved.
        """
        steps = np.array(list(self._resolutions.values()))
        table = np.array([[snapshot.positions[joint] for joint in self._resolutions] for snapshot in self.snapshots])
        moved = _moving_range(table, steps)
        if moved is None:
            raise BadRequest(
                f"{name}: no joint moved during the recording",
                hint="record again, and move the joints by hand before you press Enter",
            )
        snapshots, table = self.snapshots[moved], table[moved]
        times = np.array([snapshot.time - snapshots[0].time for snapshot in snapshots])
        kept_rows = thin_out(times, table, steps)
        return GestureConfig(
            name, summary, tuple((float(times[k]), snapshots[k].positions) for k in kept_rows), "cubic"
        )


def _moving_range(table: Positions, steps: npt.NDArray[np.float64]) -> slice | None:
    """Return the range of readings from the last before the movement to the first after it; None without one.

    ``steps`` are the resolutions of the joints (rad).
    """
    if len(table) < 2:
        return None
    has_begun = (np.abs(table - table[0]) > 1.5 * steps).any(axis=1)  # jitter between two steps is no movement
    under_way = (np.abs(table - table[-1]) > 1.5 * steps).any(axis=1)
    if not has_begun.any() or not under_way.any():
        return None
    return slice(int(np.argmax(has_begun)) - 1, len(table) - int(np.argmax(under_way[::-1])) + 1)


def thin_out(times: npt.NDArray[np.float64], table: Positions, steps: npt.NDArray[np.float64]) -> list[int]:
    """Return the indices of the readings to keep: between them, linear interpolation replaces the others.

    No reading differs from the interpolation by more than the resolution of the joint (``steps``, rad). Method of
    Douglas and Peucker (1973), over all joints at once: keep the first and the last reading, and between two kept
    readings the one that is farthest from their line.
    """
    kept_rows = {0, len(times) - 1}
    spans = [(0, len(times) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        share = ((times[first + 1 : last] - times[first]) / (times[last] - times[first]))[:, None]
        line = table[first] + share * (table[last] - table[first])
        misses = (np.abs(table[first + 1 : last] - line) / steps).max(axis=1)
        worst = int(np.argmax(misses))
        if misses[worst] > 1.0:
            middle = first + 1 + worst
            kept_rows.add(middle)
            spans += [(first, middle), (middle, last)]
    return sorted(kept_rows)


# Where the leaf ``record`` stores movements: gesture files, never overwritten.

DEFAULT_RESOLUTION = radians(0.3)
"""Resolution in radians of movements that missions record: one step of the coarsest servos."""


class FileRecording(JointRecording):
    """A recording of ``joints`` that is written to a gesture file at ``path``."""

    def __init__(self, path: Path, joints: Iterable[str]) -> None:
        super().__init__(dict.fromkeys(joints, DEFAULT_RESOLUTION))
        self._path = path

    def write(self) -> None:
        """Write the recording to its file.

        Raises BadRequest if no joint moved, or if the file exists or cannot be written.
        """
        gesture = self.gesture(self._path.stem, f"Recorded by a mission, {self.seconds:.1f} s.")
        try:
            write_new(self._path, gesture_text(gesture, str(self._path)))
        except (OSError, InvalidFileError) as error:
            raise BadRequest(f"{self._path} cannot be written: {error}") from error


class NewMoveFile:
    """File for a movement that will be recorded; ``name`` stands for NAME.yaml in the current folder.

    Raises LookupError for an invalid file name.
    """

    def __init__(self, name: str) -> None:
        path = Path(name.strip())
        if not path.name or "\0" in name:
            raise LookupError(f"needs the name of a new file, got {quoted_value(name)}")
        self.path = path if path.suffix in (".yaml", ".yml") else path.with_name(f"{path.name}.yaml")

    def begin(self, joints: Iterable[str]) -> FileRecording:
        """Return an empty recording of ``joints``."""
        return FileRecording(self.path, joints)
