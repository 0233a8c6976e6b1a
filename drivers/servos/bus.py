"""A serial servo bus of any protocol: registers read and written, one servo or many at once."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from typing import Literal, NamedTuple

from drivers.api.fast_dataclass import dataclass
from drivers.errors import BadRequest, NoReply
from drivers.servos.codec import Codec, ExpectedReply, KeptSettings, ServoReply
from drivers.servos.models import find_model
from drivers.servos.register import Register, RegisterBlock
from drivers.servos.transport import ServoTransport
from drivers.servos.units import Protocol, protocol_label, protocol_name
from drivers.servos.wire import BROADCAST, REFUSAL_FAULTS, Packet, ServoFault

MAX_READ_ATTEMPTS = 3
"""Number of times a read is sent before it counts as unanswered."""

_IDENTITY_SIZE = 6
"""Bytes at the front of a control table that identify a servo of protocol 1.0 or an STS."""

BROADCAST_PING_SLOT = 0.003
"""Seconds that each ID has for its reply to a broadcast ping."""


class ServoAddress(NamedTuple):
    """Address of a servo on a bus: its ID and its protocol."""

    id: int
    protocol: Protocol = 1


@dataclass(frozen=True, slots=True)
class ServoIdentity:
    """Identity that a servo reports: model number and firmware version."""

    address: ServoAddress
    number: int
    firmware: int


@dataclass(slots=True, eq=False)
class _PendingRead:
    """A read of registers, with its attempts: the wanted block, the requested block, and the start time.

    The requested block can be wider than the wanted one, so that a late reply to another read is not mistaken for its
    reply.
    """

    block: RegisterBlock
    requested_block: RegisterBlock
    started_at: float

    def __str__(self) -> str:
        return f"read of {self.block.size} bytes at {self.block.address}"


class ServoBus(ServoTransport):
    """Servos on one serial line, whose registers are read and written. Reads are retried; writes are sent once."""

    # --- one servo ----------------------------------------------------------------------------------------------------

    def ping(self, at: ServoAddress, *, tries: int = MAX_READ_ATTEMPTS) -> int:
        """Return the model number of the servo ``at``. Raises NoReply if it answers none of ``tries`` requests."""
        return self.identify(at, tries=tries).number

    def identify(self, at: ServoAddress, *, tries: int = MAX_READ_ATTEMPTS) -> ServoIdentity:
        """Return the model and firmware of the servo ``at``. Raises NoReply if it answers none of ``tries`` requests.

        A reply to a ping of protocol 2.0 contains both. In protocol 1.0 it has no data, and can have the same bytes as
        an echo of the request, so the start of the control table is read instead. The table also tells a Dynamixel from
        an STS, which uses the same frames: the returned address may have protocol "STS".
        """
        if at.protocol != 2:
            return _parse_table_head(at, self.read_block(at, 0, _IDENTITY_SIZE, tries=tries))
        request = self._codec_for(at).ping(at.id)
        return _parse_identity(
            at, self._transact_with_retries(at, "ping", lambda: self._send_once(at, request, 3), tries)
        )

    def answers_ping(self, at: ServoAddress, *, tries: int = MAX_READ_ATTEMPTS) -> bool:
        """True if a reply to a ping arrives, intact or damaged, at any status return level. Raises NotConnected."""
        request, size = self._codec_for(at).ping(at.id), 3 if at.protocol == 2 else 0
        damaged = self.statistics(at.id).corrupt
        return any(
            self._send_once(at, request, size) is not None or self.statistics(at.id).corrupt > damaged
            for _ in range(tries)
        )

    def read(self, at: ServoAddress, register: Register) -> int:
        """Return a register's value. Raises NoReply after ``MAX_READ_ATTEMPTS`` tries, NotConnected, BadRequest."""
        return register.decode(self.read_block(at, register.address, register.size), register.address)

    def read_block(self, at: ServoAddress, address: int, count: int, *, tries: int = MAX_READ_ATTEMPTS) -> bytes:
        """Return ``count`` bytes of a servo's control table from ``address`` on. Raises as ``read``."""
        block = RegisterBlock(address, count)
        question = _PendingRead(block, block, self._clock.now())
        return self._transact_with_retries(at, question, lambda: self._read_once(at, question), tries)

    def write(self, at: ServoAddress, register: Register, value: int) -> None:
        """Write ``value`` to a register of a servo. Sent once: on NoReply the servo may have executed the write or not.

        Raises BadRequest for a value that does not fit the register or that the servo refuses, and NotConnected.
        """
        self.write_block(at, register.address, self._encode(at.id, register, value))

    def write_block(self, at: ServoAddress, address: int, data: bytes) -> None:
        """Write ``data`` to a servo's control table from ``address`` on. Sent once, raises as ``write``."""
        self._send_command(
            at, f"write of {data.hex(' ')} at {address}", self._codec_for(at).write(at.id, address, data)
        )

    def reboot(self, at: ServoAddress) -> None:
        """Reboot a servo, which switches its torque off. Raises BadRequest unless protocol 2.0, else as ``write``."""
        self._send_command(at, "reboot", self._codec_for(at).reboot(at.id))

    def reset(self, at: ServoAddress, keep: KeptSettings) -> None:
        """Reset a servo to factory settings, except for the settings that ``keep`` names. Raises as ``write``."""
        self._send_command(at, f"factory reset that keeps {keep}", self._codec_for(at).reset(at.id, keep))

    # --- many servos --------------------------------------------------------------------------------------------------

    def read_many(
        self, targets: Mapping[ServoAddress, RegisterBlock], *, mode: Literal["bulk", "sync"]
    ) -> dict[ServoAddress, bytes]:
        """Read one block of registers of each servo in ``targets`` with a single request, which is sent once.

        With ``mode`` "sync" all blocks must be equal, with "bulk" they may differ. Returns the bytes of each servo that
        answered. Raises BadRequest and NotConnected.
        """
        if not targets:
            self._require_line()
            return {}
        protocol, *others = {at.protocol for at in targets}
        if others:
            raise BadRequest(
                f"{self.name}: one request cannot address servos of both protocols",
                hint="send a request for each protocol",
            )
        blocks = {at.id: block for at, block in targets.items()}
        codec = self._checked_codec(protocol, blocks)
        if mode == "sync" and len(set(blocks.values())) > 1:
            raise BadRequest(f"{self.name}: a sync read needs the same block of all servos", hint="use a bulk read")
        with self._lock:
            now, question = self._clock.now(), object()
            asked = {servo: ExpectedReply(question, block.size, now) for servo, block in blocks.items()}
            for servo, want in asked.items():
                if not self._late_replies.is_clear(servo, want, now):  # it is read singly
                    del blocks[servo]
            if not blocks:
                return {}
            same = next(iter(blocks.values()))
            request = codec.sync_read(blocks, same) if mode == "sync" else codec.bulk_read(blocks)
            replies = self._transact(codec, request, {servo: asked[servo] for servo in blocks})
        return {at: replies[at.id].data for at in targets if at.id in replies and replies[at.id].data}

    def sync_write(self, protocol: Protocol, register: Register, values: Mapping[int, int]) -> None:
        """Write ``register`` of many servos in one packet, without acknowledgement.

        Raises BadRequest for a value that does not fit the register, and NotConnected.
        """
        encoded = {servo: self._encode(servo, register, value) for servo, value in values.items()}
        self.sync_write_block(protocol, register.address, encoded)

    def sync_write_block(self, protocol: Protocol, address: int, blocks: Mapping[int, bytes]) -> None:
        """Write blocks of equal size from ``address`` to many servos, in as few packets as possible.

        Raises BadRequest for blocks that differ in size or are too long, and NotConnected.
        """
        self._require_line()
        if not blocks:
            return
        codec = self._checked_codec(protocol, blocks)
        size = max(len(block) for block in blocks.values())
        room = codec.max_sync_servos(size)
        if not room or any(len(block) != size for block in blocks.values()):
            sizes = sorted({len(block) for block in blocks.values()})
            raise BadRequest(f"{self.name}: a sync write cannot hold blocks of {sizes} bytes")
        rest = iter(blocks.items())
        with self._lock:
            while some := dict(islice(rest, room)):
                self._transact(codec, codec.sync_write(address, size, some), {})

    def find_servos(self, *, protocol: Protocol, ids: Iterable[int]) -> Iterator[ServoIdentity]:
        """Yield the servos among ``ids`` at the current baud rate.

        Servos of protocol 2.0 are found by one broadcast ping, others one by one. Each ID is tried once. Raises
        NotConnected.
        """
        sought = [ServoAddress(servo, protocol) for servo in ids if servo <= self._codecs[protocol].last_id]
        if protocol == 2:
            codec = self._codecs[protocol]
            request = codec.ping(BROADCAST)
            wanted = {at.id: ExpectedReply(request, 3, self._clock.now()) for at in sought}
            slots = (codec.last_id + 1) * BROADCAST_PING_SLOT
            for servo, reply in self._transact(codec, request, wanted, extra_time=slots).items():
                if reply.data:
                    yield _parse_identity(ServoAddress(servo, protocol), reply.data)
            return
        for at in sought:
            try:
                yield self.identify(at, tries=1)
            except (NoReply, BadRequest):
                continue

    # --- how ----------------------------------------------------------------------------------------------------------

    def _transact_with_retries(
        self, at: ServoAddress, operation: object, attempt: Callable[[], ServoReply | None], tries: int
    ) -> bytes:
        """Call ``attempt`` up to ``tries`` times; return the data of its reply.

        Raises BadRequest for a refusal, NoReply, NotConnected.
        """
        tally = self.statistics(at.id)
        damaged = tally.corrupt
        for _ in range(tries):
            if (reply := attempt()) is None:
                continue
            if not reply.data and reply.faults & REFUSAL_FAULTS:
                tally.refused += 1
                raise BadRequest(
                    f"{self.name}: servo {at.id} refused a {operation}: {(reply.faults & REFUSAL_FAULTS).description}",
                    hint=_refusal_hint(reply.faults),
                )
            return reply.data
        raise self._no_reply_error(at, operation, tries, tally.corrupt - damaged)

    def _read_once(self, at: ServoAddress, pending: _PendingRead) -> ServoReply | None:
        """Send one read request; return the reply, or None if none came.

        A wider block is read if a late reply to an earlier request would look the same as the reply to this one.
        """
        codec, block = self._codec_for(at), pending.block
        with self._lock:
            wide = pending.requested_block = self._late_replies.widen(
                at.id, pending.requested_block, pending, pending.started_at
            )
            wanted = ExpectedReply(pending, wide.size, pending.started_at)
            reply = self._transact(codec, codec.read(at.id, wide), {at.id: wanted}).get(at.id)
        if reply is None or not reply.data or wide is block:
            return reply
        start = block.address - wide.address
        return reply._replace(data=reply.data[start : start + block.size])

    def _send_once(self, at: ServoAddress, request: Packet, size: int) -> ServoReply | None:
        """Send a request other than a read once; return the reply with ``size`` bytes of data, or None if none came."""
        wanted = ExpectedReply(request, size, self._clock.now())
        return self._transact(self._codec_for(at), request, {at.id: wanted}).get(at.id)

    def _send_command(self, at: ServoAddress, operation: str, request: Packet) -> None:
        """Send a command once. It must not be repeated: the servo may have executed it although no reply came."""
        self._transact_with_retries(at, operation, lambda: self._send_once(at, request, 0), 1)

    def _encode(self, servo: int, register: Register, value: int) -> bytes:
        if not register.lower <= value <= register.upper:
            raise BadRequest(
                f"{self.name}: servo {servo}: {register.name} takes {register.lower}..{register.upper}, not {value}"
            )
        return register.encode(value)

    def _codec_for(self, at: ServoAddress) -> Codec:
        return self._checked_codec(at.protocol, (at.id,))

    def _checked_codec(self, protocol: Protocol, servos: Iterable[int]) -> Codec:
        """Return the codec of ``protocol``. Raises BadRequest for IDs out of its range."""
        codec = self._codecs[protocol]
        for servo in servos:
            if not 0 <= servo <= codec.last_id:
                raise BadRequest(
                    f"{self.name}: a servo's ID is 0..{codec.last_id} in {protocol_name(protocol)}, not {servo}"
                )
        return codec

    def _no_reply_error(self, at: ServoAddress, operation: object, tries: int, damaged: int) -> NoReply:
        where = f"{self.port} at {self.baud} baud"
        if damaged:
            return NoReply(
                f"{self.name}: servo {at.id}: {damaged} of {tries} replies to a {operation} damaged on {where}",
                hint=f"unplug the other servos: two with ID {at.id} disturb each other; then try another cable",
            )
        return NoReply(
            f"{self.name}: servo {at.id}: no reply to a {operation} on {where} ({tries} tries)",
            hint=f"check its power and cable, its ID ({at.id}), its baud rate ({self.baud}), its protocol "
            f"({protocol_label(at.protocol)}), its status return level",
        )


