"""Proof that exactly one servo answers at an ID, before a register is written. Only reads.

No protocol tells two servos with one ID apart, so the proof looks for traces of a second one:

- a second reply after the requested one;
- replies that damage each other on the wire;
- a register that alternates between two values: a setting, the position (faster than any motor turns), the
  temperature, or the servo's own clock.

Two servos with equal tables, whose replies start at the same moment, leave none of these. Before it changes an ID, a
command must therefore let the user confirm that the other servos are unplugged.
"""

from collections.abc import Iterator
from dataclasses import field
from math import inf

from drivers.api.fast_dataclass import dataclass
from drivers.errors import BadRequest, DeviceFault, NoReply
from drivers.servos.bus import ServoAddress, ServoBus, ServoIdentity
from drivers.servos.models import ServoModel, find_model
from drivers.servos.transport import SECOND_REPLY_DELAY

FULL_READS = 10
"""Number of reads of a servo's whole table in a proof that its ID is unique.

If one of two servos, at random, answers each read, the same servo answers all of them in 1 of 512 proofs.
"""

LISTENED_READS = 3
"""Number of reads at the start of a proof after which the bus waits for the reply of a second servo."""

MIN_DUPLICATE_REPLIES = 2
"""Surplus replies that prove a second servo; a single one may be a late reply."""

MIN_DAMAGED_REPLIES, MIN_DAMAGED_SHARE = 3, 0.2
"""Damaged replies, and their share of all reads, from which on the line is too bad for a write."""

DRIVER_FULL_READS, DRIVER_QUICK_READS, DRIVER_MIN_DAMAGED_SHARE = 2, 8, 0.8
"""Reads of the whole table, and of its readings only, by a driver; and the share of damage that it tolerates."""

DOUBTED_QUICK_READS = 30
"""Number of reads of position and temperature in one check of a servo that has shared its ID before.

The check is repeated every second.
"""

MIN_JUMPS = 2
"""Jumps of position or temperature that prove a second servo: from one servo's value to the other's, and back."""

MIN_READ_ADDRESS = 8
"""Lowest address of a control table that is read in a proof.

A repeated read may need a wider block, which begins at an earlier address.
"""

MAX_HAND_SPEED_FACTOR = 3.0
"""Largest speed of a servo turned by hand, in multiples of its motor's speed."""

POSITION_NOISE, TEMPERATURE_NOISE, CLOCK_SLACK = 8, 1, 20.0
"""Steps, degrees and milliseconds by which two readings of one servo at rest may differ."""


def require_unique_id(
    bus: ServoBus, at: ServoAddress, number: int | None = None, *, full_reads: int = FULL_READS
) -> ServoIdentity:
    """Return the identity of the servo at ``at`` once it is certain that it is the only one, and of a known model.

    ``number`` is the required model number. Raises DeviceFault, with the evidence, for a second servo, a line that
    damages replies, another or an unknown model; NoReply, NotConnected, BadRequest.
    """
    proof = _UniqueIdTest(bus, at)
    identity = proof.identify()
    known = find_model(identity.number)
    if known is None:
        raise DeviceFault(f"{bus.name}: servo {at.id}: model number {identity.number} is unknown", hint=SCAN_HINT)
    if known.protocol != at.protocol or number not in (None, identity.number):
        wanted = "" if number is None else f", not {number}"
        raise DeviceFault(
            f"{bus.name}: servo {at.id} is model {identity.number} ({known.name}){wanted}", hint=SCAN_HINT
        )
    if (held := bus.read(at, known.table["id"])) != at.id:
        raise DeviceFault(
            f"{bus.name}: servo {at.id} says that it is model {identity.number}, and its table is not that of an "
            f"{known.name}: its ID reads {held} there",
            hint=SCAN_HINT,
        )
    proof.read_table(known, full_reads)
    if proof.is_doubtful:
        proof.read_table(known, max(full_reads, FULL_READS))
    proof.raise_if_duplicate()
    return identity


def duplicate_id_evidence(
    bus: ServoBus, at: ServoAddress, model: ServoModel, *, quick_reads: int = DRIVER_QUICK_READS
) -> str:
    """Return the evidence that a servo of ``model`` shares its ID with another; empty if it seems unique.

    Reads the whole table ``DRIVER_FULL_READS`` times, and its readings ``quick_reads`` times. Tolerates more damage
    than ``require_unique_id``: for drivers, which write no EEPROM. Raises NotConnected.
    """
    proof = _UniqueIdTest(bus, at)
    proof.read_table(model, DRIVER_FULL_READS, extra_time=0.0)
    proof.read_table(model, quick_reads, start=model.table["present_position"].address, extra_time=0.0)
    if proof.is_doubtful:
        proof.read_table(model, FULL_READS)
    return "; ".join(proof.evidence(DRIVER_MIN_DAMAGED_SHARE))


