"""Virtual servo bus: Dynamixel and Feetech servos of all protocols on one wire.

It is called with received bytes and the time, and returns the bytes that the servos send. Replies are returned at once,
unless the bus is ``paced``. Replies of two servos with one ID overlap, or follow each other if their return delays
differ enough. A servo at another baud rate than the host does not receive, nor does a servo of another protocol.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from heapq import heappop, heappush
from itertools import count
from typing import Protocol

from drivers.api import HeadPose
from drivers.servos import wire, wire2
from drivers.servos.declared import DynamixelKeys, NeckJointKeys, NeckKeys
from drivers.servos.units import RETURN_DELAY_STEP, baud_code
from drivers.servos.virtual import protocol1, protocol2, sts
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.virtual.slots import Slot, merge_replies
from drivers.servos.wire import PACKET_TIMEOUT, Packet
from drivers.sim.context import SimContext
from drivers.virtual.device import VirtualDevice
from drivers.virtual.terminal import baud_rates_match

PacketHandler = Callable[[Packet, Sequence[VirtualServo], float], list[Slot]]

BITS_PER_BYTE = 10
"""Bits on the wire per byte: start bit, eight data bits, stop bit."""


class FaultInjection(Protocol):
    """Faults injected into the bytes between a virtual bus and its host."""

    def disturb(self, reply: bytes) -> list[tuple[float, bytes]]:
        """Return the pieces of ``reply`` that arrive, each with its delay in seconds; empty if it is lost."""
        ...

    def echoes(self) -> bool:
        """True if the adapter echoes the next request to the host."""
        ...


class VirtualServoBus:
    """A virtual servo bus: a ``WireDevice``, ``TimedDevice`` and ``MultiRateDevice``.

    With ``paced``, bytes take their time on the wire, and servos wait for their return delay. ``injection`` adds faults
    to the bytes. ``contention`` is for servos with one ID that reply at the same time: it is called with all these
    replies, and returns those that reach the host, because their senders drive the wire more strongly. If it is None,
    all replies overlap on the wire. Both may be replaced at any time.
    """

    def __init__(
        self,
        servos: Sequence[VirtualServo],
        baud: int = 1_000_000,
        *,
        paced: bool = False,
        injection: FaultInjection | None = None,
    ) -> None:
        self.servos = tuple(servos)
        self.paced = paced
        self.injection = injection
        self.contention: Callable[[Slot], Slot] | None = None
        self._stacks: list[tuple[wire.PacketParser, PacketHandler, list[VirtualServo]]] = []
        for protocol, parser, obey in (
            (1, wire.PacketParser(), protocol1.handle_packet),
            (2, wire2.PacketParser2(), protocol2.handle_packet),
            ("STS", wire.PacketParser(), sts.handle_packet),
        ):
            if own := [servo for servo in self.servos if servo.model.protocol == protocol]:
                self._stacks.append((parser, obey, own))
        for servo in self.servos:
            servo.set("baud", baud_code(baud, servo.model.protocol))
        self._first_baud = baud
        self._baud_registers = [(servo.table, servo.model.table["baud"].address) for servo in self.servos]
        self._active_codes = self._baud_codes()
        self._rates = self._servo_rates()
        self._host_baud: int | None = None
        self._tuned_stacks: list[tuple[wire.PacketParser, PacketHandler, list[VirtualServo]]] | None = (
            None  # parsers and servos at the host's baud rate
        )
        self._received_at = self._free_at = 0.0
        self._codes_changed_at: float | None = None
        self._pending: list[tuple[float, int, bytes]] = []  # due time, sequence number, bytes
        self._numbers = count()

    @property
    def baud(self) -> int:
        """Rate on the wire: the host's if known, else that of most servos."""
        if self._host_baud is not None:
            return self._host_baud
        ((baud, _),) = Counter(self._rates.values()).most_common(1) or [(self._first_baud, 0)]
        return baud

    def set_baud(self, baud: int) -> None:
        """Set the baud rate of the host (0: disconnected); servos at another rate do not receive."""
        if self._host_baud != (baud or None):
            self._host_baud = baud or None
            self._tuned_stacks = None

    def servo(self, number: int) -> VirtualServo:
        """Return the first servo with ID ``number``. Raises KeyError if there is none."""
        for servo in self.servos:
            if servo.number == number:
                return servo
        raise KeyError(f"no servo has the ID {number}")

    def feed(self, data: bytes, now: float) -> bytes:
        """Receive a chunk of requests; return the bytes that are due now."""
        self._change_rates(now)
        if now - self._received_at > PACKET_TIMEOUT:
            for parser, _, _ in self._stacks:
                parser.reset()
        self._received_at = now
        self._occupy(len(data), now)
        if self.injection and self.injection.echoes():
            self._send(data, now)
        for parser, obey, in_tune in self._stacks_in_tune():
            for packet in parser.feed(data):
                for slot in obey(packet, [servo for servo in in_tune if servo.is_listening], now):
                    self._reply(slot, now)
        self._change_rates(now)
        return self._take_due(now)

    def poll(self, now: float) -> bytes:
        """Advance the time; return the bytes that are due.

        A new baud rate applies once the reply to its write was sent.
        """
        if not self._pending:  # else the due reply would be delayed
            for servo in self.servos:
                servo.catch_up(now)
        self._change_rates(now)
        return self._take_due(now)

    def next_poll_time(self) -> float | None:
        """Return the time of the next bytes; None if none are pending."""
        return self._pending[0][0] if self._pending else None

    def _stacks_in_tune(self) -> list[tuple[wire.PacketParser, PacketHandler, list[VirtualServo]]]:
        """Packet parser, packet handler, and servos at the current baud rate, for each protocol."""
        if self._tuned_stacks is None:
            baud = self.baud
            self._tuned_stacks = [
                (parser, obey, [servo for servo in own if baud_rates_match(self._rates[servo], baud)])
                for parser, obey, own in self._stacks
            ]
        return self._tuned_stacks

    def _baud_codes(self) -> list[int]:
        """The baud codes in the tables of the servos."""
        return [table[address] for table, address in self._baud_registers]

    def _change_rates(self, now: float) -> None:
        """Apply new baud codes once the replies to their writes were sent."""
        codes = self._baud_codes()
        if codes == self._active_codes:
            self._codes_changed_at = None
        elif self._codes_changed_at is None:
            self._codes_changed_at = now
        elif now > self._codes_changed_at and not self._pending:
            self._active_codes = codes
            self._rates, self._tuned_stacks = self._servo_rates(), None

    def _servo_rates(self) -> dict[VirtualServo, int]:
        """The baud rates of the servos."""
        return {servo: servo.settings.baud for servo in self.servos}

    def _occupy(self, size: int, now: float, delay: float = 0.0) -> float:
        """Reserve the wire for ``size`` bytes once it is free; return the end of the transmission."""
        if not self.paced:
            return now
        self._free_at = max(self._free_at, now) + delay + size * BITS_PER_BYTE / self.baud
        return self._free_at

    def _reply(self, slot: Slot, now: float) -> None:
        if self.contention and len(slot) > 1:
            slot = self.contention(slot)
        delays = [servo.settings.return_delay * RETURN_DELAY_STEP + servo.reply_skew for servo, _ in slot]
        first, sent = min(delays), 0.0
        bursts = merge_replies(
            [((delay - first) * self.baud, data) for delay, (_, data) in zip(delays, slot, strict=True)]
        )
        for begin, data in bursts:
            due = self._occupy(len(data), now, first if begin == bursts[0][0] else max(0.0, begin / self.baud - sent))
            sent = begin / self.baud + len(data) * BITS_PER_BYTE / self.baud
            for late, piece in self.injection.disturb(data) if self.injection else [(0.0, data)]:
                self._send(piece, due + late)

    def _send(self, data: bytes, due: float) -> None:
        heappush(self._pending, (due, next(self._numbers), data))

    def _take_due(self, now: float) -> bytes:
        said = b""
        while self._pending and self._pending[0][0] <= now:
            said += heappop(self._pending)[2]
        return said


