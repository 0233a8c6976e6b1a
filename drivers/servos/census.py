"""Who is on the wire: all servos found at several baud rates, in both protocols, and how each of them is."""

from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

from drivers.errors import BadRequest, NoReply
from drivers.servos.bus import At, Bus, Identity
from drivers.servos.codec import CODECS
from drivers.servos.models import Model, model_of
from drivers.servos.units import Protocol
from drivers.servos.wire import LASTING, Fault
from drivers.servos.wire2 import hardware_faults


@dataclass(frozen=True, slots=True)
class Found:
    """One servo, or several that share an ID.

    ``model`` is None for a ``number`` that is not one of ours; the position (radians from the servo's middle), voltage
    (V) and temperature (degrees Celsius) are None where they could not be read. ``garbled`` is True when its replies
    came damaged: another servo may have the same ID. If not even its number was understood, that is None too. ``mute``
    is True for a servo that answers a ping, and no read.
    """

    at: At
    baud: int
    model: Model | None = None
    number: int | None = None
    firmware: int | None = None
    position: float | None = None
    voltage: float | None = None
    temperature: float | None = None
    faults: Fault = field(default=Fault(0))
    garbled: bool = False
    mute: bool = False


def census(
    bus: Bus, bauds: Sequence[int], protocols: Sequence[Protocol] = (1, "STS", 2), ids: Iterable[int] = range(254)
) -> Generator[Found, None, None]:
    """Look for servos on an open bus, and yield them as they are found: by rate, protocol and ID.

    In protocol 2.0 all are called at once before each is asked by itself; one question finds a servo of protocol 1.0 or
    an STS. Nothing is written to them, and the bus has
    its own rate again in the end, whatever happens; who stops half-way closes the generator. Raises NotConnected.
    """
    before, ids = bus.baud, tuple(ids)
    try:
        for baud in bauds:
            bus.baud = baud
            for protocol in protocols:
                if protocol == "STS" and 1 in protocols:
                    continue
                for found in _found(bus, protocol, [number for number in ids if number <= CODECS[protocol].last_id]):
                    if found.number is None or found.at.protocol in protocols:
                        yield found
    finally:
        bus.baud = before


FEW_IDS = 32
"""IDs of which each is pinged too that answers no read: of more, only the lowest ones where a servo was found."""


def _found(bus: Bus, protocol: Protocol, ids: Sequence[int]) -> Iterator[Found]:
    """Look for servos at the present rate."""
    called = {known.at.id: known for known in bus.find(protocol=2, ids=ids)} if protocol == 2 else {}
    silent = []
    for number in ids:
        damaged, doubles = bus.tally(number).corrupt, bus.tally(number).doubles
        identity = called.get(number) or _asked(bus, At(number, protocol))
        if identity is not None:
            found = _described(bus, identity, damaged)
            yield replace(found, garbled=found.garbled or bus.tally(number).doubles > doubles)
        elif bus.tally(number).corrupt > damaged:
            yield Found(At(number, protocol), bus.baud, garbled=True)
        else:
            silent.append(number)
    if protocol != 2:
        every = len(ids) <= FEW_IDS or len(silent) == len(ids)
        yield from _find_mute(bus, [At(number, protocol) for number in silent if every or number < FEW_IDS])


def _find_mute(bus: Bus, silent: Iterable[At]) -> Iterator[Found]:
    """Yield the servos that answer a ping, and no read; and those that were late."""
    for at in silent:
        damaged = bus.tally(at.id).corrupt
        if not bus.answers_ping(at, tries=1):
            continue
        try:
            yield _described(bus, bus.identify(at), damaged)
        except (NoReply, BadRequest):
            mute = bus.tally(at.id).corrupt == damaged
            yield Found(at, bus.baud, garbled=not mute, mute=mute)


def _asked(bus: Bus, at: At) -> Identity | None:
    """Ask one servo who it is, and again if anything was heard; None if it does not say."""
    before = bus.tally(at.id).corrupt, bus.noise()
    with suppress(NoReply, BadRequest):
        return bus.identify(at, tries=1)
    if (bus.tally(at.id).corrupt, bus.noise()) != before:
        with suppress(NoReply, BadRequest):
            return bus.identify(at)
    return None


def _described(bus: Bus, known: Identity, damaged: int) -> Found:
    """Read how a servo is. ``damaged`` is how many of its replies had been before it was looked for."""
    at, model = known.at, model_of(known.number)
    found = Found(at, bus.baud, model, known.number, known.firmware, faults=bus.faults(at.id) & LASTING)
    if model is not None:
        try:
            found = _measured(bus, found, model)
        except (NoReply, BadRequest):  # it was there a moment ago: what cannot be read stays unknown
            if at.protocol == 2 and bus.tally(at.id).corrupt == damaged:  # whose ping tells the model
                found = replace(found, mute=bus.answers_ping(at, tries=1))
    return replace(found, garbled=bus.tally(at.id).corrupt > damaged)


def _measured(bus: Bus, found: Found, model: Model) -> Found:
    """Read what a servo of a known model feels. Raises NoReply, NotConnected, BadRequest."""
    place, volts, heat = (model.table[f"present_{what}"] for what in ("position", "voltage", "temperature"))
    start = place.address
    data = bus.read_block(found.at, start, heat.end - start)
    told = model.table.registers.get("hardware_error")
    return replace(
        found,
        position=model.angle(place.decode(data, start)),
        voltage=volts.decode(data, start) / 10,
        temperature=float(heat.decode(data, start)),
        faults=found.faults if told is None else hardware_faults(bus.read(found.at, told)),
    )