def _parse_identity(at: ServoAddress, data: bytes) -> ServoIdentity:
    return ServoIdentity(at, int.from_bytes(data[:2], "little"), data[2])


def _parse_table_head(at: ServoAddress, data: bytes) -> ServoIdentity:
    """Return the identity in the first bytes of a control table, with the layout of protocol 1.0 or of an STS.

    Both layouts are tried. A layout counts more if it shows the ID of ``at``, and if it shows a known model; if both
    count the same, the protocol of ``at`` decides.
    """
    number, firmware = int.from_bytes(data[3:5], "little"), int.from_bytes(data[:2], "little")
    found = (
        (_parse_identity(ServoAddress(at.id, 1), data), data[3]),
        (ServoIdentity(ServoAddress(at.id, "STS"), number, firmware), data[5]),
    )

    def likely(each: tuple[ServoIdentity, int]) -> tuple[int, bool]:
        identity, servo = each
        told, model = identity.address, find_model(identity.number)
        return (servo == at.id) + (model is not None and model.protocol == told.protocol), told == at

    return max(found, key=likely)[0]


def _refusal_hint(faults: ServoFault) -> str:
    """Return a hint for a refused request."""
    if faults & ServoFault.ACCESS:
        return "some registers are read-only, and settings (EEPROM) can only be written with the torque off"
    if faults & (ServoFault.ANGLE_LIMIT | ServoFault.LIMIT):
        return "compare it with the servo's own limits: mission servo info ID --robot FILE"
    return ""