def make(keys: DynamixelKeys, stage: SimContext) -> VirtualDevice:  # noqa: ARG001
    """Return a virtual bus with the servos of an arm and their calibration.

    The state of the device is the joint angles by name, in radians.
    """
    offsets = keys.offsets
    chain = []
    for name, joint in keys.servos.items():
        servo = VirtualServo(
            joint.id, model=joint.model, angle=joint.zero + offsets.get(name, 0) * joint.servo_model.tick
        )
        if name in offsets:
            servo.set("position_offset", offsets[name])
        chain.append(servo)
    bus = VirtualServoBus(chain, keys.baud)

    def state(_: float) -> object:
        # One servo per joint, in order: IDs may have been changed.
        return {name: servo.angle for name, servo in zip(keys.joints, bus.servos, strict=True)}

    return VirtualDevice(bus, "servos", state=state)


def make_neck(keys: NeckKeys, stage: SimContext) -> VirtualDevice:
    """Return the virtual head on two joints of the arm. It has no port of its own, but uses the bus of the arm."""
    arm: DynamixelKeys = stage.part_keys["arm"]
    bus: VirtualServoBus = stage.parts["arm"].device

    def angle(axis: NeckJointKeys) -> float:
        return true_angle(bus, arm, axis.joint) - axis.trim

    return VirtualDevice(None, head_pose=lambda _: HeadPose(angle(keys.pan), angle(keys.tilt)))


def true_angle(bus: VirtualServoBus, arm: DynamixelKeys, name: str) -> float:
    """Return the true angle in radians of the arm's joint ``name``, measured from the joint's zero."""
    joint = arm.servos[name]
    turned = bus.servo(joint.id).angle - joint.zero - arm.offsets.get(name, 0) * joint.servo_model.tick
    return -turned if joint.reverse else turned
