"""Probe for servos: a ping, then the identity in the control table. Nothing is written, nothing moves.

Protocol 2.0 is probed by a broadcast ping; protocol 1.0 ID by ID, of which only the first 31 are tried here. `mission
servo scan` tries all. Feetech's STS use the frames of protocol 1.0; their table tells the makes apart.
"""

from collections.abc import Generator, Mapping, Sequence
from itertools import chain
from struct import unpack_from

from drivers.api.probe import BusDevice, ProbeRequest, ProbeResult
from drivers.servos.codec import CODECS, Codec, ServoReply
from drivers.servos.models import find_model
from drivers.servos.register import RegisterBlock
from drivers.servos.units import Protocol
from drivers.servos.wire import BROADCAST, HEADER, LASTING_FAULTS

FACTORY_BAUD_RATES = (1_000_000, 57_600)
"""Factory baud rates of servos."""

OTHER_BAUD_RATES = (115_200, 500_000, 2_000_000, 3_000_000, 4_000_000, 250_000, 200_000, 400_000, 19_200, 9600)
"""Baud rates that are tried if no servo answers at the factory rates."""

PROBED_IDS = range(31)

REPLY_TIMEOUT = 0.003
"""Seconds that a servo has to answer, beyond the time of its bytes: return delay and a margin."""

SLOW_REPLY_FACTOR = 30
"""Factor of the reply timeout for a servo that has sent any bytes: its reply may be late on a busy machine."""

LISTEN_TIME = 0.03
"""Seconds to listen for a device that sends unrequested, such as a Kobuki."""

IDENTITY_BLOCKS: Mapping[Protocol, RegisterBlock] = {
    1: RegisterBlock(0, 6),
    2: RegisterBlock(0, 8),
    "STS": RegisterBlock(0, 6),
}
"""Blocks with model, firmware and ID of a servo."""

MODEL_AND_ID_OFFSETS: Mapping[Protocol, tuple[int, int]] = {1: (0, 3), 2: (0, 7), "STS": (3, 5)}
"""Offsets of model number and ID in the ``IDENTITY_BLOCKS``."""

DUPLICATE_ID = "damaged replies: there may be two with this ID"
PING_ONLY = "answers a ping, but no read: its status return level is 0"

UnitProbe = Generator[ProbeRequest, bytes, list[BusDevice]]


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Probe for Dynamixel servos of both protocols."""
    return (yield from probe_servos((2, 1), FACTORY_BAUD_RATES, OTHER_BAUD_RATES))


def probe_servos(
    protocols: Sequence[Protocol], factory_rates: Sequence[int], other_rates: Sequence[int]
) -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Probe for servos at ``factory_rates``; at ``other_rates`` if none answers there."""
    for rates in (factory_rates, other_rates):
        found: dict[int, list[BusDevice]] = {}
        for baud in rates:
            if (yield ProbeRequest(baud, timeout=LISTEN_TIME, is_complete=bool)):
                continue  # data without a request: not a servo
            units = list[BusDevice]()
            for protocol in protocols:
                units += yield from (_ping_all(baud) if protocol == 2 else _ping_each(baud, protocol, PROBED_IDS))
            if units:
                found[baud] = units
        if found:
            return _make_answer(found)
    return None


def _make_answer(found: dict[int, list[BusDevice]]) -> ProbeResult:
    """Return the result of the probe: the servos ``found`` by baud rate, and the rate at which most of them answer."""
    baud = max(found, key=lambda rate: len(found[rate]))
    units = tuple(unit for rate in found for unit in found[rate])
    words = [f"{', '.join(f'{unit.id} {unit.model}' for unit in found[rate])} at {rate} baud" for rate in found]
    doubled = ", ".join(str(unit.id) for unit in units if unit.trouble == DUPLICATE_ID)
    trouble, hint = "", ""
    if doubled:
        trouble = f"ID {doubled}: damaged replies; two servos may have it"
        hint = "unplug all but one of them, then: mission servo set 1 id NEW --port PORT"
    elif mute := [unit.id for unit in units if unit.trouble == PING_ONLY]:
        trouble = f"ID {', '.join(map(str, mute))}: {PING_ONLY}"
        hint = f"mission servo set {mute[0]} status_return_level 2 --baud {baud} --port PORT"
    elif len(found) > 1:
        others = next(rate for rate in found if rate != baud)
        number = found[others][0].id
        trouble = f"servos at {len(found)} rates on one wire"
        hint = f"mission servo set {number} baud {baud} --baud {others} --port PORT"
    return ProbeResult(f"servos: {'; '.join(words)}", {"baud": baud}, units, trouble, hint)


def _ping_all(baud: int) -> UnitProbe:
    """Ping all servos of protocol 2.0; if replies are damaged, ping them one by one."""
    codec = CODECS[2]
    each = (codec.overhead + 3) * 10 / baud + REPLY_TIMEOUT
    heard = yield ProbeRequest(baud, codec.frame(BROADCAST, codec.ping(BROADCAST).code, b""), 0.06 + 12 * each)
    replies, damaged = _replies(codec, heard)
    there = [reply.id for reply in replies]
    return (
        (yield from _ping_each(baud, 2, PROBED_IDS if damaged else there, SLOW_REPLY_FACTOR))
        if there or damaged
        else []
    )


