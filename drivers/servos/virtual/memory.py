"""The control table of a virtual servo: what it holds, and what may be written to it from outside.

Where the e-Manual is silent a write is carried out whole or not at all.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from drivers.servos.models import MODELS
from drivers.servos.register import Register
from drivers.servos.virtual.settings import MODES, Mode, Settings, settings_of
from drivers.servos.wire import Fault

# Values that the servo itself bounds by others, beyond the bounds of the registers.
_CEILINGS: Mapping[str, str] = MappingProxyType(
    {"goal_pwm": "pwm_limit", "goal_current": "current_limit", "goal_velocity": "velocity_limit"}
)


FINE = Fault(0)
"""No fault, made ready: flags are slow to make."""

_NEED_CURRENT = (0, 5)
"""Operating modes of servos that measure their current."""


@dataclass(frozen=True, slots=True)
class Span:
    """What a stretch of a table holds: ``rows`` share a byte with it, ``known`` ones fill it, ``whole`` ones fit in.

    ``names`` are those of the rows.
    """

    rows: tuple[Register, ...]
    names: frozenset[str]
    known: bool
    whole: bool


class Memory:
    """The registers of one servo of ``model``. Names are those of its table."""

    def __init__(self, model: str) -> None:
        self.model = MODELS[model]
        self.table = bytearray(self.model.table.size)
        self._rows = self.model.table.registers
        self._spans: dict[tuple[int, int], Span] = {}  # what was looked up before
        self._id_at = self._rows["id"].address
        self._volatile = min(register.address for register in self._rows.values() if not register.eeprom)
        self._kept = bytearray(self._volatile)  # what survives a power cut
        self._decoded: tuple[bytes, Settings] | None = None  # the EEPROM, and what it says
        for register in self._rows.values():
            self.set(register, self.model.default(register))

    def get(self, register: str | Register) -> int:
        """Return what the table holds."""
        return self._row(register).decode(self.table)

    def set(self, register: str | Register, value: int) -> None:
        """Change the table from inside: no access rule holds."""
        row = self._row(register)
        self.table[row.address : row.end] = row.encode(value)
        if row.eeprom:
            self._kept[row.address : row.end] = row.encode(value)

    def has(self, name: str) -> bool:
        """Whether this model has a register called ``name``."""
        return name in self._rows

    @property
    def number(self) -> int:
        """Its ID."""
        return self.table[self._id_at]

    @property
    def settings(self) -> Settings:
        """What its EEPROM sets it to; decoded anew when that has changed."""
        eeprom = bytes(self.table[: self._volatile])
        if self._decoded is None or self._decoded[0] != eeprom:
            self._decoded = eeprom, settings_of(self.model, self.table)
        return self._decoded[1]

    def keep(self) -> None:
        """Let the settings as they are survive a power cut, unless an STS was locked before."""
        if self.model.protocol != "STS" or not self.get("lock"):
            self._kept[:] = self.table[: self._volatile]

    def recall(self) -> None:
        """Take the settings back that survive a power cut."""
        self.table[: self._volatile] = self._kept

    def span(self, address: int, size: int) -> Span:
        """Return what ``size`` bytes from ``address`` on hold."""
        found = self._spans.get((address, size))
        if found is None:
            end = address + size
            rows = tuple(row for row in self._rows.values() if row.address < end and address < row.end)
            inside = sum(min(row.end, end) - max(row.address, address) for row in rows)
            found = Span(
                rows,
                frozenset(row.name for row in rows),
                known=inside == size,
                whole=inside == sum(row.size for row in rows),
            )
            self._spans[address, size] = found
        return found

    def clamped(self, address: int, data: bytes) -> bytes:
        """Return ``data`` with the goal in it, if a joint's goal is in it, brought within the limits."""
        goal = self.model.table[self.model.table.goal]
        if self.settings.mode is not Mode.JOINT or goal.address < address or goal.end > address + len(data):
            return data
        lowest, highest = self.settings.limits
        within = min(max(goal.decode(data, address), lowest), highest)
        start = goal.address - address
        return data[:start] + goal.encode(within) + data[start + goal.size :]

    def refused(self, address: int, data: bytes) -> Fault:
        """Return why it would not take ``data`` at ``address``; no bit when it would."""
        old, span = self.model.protocol == 1, self.span(address, len(data))
        if not data or not (old or span.whole):
            return Fault.RANGE if old else Fault.LENGTH
        if not span.known or not all(row.writable and self._open(row) for row in span.rows):
            return Fault.RANGE if old else Fault.ACCESS
        if not span.whole:  # the rest of its registers stays as it is
            first, last = span.rows[0].address, span.rows[-1].end
            data = bytes(self.table[first:address]) + data + bytes(self.table[address + len(data) : last])
            address = first
        for row in span.rows:
            if reason := self._unfit(row, row.decode(data, address)):
                return reason
        return FINE

    def _open(self, row: Register) -> bool:
        """Whether the EEPROM is open, if ``row`` lies there: not while locked, or under torque (protocol 2.0)."""
        return not row.eeprom or not self.get("lock" if self.has("lock") else "torque_enable")

    def _unfit(self, row: Register, value: int) -> Fault:
        """Return why ``row`` would not take ``value``."""
        if not row.lower <= value <= row.upper or (row.name == "operating_mode" and not self._runs(value)):
            return Fault.RANGE
        if row.name.startswith("goal_") and self.has("bus_watchdog") and self.get("bus_watchdog") < 0:
            return Fault.RANGE  # once the watchdog has fired, until 0 is written to it
        if row.name == "lock" and value < self.get(row):
            return Fault.RANGE  # only cutting the power unlocks it
        if row.name == self.model.table.goal and self.settings.mode is Mode.JOINT:
            lowest, highest = self.settings.limits
            if not lowest <= value <= highest:
                return Fault.ANGLE_LIMIT if self.model.protocol == 1 else Fault.LIMIT
        if row.name in _CEILINGS and abs(value) > self.get(_CEILINGS[row.name]):
            return Fault.LIMIT
        return FINE

    def _runs(self, operating_mode: int) -> bool:
        return operating_mode in MODES and (operating_mode not in _NEED_CURRENT or self.has("current_limit"))

    def _row(self, register: str | Register) -> Register:
        return self._rows[register] if isinstance(register, str) else register
