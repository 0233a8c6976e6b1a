"""Servos are recognised by a ping and what their tables say: nothing is written, nobody moves.

In protocol 2.0 one ping calls all; in protocol 1.0 they are called one by one, of which the first thirty IDs are tried
here. `mission servo scan` tries all. Feetech's STS have the frames of protocol 1.0, and another table, which tells the
makes apart.
"""

from collections.abc import Generator, Mapping, Sequence
from itertools import chain
from struct import unpack_from

from drivers.api.probing import Answer, Ask, Unit
from drivers.servos.codec import CODECS, Codec, Reply
from drivers.servos.models import model_of
from drivers.servos.register import Block
from drivers.servos.units import Protocol
from drivers.servos.wire import BROADCAST, HEADER, LASTING

DELIVERED = (1_000_000, 57_600)
"""The rates at which servos are delivered."""

OTHERS = (115_200, 500_000, 2_000_000, 3_000_000, 4_000_000, 250_000, 200_000, 400_000, 19_200, 9600)
"""The rates that are asked where nobody answers at those."""

IDS = range(31)

REPLY = 0.003
"""Seconds that a servo has to answer, beyond what its bytes take: return delay and a little."""

PATIENT = 30
"""How many times as long one is waited for that has made itself heard: answers may be late on a busy machine."""

LISTEN = 0.03
"""Seconds in which a device that talks by itself is heard, as a Kobuki is."""

IDENTITY: Mapping[Protocol, Block] = {1: Block(0, 6), 2: Block(0, 8), "STS": Block(0, 6)}
"""Model, firmware, ID... of a servo."""

MODEL_AND_ID: Mapping[Protocol, tuple[int, int]] = {1: (0, 3), 2: (0, 7), "STS": (3, 5)}
"""Where its model and its ID are in there."""

TWO = "damaged replies: there may be two with this ID"
MUTE = "answers a ping, and no read: its status return level is 0"

Servos = Generator[Ask, bytes, list[Unit]]


def probe() -> Generator[Ask, bytes, Answer | None]:
    """Ask for Dynamixel servos of both protocols."""
    return (yield from servos((2, 1), DELIVERED, OTHERS))


def servos(
    protocols: Sequence[Protocol], delivered: Sequence[int], others: Sequence[int]
) -> Generator[Ask, bytes, Answer | None]:
    """Ask for servos at the rates at which they are ``delivered``; at the ``others`` where nobody answers there."""
    for rates in (delivered, others):
        found: dict[int, list[Unit]] = {}
        for baud in rates:
            if (yield Ask(baud, wait=LISTEN, enough=bool)):
                continue  # somebody talks here without being asked, which no servo does
            units = list[Unit]()
            for protocol in protocols:
                units += yield from (_called(baud) if protocol == 2 else _pinged(baud, protocol, IDS))
            if units:
                found[baud] = units
        if found:
            return _told(found)
    return None


def _told(found: dict[int, list[Unit]]) -> Answer:
    """Return what was found; the rate that most servos have is that of the wire."""
    baud = max(found, key=lambda rate: len(found[rate]))
    units = tuple(unit for rate in found for unit in found[rate])
    words = [f"{', '.join(f'{unit.id} {unit.model}' for unit in found[rate])} at {rate} baud" for rate in found]
    doubled = ", ".join(str(unit.id) for unit in units if unit.trouble == TWO)
    trouble, hint = "", ""
    if doubled:
        trouble = f"ID {doubled}: damaged replies; two servos may have it"
        hint = "unplug all but one of them, then: mission servo set 1 id NEW --port PORT"
    elif mute := [unit.id for unit in units if unit.trouble == MUTE]:
        trouble = f"ID {', '.join(map(str, mute))}: {MUTE}"
        hint = f"mission servo set {mute[0]} status_return_level 2 --baud {baud} --port PORT"
    elif len(found) > 1:
        others = next(rate for rate in found if rate != baud)
        number = found[others][0].id
        trouble = f"servos at {len(found)} rates on one wire"
        hint = f"mission servo set {number} baud {baud} --baud {others} --port PORT"
    return Answer(f"servos: {'; '.join(words)}", {"baud": baud}, units, trouble, hint)


def _called(baud: int) -> Servos:
    """Call all servos of protocol 2.0; where replies are damaged, ask one by one."""
    codec = CODECS[2]
    each = (codec.overhead + 3) * 10 / baud + REPLY
    heard = yield Ask(baud, codec.frame(BROADCAST, codec.ping(BROADCAST).code, b""), 0.06 + 12 * each)
    replies, damaged = _replies(codec, heard)
    there = [reply.id for reply in replies]
    return (yield from _pinged(baud, 2, IDS if damaged else there, PATIENT)) if there or damaged else []