def _ping_each(baud: int, protocol: Protocol, ids: Sequence[int], timeout_factor: float = 1) -> UnitProbe:
    """Ping servos one by one, with a longer timeout if replies arrive while another servo is pinged.

    If some servos answer, the others are pinged once more, because a bad line loses a request now and then. In protocol
    1.0 a servo with a voltage fault answers with the same bytes as the ping. If such bytes come for most IDs, they are
    echoes of the adapter.
    """
    codec, found, alike = CODECS[protocol], dict[int, BusDevice](), list[int]()
    for number in chain(ids, (number for number in ids if found and number not in found)):
        question = _make_request(codec, baud, number, None, timeout_factor=timeout_factor, keep_echo=True)
        if (heard := (yield question)) == question.send:
            alike.append(number)
        heard = heard.removeprefix(question.send)
        if timeout_factor == 1 and any(reply.id != number for reply in _replies(codec, heard)[0]):
            return (yield from _ping_each(baud, protocol, ids, SLOW_REPLY_FACTOR))
        if heard and (unit := (yield from _identify(codec, baud, number))):
            found[number] = unit
    if 2 * len(set(alike)) < len(ids):
        for number in dict.fromkeys(alike):
            if unit := (yield from _identify(codec, baud, number)):
                found[number] = unit
    return [found[number] for number in sorted(found)]


def _identify(codec: Codec, baud: int, number: int) -> Generator[ProbeRequest, bytes, BusDevice | None]:
    """Return the servo with ID ``number``, which replied to a ping; None if it is of another make than ``codec``."""
    protocol = codec.protocol
    identity = yield from _read(codec, baud, number, IDENTITY_BLOCKS[protocol])
    if identity is None:
        heard = yield _make_request(codec, baud, number, None, timeout_factor=SLOW_REPLY_FACTOR)
        replies, damaged = _replies(codec, heard)
        there = any(reply.id == number for reply in replies)
        if there and not damaged and protocol != "STS":
            answered = yield _make_request(
                codec, baud, number, IDENTITY_BLOCKS[protocol], timeout_factor=SLOW_REPLY_FACTOR
            )
            if not answered and not (yield from _answers_twice(codec, baud, number)):
                return BusDevice(number, _model_from_ping(replies, protocol), PING_ONLY)
        return BusDevice(number, "?", DUPLICATE_ID) if there or (damaged and HEADER in heard) else None
    where, own = MODEL_AND_ID_OFFSETS[protocol]
    kind = unpack_from("<H", identity.data, where)[0]
    model = find_model(kind)
    if model is not None and model.protocol == protocol:
        own = model.table["id"].address  # at another address in an XL-320
    either = protocol != 2 and identity.data[5 if protocol == 1 else 3] == number  # by the table of the other make, too
    if protocol == 2 and model is None:  # its table may have the ID elsewhere, as that of an XL-320
        return BusDevice(
            number, f"number {kind}", DUPLICATE_ID if (yield from _answers_twice(codec, baud, number)) else ""
        )
    if identity.data[own] != number or (either and (model is None or model.protocol != protocol)):
        return None  # another make, which has its own table
    # What changes all the time: two servos with one ID cannot say the same of it.
    state = None if model is None else (yield from _read(codec, baud, number, model.table.fast_block))
    name = f"number {kind}" if model is None else model.name
    two = (model and state is None) or (yield from _answers_twice(codec, baud, number))
    return BusDevice(number, name, DUPLICATE_ID if two else (identity.faults & LASTING_FAULTS).description)


def _model_from_ping(replies: Sequence[ServoReply], protocol: Protocol) -> str:
    """Return the name of the model in a ping reply; "?" if it is unknown.

    It is always unknown in protocol 1.0, in which a ping reply has no data.
    """
    model = find_model(unpack_from("<H", replies[0].data)[0]) if protocol == 2 and len(replies[0].data) > 1 else None
    return model.name if model is not None else "?"


def _answers_twice(codec: Codec, baud: int, number: int) -> Generator[ProbeRequest, bytes, bool]:
    """True if a ping of ID ``number`` is answered more than once, so that two servos have the ID."""
    request = codec.ping(number)
    frame = codec.frame(request.id, request.code, request.parameters)
    wait = (len(frame) + 2 * (codec.overhead + 3)) * 10 / baud + REPLY_TIMEOUT
    heard = yield ProbeRequest(baud, frame, wait, lambda _: False)
    return sum(reply.id == number for reply in _replies(codec, heard)[0]) > 1


def _read(
    codec: Codec, baud: int, number: int, block: RegisterBlock
) -> Generator[ProbeRequest, bytes, ServoReply | None]:
    """Read a block of a table, again with a longer timeout if no intact reply comes."""
    for patience in (1, SLOW_REPLY_FACTOR, SLOW_REPLY_FACTOR):
        heard = yield _make_request(codec, baud, number, block, timeout_factor=patience)
        for reply in _replies(codec, heard)[0]:
            if reply.id == number and len(reply.data) == block.size:
                return reply
    return None


def _make_request(
    codec: Codec,
    baud: int,
    number: int,
    block: RegisterBlock | None,
    *,
    timeout_factor: float = 1,
    keep_echo: bool = False,
) -> ProbeRequest:
    request = codec.ping(number) if block is None else codec.read(number, block)
    size = codec.overhead + (3 if block is None else block.size)
    frame = codec.frame(request.id, request.code, request.parameters)

    def answered(heard: bytes) -> bool:
        replies = (reply for reply in _replies(codec, heard)[0] if reply.id == number)
        return any(block is None or len(reply.data) == block.size for reply in replies)

    return ProbeRequest(
        baud, frame, (len(frame) + size) * 10 / baud + REPLY_TIMEOUT * timeout_factor, answered, keep_echo=keep_echo
    )


def _replies(codec: Codec, heard: bytes) -> tuple[list[ServoReply], bool]:
    """Return the replies in the received bytes ``heard``, and whether some of the bytes were damaged."""
    parser = codec.parser()
    replies = [codec.reply(packet) for packet in parser.feed(heard) if packet.intact]
    parser.reset()
    return [reply for reply in replies if reply is not None], bool(parser.skipped_bytes or parser.damaged_packets)
