"""One Dynamixel bus: what servos of either protocol can be asked and told, one by one or many at once."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from typing import Literal, NamedTuple

from drivers.api.quick import dataclass
from drivers.errors import BadRequest, NoReply
from drivers.servos.channel import Channel
from drivers.servos.codec import Codec, Keep, Reply, Wanted
from drivers.servos.models import model_of
from drivers.servos.register import Block, Register
from drivers.servos.units import Protocol, called, short
from drivers.servos.wire import BROADCAST, REFUSAL, Fault, Packet

TRIES = 3
"""How often a read is sent before it counts as unanswered."""

_FRONT = 6
"""Bytes at the front of a table by which a servo of protocol 1.0 and an STS say what they are."""

ROLL_CALL = 0.003
"""Seconds that each ID has for its answer to a ping that asks all of them."""


class At(NamedTuple):
    """Whom a transaction is for."""

    id: int
    protocol: Protocol = 1


@dataclass(frozen=True, slots=True)
class Identity:
    """What a servo says that it is: its model number, and the version of its firmware."""

    at: At
    number: int
    firmware: int


@dataclass(slots=True, eq=False)
class _Question:
    """A read and its tries: the block that is wanted, the one that is asked for, which contains it, and since when."""

    block: Block
    asked: Block
    began: float

    def __str__(self) -> str:
        return f"read of {self.block.size} bytes at {self.block.address}"


class Bus(Channel):
    """The servos of one line, asked and told by what it is about. Reads are retried, writes are sent once."""

    # --- one servo ----------------------------------------------------------------------------------------------------

    def ping(self, at: At, *, tries: int = TRIES) -> int:
        """Return the model number of a servo. Raises NoReply if it is not there."""
        return self.identify(at, tries=tries).number

    def identify(self, at: At, *, tries: int = TRIES) -> Identity:
        """Return what a servo is. Raises NoReply if it is not there.

        In protocol 1.0 the answer to a ping says nothing, and is the same as the echo of one: the table is read. It
        tells a Dynamixel from an STS, which hears the same frames: the ``at`` that is returned may have that protocol.
        """
        if at.protocol != 2:
            return _recognised(at, self.read_block(at, 0, _FRONT, tries=tries))
        request = self._codec(at).ping(at.id)
        return _identity(at, self._ask(at, "ping", lambda: self._told(at, request, 3), tries))

    def answers_ping(self, at: At, *, tries: int = TRIES) -> bool:
        """Say whether anything answers a ping at ``at``, intact or damaged, at any status return level.

        Raises NotConnected.
        """
        request, size = self._codec(at).ping(at.id), 3 if at.protocol == 2 else 0
        damaged = self.tally(at.id).corrupt
        return any(
            self._told(at, request, size) is not None or self.tally(at.id).corrupt > damaged for _ in range(tries)
        )

    def read(self, at: At, register: Register) -> int:
        """Return the value of ``register``. Raises NoReply after ``TRIES`` tries, NotConnected, BadRequest."""
        return register.decode(self.read_block(at, register.address, register.size), register.address)

    def read_block(self, at: At, address: int, count: int, *, tries: int = TRIES) -> bytes:
        """Return ``count`` bytes of the control table from ``address``. Raises as ``read``."""
        block = Block(address, count)
        question = _Question(block, block, self._clock.now())
        return self._ask(at, question, lambda: self._looked_up(at, question), tries)

    def write(self, at: At, register: Register, value: int) -> None:
        """Write ``value``. Sent once: without a reply (NoReply) it may have been carried out or not.

        Raises BadRequest for a value that does not fit the register or that the servo refuses, and NotConnected.
        """
        self.write_block(at, register.address, self._encoded(at.id, register, value))

    def write_block(self, at: At, address: int, data: bytes) -> None:
        """Write ``data`` from ``address`` on. Sent once, raises as ``write``."""
        self._order(at, f"write of {data.hex(' ')} at {address}", self._codec(at).write(at.id, address, data))

    def reboot(self, at: At) -> None:
        """Start a servo anew: it goes limp. Raises BadRequest in protocol 1.0, else as ``write``."""
        self._order(at, "reboot", self._codec(at).reboot(at.id))

    def reset(self, at: At, keep: Keep) -> None:
        """Set a servo back to what it was delivered as, but for what it is to ``keep``. Raises as ``write``."""
        self._order(at, f"factory reset that keeps {keep}", self._codec(at).reset(at.id, keep))

    # --- many servos --------------------------------------------------------------------------------------------------

    def read_many(self, wanted: Mapping[At, Block], *, how: Literal["bulk", "sync"]) -> dict[At, bytes]:
        """Read a block of each servo with one request; a sync read wants the same of all. Tried once.

        Returns the blocks of those that answered; the rest are missing. Raises BadRequest, NotConnected.
        """
        if not wanted:
            self._opened()
            return {}
        protocol, *others = {at.protocol for at in wanted}
        if others:
            raise BadRequest(f"{self.name}: one request cannot ask servos of both protocols", hint="ask them apart")
        blocks = {at.id: block for at, block in wanted.items()}
        codec = self._common(protocol, blocks)
        if how == "sync" and len(set(blocks.values())) > 1:
            raise BadRequest(f"{self.name}: a sync read reads the same of all servos", hint="use a bulk read")
        with self._lock:
            now, question = self._clock.now(), object()
            asked = {servo: Wanted(question, block.size, now) for servo, block in blocks.items()}
            for servo, want in asked.items():
                if not self._overdue.clear(servo, want, now):  # it is left to be read by itself
                    del blocks[servo]
            if not blocks:
                return {}
            same = next(iter(blocks.values()))
            request = codec.sync_read(blocks, same) if how == "sync" else codec.bulk_read(blocks)
            replies = self._transact(codec, request, {servo: asked[servo] for servo in blocks})
        return {at: replies[at.id].data for at in wanted if at.id in replies and replies[at.id].data}

    def sync_write(self, protocol: Protocol, register: Register, values: Mapping[int, int]) -> None:
        """Write ``register`` of many servos at once, which none acknowledges.

        Raises BadRequest for a value that does not fit the register, and NotConnected.
        """
        encoded = {servo: self._encoded(servo, register, value) for servo, value in values.items()}
        self.sync_write_block(protocol, register.address, encoded)

    def sync_write_block(self, protocol: Protocol, address: int, blocks: Mapping[int, bytes]) -> None:
        """Write a block of the same size from ``address`` to many servos, in as few packets as hold it.

        Raises BadRequest for blocks of several sizes or that are too long, NotConnected.
        """
        self._opened()
        if not blocks:
            return
        codec = self._common(protocol, blocks)
        size = max(len(block) for block in blocks.values())
        room = codec.sync_room(size)
        if not room or any(len(block) != size for block in blocks.values()):
            sizes = sorted({len(block) for block in blocks.values()})
            raise BadRequest(f"{self.name}: a sync write cannot hold blocks of {sizes} bytes")
        rest = iter(blocks.items())
        with self._lock:
            while some := dict(islice(rest, room)):
                self._transact(codec, codec.sync_write(address, size, some), {})

    def find(self, *, protocol: Protocol, ids: Iterable[int]) -> Iterator[Identity]:
        """Look for the servos ``ids`` at this rate: in protocol 2.0 by one ping for all, else one after the other.

        Each is tried once. Raises NotConnected.
        """
        sought = [At(servo, protocol) for servo in ids if servo <= self._codecs[protocol].last_id]
        if protocol == 2:
            codec = self._codecs[protocol]
            request = codec.ping(BROADCAST)
            wanted = {at.id: Wanted(request, 3, self._clock.now()) for at in sought}
            slots = (codec.last_id + 1) * ROLL_CALL
            for servo, reply in self._transact(codec, request, wanted, wait=slots).items():
                if reply.data:
                    yield _identity(At(servo, protocol), reply.data)
            return
        for at in sought:
            try:
                yield self.identify(at, tries=1)
            except (NoReply, BadRequest):
                continue

    # --- how ----------------------------------------------------------------------------------------------------------

    def _ask(self, at: At, what: object, attempt: Callable[[], Reply | None], tries: int) -> bytes:
        """Make an attempt until it is answered, ``tries`` times at most; return the data of the answer."""
        tally = self.tally(at.id)
        damaged = tally.corrupt
        for _ in range(tries):
            if (reply := attempt()) is None:
                continue
            if not reply.data and reply.faults & REFUSAL:
                tally.refused += 1
                raise BadRequest(
                    f"{self.name}: servo {at.id} refused a {what}: {(reply.faults & REFUSAL).words}",
                    hint=_cure(reply.faults),
                )
            return reply.data
        raise self._silence(at, what, tries, tally.corrupt - damaged)

    def _looked_up(self, at: At, question: _Question) -> Reply | None:
        """Read a block once."""
        codec, block = self._codec(at), question.block
        with self._lock:
            wide = question.asked = self._overdue.widened(at.id, question.asked, question, question.began)
            wanted = Wanted(question, wide.size, question.began)
            reply = self._transact(codec, codec.read(at.id, wide), {at.id: wanted}).get(at.id)
        if reply is None or not reply.data or wide is block:
            return reply
        start = block.address - wide.address
        return reply._replace(data=reply.data[start : start + block.size])

    def _told(self, at: At, request: Packet, size: int) -> Reply | None:
        """Send anything else once."""
        wanted = Wanted(request, size, self._clock.now())
        return self._transact(self._codec(at), request, {at.id: wanted}).get(at.id)

    def _order(self, at: At, what: str, request: Packet) -> None:
        """Send what must not be repeated blindly, for it may have been carried out although no reply came."""
        self._ask(at, what, lambda: self._told(at, request, 0), 1)

    def _encoded(self, servo: int, register: Register, value: int) -> bytes:
        if not register.lower <= value <= register.upper:
            raise BadRequest(
                f"{self.name}: servo {servo}: {register.name} takes {register.lower}..{register.upper}, not {value}"
            )
        return register.encode(value)

    def _codec(self, at: At) -> Codec:
        return self._common(at.protocol, (at.id,))

    def _common(self, protocol: Protocol, servos: Iterable[int]) -> Codec:
        """Return the protocol, if servos can have such IDs in it."""
        codec = self._codecs[protocol]
        for servo in servos:
            if not 0 <= servo <= codec.last_id:
                raise BadRequest(f"{self.name}: a servo's ID is 0..{codec.last_id} in {called(protocol)}, not {servo}")
        return codec

    def _silence(self, at: At, what: object, tries: int, damaged: int) -> NoReply:
        where = f"{self.port} at {self.baud} baud"
        if damaged:
            return NoReply(
                f"{self.name}: servo {at.id}: {damaged} of {tries} replies to a {what} damaged on {where}",
                hint=f"unplug the other servos: two with ID {at.id} disturb each other; then try another cable",
            )
        return NoReply(
            f"{self.name}: servo {at.id}: no reply to a {what} on {where} ({tries} tries)",
            hint=f"check its power and cable, its ID ({at.id}), its baud rate ({self.baud}), its protocol "
            f"({short(at.protocol)}), its status return level",
        )


def _identity(at: At, data: bytes) -> Identity:
    return Identity(at, int.from_bytes(data[:2], "little"), data[2])


def _recognised(at: At, data: bytes) -> Identity:
    """Return whose table begins so: that of protocol 1.0 with number, firmware and ID, or of an STS the other way."""
    number, firmware = int.from_bytes(data[3:5], "little"), int.from_bytes(data[:2], "little")
    found = ((_identity(At(at.id, 1), data), data[3]), (Identity(At(at.id, "STS"), number, firmware), data[5]))

    def likely(each: tuple[Identity, int]) -> tuple[int, bool]:
        identity, servo = each
        told, model = identity.at, model_of(identity.number)
        return (servo == at.id) + (model is not None and model.protocol == told.protocol), told == at

    return max(found, key=likely)[0]


def _cure(faults: Fault) -> str:
    """Say what helps against a refusal."""
    if faults & Fault.ACCESS:
        return "some registers are read-only, and settings (EEPROM) can be written with the torque off alone"
    if faults & (Fault.ANGLE_LIMIT | Fault.LIMIT):
        return "compare it with the limits that are set in the servo: mission servo info ID --robot FILE"
    return ""
