"""Bus scan: find all servos at several baud rates and protocols, and read their state."""

from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

from drivers.errors import BadRequest, NoReply
from drivers.servos.bus import ServoAddress, ServoBus, ServoIdentity
from drivers.servos.codec import CODECS
from drivers.servos.models import ServoModel, find_model
from drivers.servos.units import Protocol
from drivers.servos.wire import LASTING_FAULTS, ServoFault
from drivers.servos.wire2 import decode_hardware_error


@dataclass(frozen=True, slots=True)
class ScannedServo:
    """A servo found by a scan, or several that share an ID.

    ``model`` is None for an unknown ``number``; ``number`` is None if no intact reply came. Position (radians from the
    servo's middle), voltage (V) and temperature (degrees Celsius) are None if they could not be read.
    ``has_damaged_replies``: another servo may have the same ID. ``answers_ping_only``: the servo answers no reads.
    """

    address: ServoAddress
    baud: int
    model: ServoModel | None = None
    number: int | None = None
    firmware: int | None = None
    position: float | None = None
    voltage: float | None = None
    temperature: float | None = None
    faults: ServoFault = field(default=ServoFault(0))
    has_damaged_replies: bool = False
    answers_ping_only: bool = False


def scan_bus(
    bus: ServoBus, bauds: Sequence[int], protocols: Sequence[Protocol] = (1, "STS", 2), ids: Iterable[int] = range(254)
) -> Generator[ScannedServo, None, None]:
    """Scan an open bus; yield servos as they are found, ordered by baud rate, protocol and ID.

    Protocol 2.0 is found by a broadcast ping first; one request finds a servo of protocol 1.0 or an STS. Nothing is
    written to the servos. The baud rate of the bus is restored at the end, also if the generator is closed early.
    Raises NotConnected.
    """
    before, ids = bus.baud, tuple(ids)
    try:
        for baud in bauds:
            bus.baud = baud
            for protocol in protocols:
                if protocol == "STS" and 1 in protocols:
                    continue
                for found in _scan_ids(bus, protocol, [number for number in ids if number <= CODECS[protocol].last_id]):
                    if found.number is None or found.address.protocol in protocols:
                        yield found
    finally:
        bus.baud = before


MAX_PING_IDS = 32
"""Number of IDs up to which a scan pings every ID that did not answer a read.

A scan of more IDs that has found a servo pings only the IDs below this number.
"""


def _scan_ids(bus: ServoBus, protocol: Protocol, ids: Sequence[int]) -> Iterator[ScannedServo]:
    """Scan ``ids`` at the current baud rate."""
    called = {known.address.id: known for known in bus.find_servos(protocol=2, ids=ids)} if protocol == 2 else {}
    silent = []
    for number in ids:
        damaged, doubles = bus.statistics(number).corrupt, bus.statistics(number).duplicates
        identity = called.get(number) or _identify(bus, ServoAddress(number, protocol))
        if identity is not None:
            found = _describe(bus, identity, damaged)
            yield replace(
                found, has_damaged_replies=found.has_damaged_replies or bus.statistics(number).duplicates > doubles
            )
        elif bus.statistics(number).corrupt > damaged:
            yield ScannedServo(ServoAddress(number, protocol), bus.baud, has_damaged_replies=True)
        else:
            silent.append(number)
    if protocol != 2:
        every = len(ids) <= MAX_PING_IDS or len(silent) == len(ids)
        yield from _find_ping_only(
            bus, [ServoAddress(number, protocol) for number in silent if every or number < MAX_PING_IDS]
        )


def _find_ping_only(bus: ServoBus, silent: Iterable[ServoAddress]) -> Iterator[ScannedServo]:
    """Yield the servos at the addresses ``silent`` that answer a ping but no read, or that answer a second read."""
    for at in silent:
        damaged = bus.statistics(at.id).corrupt
        if not bus.answers_ping(at, tries=1):
            continue
        try:
            yield _describe(bus, bus.identify(at), damaged)
        except (NoReply, BadRequest):
            mute = bus.statistics(at.id).corrupt == damaged
            yield ScannedServo(at, bus.baud, has_damaged_replies=not mute, answers_ping_only=mute)


def _identify(bus: ServoBus, at: ServoAddress) -> ServoIdentity | None:
    """Return the identity of one servo, or None. A failed request is repeated only if it received any bytes."""
    before = bus.statistics(at.id).corrupt, bus.noise_bytes()
    with suppress(NoReply, BadRequest):
        return bus.identify(at, tries=1)
    if (bus.statistics(at.id).corrupt, bus.noise_bytes()) != before:
        with suppress(NoReply, BadRequest):
            return bus.identify(at)
    return None


def _describe(bus: ServoBus, identity: ServoIdentity, damaged: int) -> ScannedServo:
    """Return the state of a servo. ``damaged`` is its count of damaged replies before the scan."""
    at, model = identity.address, find_model(identity.number)
    found = ScannedServo(
        at, bus.baud, model, identity.number, identity.firmware, faults=bus.faults(at.id) & LASTING_FAULTS
    )
    if model is not None:
        try:
            found = _measure(bus, found, model)
        except (NoReply, BadRequest):  # it answered before: unreadable values stay unknown
            if at.protocol == 2 and bus.statistics(at.id).corrupt == damaged:  # its ping contains the model
                found = replace(found, answers_ping_only=bus.answers_ping(at, tries=1))
    return replace(found, has_damaged_replies=bus.statistics(at.id).corrupt > damaged)


def _measure(bus: ServoBus, found: ScannedServo, model: ServoModel) -> ScannedServo:
    """Read position, voltage, temperature and faults of a known model. Raises NoReply, NotConnected, BadRequest."""
    place, volts, heat = (model.table[f"present_{what}"] for what in ("position", "voltage", "temperature"))
    start = place.address
    data = bus.read_block(found.address, start, heat.end - start)
    told = model.table.registers.get("hardware_error")
    return replace(
        found,
        position=model.angle(place.decode(data, start)),
        voltage=volts.decode(data, start) / 10,
        temperature=float(heat.decode(data, start)),
        faults=found.faults if told is None else decode_hardware_error(bus.read(found.address, told)),
    )