def _pinged(baud: int, protocol: Protocol, ids: Sequence[int], patience: float = 1) -> Servos:
    """Ask servos one by one; with more time for each where answers come only while another is asked.

    Where some answer, the others are asked once more: a bad line loses a request now and then. In protocol 1.0 a servo
    that complains of its voltage answers with the bytes of the ping: an adapter's echo comes for most IDs.
    """
    codec, found, alike = CODECS[protocol], dict[int, Unit](), list[int]()
    for number in chain(ids, (number for number in ids if found and number not in found)):
        question = _question(codec, baud, number, None, patience=patience, keep_echo=True)
        if (heard := (yield question)) == question.send:
            alike.append(number)
        heard = heard.removeprefix(question.send)
        if patience == 1 and any(reply.id != number for reply in _replies(codec, heard)[0]):
            return (yield from _pinged(baud, protocol, ids, PATIENT))
        if heard and (unit := (yield from _asked(codec, baud, number))):
            found[number] = unit
    if 2 * len(set(alike)) < len(ids):
        for number in dict.fromkeys(alike):
            if unit := (yield from _asked(codec, baud, number)):
                found[number] = unit
    return [found[number] for number in sorted(found)]


def _asked(codec: Codec, baud: int, number: int) -> Generator[Ask, bytes, Unit | None]:
    """Ask one that has answered a ping, or has made a noise, who it is; None for one that is none of these."""
    protocol = codec.protocol
    identity = yield from _read(codec, baud, number, IDENTITY[protocol])
    if identity is None:
        heard = yield _question(codec, baud, number, None, patience=PATIENT)
        replies, damaged = _replies(codec, heard)
        there = any(reply.id == number for reply in replies)
        if there and not damaged and protocol != "STS":
            answered = yield _question(codec, baud, number, IDENTITY[protocol], patience=PATIENT)
            if not answered and not (yield from _answers_twice(codec, baud, number)):
                return Unit(number, _pinged_model(replies, protocol), MUTE)
        return Unit(number, "?", TWO) if there or (damaged and HEADER in heard) else None
    where, own = MODEL_AND_ID[protocol]
    kind = unpack_from("<H", identity.data, where)[0]
    model = model_of(kind)
    if model is not None and model.protocol == protocol:
        own = model.table["id"].address  # an XL-320 has it elsewhere
    either = protocol != 2 and identity.data[5 if protocol == 1 else 3] == number  # by the table of the other make, too
    if protocol == 2 and model is None:  # its table may have the ID elsewhere, as that of an XL-320
        return Unit(number, f"number {kind}", TWO if (yield from _answers_twice(codec, baud, number)) else "")
    if identity.data[own] != number or (either and (model is None or model.protocol != protocol)):
        return None  # another make, which has its own table
    # What changes all the time: two servos with one ID cannot say the same of it.
    state = None if model is None else (yield from _read(codec, baud, number, model.table.fast))
    name = f"number {kind}" if model is None else model.name
    two = (model and state is None) or (yield from _answers_twice(codec, baud, number))
    return Unit(number, name, TWO if two else (identity.faults & LASTING).words)


def _pinged_model(replies: Sequence[Reply], protocol: Protocol) -> str:
    """Return the model that answers to pings say, which in protocol 1.0 say nothing."""
    model = model_of(unpack_from("<H", replies[0].data)[0]) if protocol == 2 and len(replies[0].data) > 1 else None
    return model.name if model is not None else "?"


def _answers_twice(codec: Codec, baud: int, number: int) -> Generator[Ask, bytes, bool]:
    """Say whether a ping is answered more than once."""
    request = codec.ping(number)
    frame = codec.frame(request.id, request.code, request.parameters)
    wait = (len(frame) + 2 * (codec.overhead + 3)) * 10 / baud + REPLY
    heard = yield Ask(baud, frame, wait, lambda _: False)
    return sum(reply.id == number for reply in _replies(codec, heard)[0]) > 1


def _read(codec: Codec, baud: int, number: int, block: Block) -> Generator[Ask, bytes, Reply | None]:
    """Read a block of a table, again with more time where no sound reply comes."""
    for patience in (1, PATIENT, PATIENT):
        heard = yield _question(codec, baud, number, block, patience=patience)
        for reply in _replies(codec, heard)[0]:
            if reply.id == number and len(reply.data) == block.size:
                return reply
    return None


def _question(
    codec: Codec, baud: int, number: int, block: Block | None, *, patience: float = 1, keep_echo: bool = False
) -> Ask:
    request = codec.ping(number) if block is None else codec.read(number, block)
    size = codec.overhead + (3 if block is None else block.size)
    frame = codec.frame(request.id, request.code, request.parameters)

    def answered(heard: bytes) -> bool:
        replies = (reply for reply in _replies(codec, heard)[0] if reply.id == number)
        return any(block is None or len(reply.data) == block.size for reply in replies)

    return Ask(baud, frame, (len(frame) + size) * 10 / baud + REPLY * patience, answered, keep_echo=keep_echo)


def _replies(codec: Codec, heard: bytes) -> tuple[list[Reply], bool]:
    """Return the replies in what was heard, and whether some of it was damaged."""
    parser = codec.parser()
    replies = [codec.reply(packet) for packet in parser.feed(heard) if packet.intact]
    parser.reset()
    return [reply for reply in replies if reply is not None], bool(parser.skipped or parser.broken)