def duplicate_ping_evidence(bus: ServoBus, at: ServoAddress) -> str:
    """Return the evidence, from pings alone, that servos share an ID; empty otherwise. Raises NotConnected."""
    proof = _UniqueIdTest(bus, at)
    for _ in range(FULL_READS):
        bus.answers_ping(at, tries=1)
        bus.listen_for_duplicate(at.protocol, 3)
    return "; ".join(proof.evidence())


UNPLUG_HINT = (
    "unplug all servos with ID {0} but one, and give it another ID: mission servo set {0} id NEW; then plug in the "
    "next; if it was alone, try another cable"
)
"""Hint against two servos with one ID."""

SCAN_HINT = "mission servo scan  (with the same --robot FILE or --port PORT) lists the servos"


def ping_only_error(at: ServoAddress, options: str = " --port PORT") -> DeviceFault:
    """Return the error for a servo that answers only pings; ``options`` select its bus in a command."""
    return DeviceFault(
        f"servo {at.id} answers a ping, but no read: its status return level is 0",
        hint=f"mission servo set {at.id} status_return_level 2{options}",
    )


@dataclass(slots=True)
class _ReadComparison:
    """Comparison of all replies to reads of one ID, which finds values that cannot come from a single servo."""

    model: ServoModel
    first: tuple[int, bytes] | None = None  # address and bytes
    last: tuple[float, int, int] | None = None  # time (s), position (ticks), temperature (degC)
    position_jumps: int = 0
    temperature_jumps: int = 0
    conflicts: dict[str, tuple[int, int]] = field(default_factory=dict)
    ticks: set[int] = field(default_factory=set)
    earliest: float = -inf
    latest: float = inf

    def add(self, start: int, data: bytes, sent: float, now: float) -> None:
        """Compare a read of the table with earlier reads, to find values that cannot come from a single servo.

        ``data`` are the bytes from address ``start`` on. They were requested at ``sent`` and complete at ``now`` (s).
        """
        self.first = begin, before = self.first or (start, data)
        for register in self.model.table.registers.values():
            if (register.eeprom or register.writable) and register.address >= max(begin, start):
                values = register.decode(before, begin), register.decode(data, start)
                if values[0] != values[1]:
                    self.conflicts[register.name] = values
        self._count_jumps(start, data, now)
        self._narrow_clock_offset(start, data, sent, now)

    def _count_jumps(self, start: int, data: bytes, now: float) -> None:
        """Count changes of position and temperature since the last read that one servo cannot make in this time."""
        table = self.model.table
        place, heat = (table[name].decode(data, start) for name in ("present_position", "present_temperature"))
        if self.last is not None:
            before, stood, warmth = self.last
            turn = self.model.last_tick + 1
            way = abs(place - stood) % turn
            reach = MAX_HAND_SPEED_FACTOR * self.model.free_speed * (now - before) / self.model.tick + POSITION_NOISE
            self.position_jumps += min(way, turn - way) > reach
            self.temperature_jumps += abs(heat - warmth) > TEMPERATURE_NOISE
        self.last = now, place, heat

    def _narrow_clock_offset(self, start: int, data: bytes, sent: float, now: float) -> None:
        """Narrow down the offset of the servo's millisecond clock from the bus clock.

        The servo's clock was read in the table bytes ``data``, between the times ``sent`` and ``now`` (s). It wraps at
        32 768.
        """
        clock = self.model.table.registers.get("realtime_tick")
        if clock is None or clock.address < start:
            return
        tick = clock.decode(data, start)
        self.ticks.add(tick)
        early, late = tick - now * 1000, tick - sent * 1000
        if self.earliest > -inf:
            turns = round(((self.earliest + self.latest) / 2 - (early + late) / 2) / 32_768) * 32_768
            early, late = early + turns, late + turns
        self.earliest, self.latest = max(self.earliest, early), min(self.latest, late)

    def evidence(self) -> Iterator[str]:
        """Yield the registers whose values cannot come from a single servo."""
        for name, (before, after) in self.conflicts.items():
            yield f"{name} reads {before} and {after}"
        if self.position_jumps >= MIN_JUMPS:
            yield f"its position jumps ({self.position_jumps} times)"
        if self.temperature_jumps >= MIN_JUMPS:
            yield f"its temperature jumps ({self.temperature_jumps} times)"
        if len(self.ticks) > 1 and self.earliest > self.latest + CLOCK_SLACK:
            yield "its clock runs back and forth"


