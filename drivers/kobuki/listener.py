"""The ear of the driver: bytes of the base in, states of the base out."""

from collections.abc import Mapping
from dataclasses import replace

from drivers.api import BaseState
from drivers.api.quick import dataclass
from drivers.kobuki.commands import Extra
from drivers.kobuki.feedback import FEEDBACK, Core, DockInfrared, FirmwareVersion, HardwareVersion, Inertia, UniqueId
from drivers.kobuki.odometry import Senses
from drivers.kobuki.wire import FrameFinder, decode
from drivers.transport.delays import Delays


@dataclass(frozen=True, slots=True)
class Identity:
    """What the base has told of itself; None for what it has not, or not since it was last connected."""

    hardware: HardwareVersion | None = None
    firmware: FirmwareVersion | None = None
    unique_id: UniqueId | None = None

    @property
    def missing(self) -> Extra:
        """What is still to be asked for."""
        told = {Extra.HARDWARE: self.hardware, Extra.FIRMWARE: self.firmware, Extra.UNIQUE_ID: self.unique_id}
        return Extra(sum(flag for flag, value in told.items() if value is None))


class Listener:
    """Finds frames, reads their parts and keeps count. For one thread; ``identity`` and ``counters`` for any."""

    def __init__(self) -> None:
        self.identity = Identity()
        self._finder = FrameFinder()
        self._senses = Senses()
        self._unknown = self._malformed = 0
        self._gaps = Delays()
        self._reported_at: float | None = None

    def restart(self) -> None:
        """Begin anew on a port just opened: it may be another base, but the pose goes on from where it was."""
        self.identity = Identity()
        self._finder.clear()
        self._reported_at = None
        self._senses.odometry.anchor()

    def feed(self, data: bytes, now: float) -> list[BaseState]:
        """Take bytes that were measured at ``now`` seconds; return the states they report, oldest first."""
        found = (self._read(payload, now) for payload in self._finder.feed(data))
        states = [state for state in found if state is not None]
        if states:
            if self._reported_at is not None:
                self._gaps.add(now - self._reported_at)
            self._reported_at = now
        return states

    def commanded(self, *, moves: bool) -> None:
        """Take in whether the base is sent anything but to stand."""
        self._senses.odometry.commanded = moves

    def counters(self) -> Mapping[str, int]:
        """Return totals: frames, what was wrong with the others, and how far apart the reports came."""
        return {
            "frames": self._finder.frames,
            "checksum_errors": self._finder.checksum_errors,
            "skipped_bytes": self._finder.skipped_bytes,
            "unknown_parts": self._unknown,
            "malformed_parts": self._malformed,
            **self._gaps.counters("report_gap"),
        }

    def _read(self, payload: bytes, now: float) -> BaseState | None:
        decoded = decode(payload, FEEDBACK)
        self._unknown += decoded.unknown
        self._malformed += decoded.malformed
        core: Core | None = None
        inertia: Inertia | None = None
        dock: DockInfrared | None = None
        for part in decoded.parts:
            match part:
                case Core():
                    core = part
                case Inertia():
                    inertia = part
                case DockInfrared():
                    dock = part
                case HardwareVersion():
                    self.identity = replace(self.identity, hardware=part)
                case FirmwareVersion():
                    self.identity = replace(self.identity, firmware=part)
                case UniqueId():
                    self.identity = replace(self.identity, unique_id=part)
        return self._senses.update(core, inertia, now, dock)