class _UniqueIdTest:
    """Test whether a single servo answers at ``at``: it reads the servo and collects traces of a second one."""

    def __init__(self, bus: ServoBus, at: ServoAddress) -> None:
        self._bus = bus
        self._at = at
        tally = bus.statistics(at.id)
        self._before = tally.corrupt, tally.duplicates
        self._read_count = self._missed_count = self._refused_count = 0
        self._noise_count = 0  # replies without a recognisable header
        self._readings: _ReadComparison | None = None

    def identify(self) -> ServoIdentity:
        """Return the identity that the servo reports. Raises as ``require_unique_id``."""
        noise = self._bus.noise_bytes()
        try:
            return self._bus.identify(self._at)
        except NoReply:
            self._noise_count += self._bus.noise_bytes() > noise
            if self._duplicate_count or self._damaged_count:
                self.raise_if_duplicate()
            raise

    def read_table(
        self,
        model: ServoModel,
        count: int,
        *,
        start: int = MIN_READ_ADDRESS + 2,
        extra_time: float = SECOND_REPLY_DELAY,
    ) -> None:
        """Read the servo's table ``count`` times, from several addresses up to ``start``.

        Two replies that collide may by chance seem to be one intact reply; with a read from another address this does
        not repeat. ``extra_time`` (s) is how much later than a single servo a second one may reply.
        """
        bus, at = self._bus, self._at
        self._readings = self._readings or _ReadComparison(model)
        for look in range(count):
            begin = start - look % 3
            size, sent, noise, corrupt = (
                model.table.size - begin,
                bus.now(),
                bus.noise_bytes(),
                bus.statistics(at.id).corrupt,
            )
            self._read_count += 1
            try:
                self._readings.add(begin, bus.read_block(at, begin, size, tries=1), sent, bus.now())
            except BadRequest:
                self._missed_count += 1
                self._refused_count += 1
            except NoReply:
                self._missed_count += 1
                self._noise_count += bus.noise_bytes() > noise and bus.statistics(at.id).corrupt == corrupt
            if look < LISTENED_READS:
                bus.listen_for_duplicate(at.protocol, size, extra_time)

    @property
    def _damaged_count(self) -> int:
        return self._bus.statistics(self._at.id).corrupt - self._before[0] + self._noise_count

    @property
    def _duplicate_count(self) -> int:
        return self._bus.statistics(self._at.id).duplicates - self._before[1]

    @property
    def is_doubtful(self) -> bool:
        """True if a reply was unusual and more reads are needed."""
        readings = self._readings
        odd = readings is not None and (readings.position_jumps or readings.temperature_jumps)
        return bool(self._duplicate_count or self._damaged_count or self._missed_count or odd)

    def evidence(self, damaged_share: float = MIN_DAMAGED_SHARE) -> list[str]:
        """Return the traces of a second servo, as text; a bad cable that damages replies leaves the same traces.

        ``damaged_share`` is the share of damaged replies from which on they count as a trace.
        """
        found = [] if self._readings is None else list(self._readings.evidence())
        if self._refused_count >= MIN_JUMPS and self._refused_count < self._read_count:
            found.append(f"refuses {self._refused_count} of {self._read_count} equal reads")
        if self._duplicate_count >= MIN_DUPLICATE_REPLIES or (self._duplicate_count and not self._read_count):
            found.append(f"{self._duplicate_count} surplus replies")
        if self._damaged_count >= max(MIN_DAMAGED_REPLIES if self._read_count else 1, damaged_share * self._read_count):
            found.append(f"{self._damaged_count} damaged replies")
        return found

    def raise_if_duplicate(self) -> None:
        """Raise DeviceFault for traces of a second servo, NoReply for a servo that hardly answers."""
        bus, at = self._bus, self._at
        if evidence := self.evidence():
            raise DeviceFault(
                f"{bus.name}: two servos with ID {at.id} on {bus.port}, or a bad cable: {'; '.join(evidence)}",
                hint=UNPLUG_HINT.format(at.id),
            )
        if self._missed_count > self._read_count / 3:
            answered = self._read_count - self._missed_count
            raise NoReply(
                f"{bus.name}: servo {at.id} answers {answered} of {self._read_count} reads on "
                f"{bus.port} at {bus.baud} baud: not enough to write to it",
                hint="check its cable and its power",
            )
