"""One Dynamixel bus: the port that it owns, and every transaction on it, one at a time.

The Dynamixel SDK makes and reads the packets; what it lacks is added here: a lock that waits, time-outs that fit the
transaction, checked lengths, retries of reads, figures of each servo, and one family of errors.
"""

import termios
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from threading import RLock
from typing import Any

import serial
from dynamixel_sdk import COMM_RX_CORRUPT, COMM_RX_TIMEOUT, COMM_SUCCESS, Protocol1PacketHandler

from drivers.clock import Clock
from drivers.dynamixel.models import MODEL_NUMBER, Register
from drivers.dynamixel.port import Port, quicken
from drivers.dynamixel.wire import BROADCAST, REFUSAL, Fault, Instruction
from drivers.errors import BadRequest, NoReply, NotConnected
from drivers.ports import explain, open_port

TRIES = 3
"""How often a read is sent before it counts as unanswered."""


@dataclass(slots=True)
class Tally:
    """What became of the requests to one servo: all, those without a reply, and those with a damaged one."""

    tries: int = 0
    misses: int = 0
    corrupt: int = 0


class Bus:
    """Owns the port of a chain of servos. Safe between threads: a second one waits for the first.

    ``patience`` (seconds) is what a reply may take beyond its bytes and the servo's return delay; the timer of a slow
    USB adapter is added to it. A transport error closes the port; ``open`` may be called again.
    """

    def __init__(
        self, port: str, clock: Clock, *, baud: int = 1_000_000, name: str = "servos", patience: float = 0.005
    ) -> None:
        self.port = port
        self.baud = baud
        self.name = name
        self.latency = 0.0  # seconds for which the adapter may hold a reply back, known once it was open
        self._clock = clock
        self._patience = patience
        self._lock = RLock()
        self._line: serial.Serial | None = None
        self._handler: Port | None = None
        self._packets: Any = Protocol1PacketHandler()
        self._trouble = NotConnected(f"{name}: {port}: not opened yet")
        self._tallies: dict[int, Tally] = {}
        self._faults: dict[int, Fault] = {}

    def open(self) -> None:
        """Take the port for this process alone. Raises NotConnected, with what to try; does nothing if it is open."""
        with self._lock:
            if self._line is not None:
                return
            try:
                line = open_port(self.name, self.port, self.baud, timeout=0)
            except NotConnected as error:
                self._trouble = error
                raise
            self.latency = quicken(line)
            self._line = line
            self._handler = Port(line, self._clock, self._patience + self.latency)

    def close(self) -> None:
        """Release the port. Safe from any state, more than once."""
        self._release(NotConnected(f"{self.name}: {self.port}: closed"))

    @property
    def is_open(self) -> bool:
        """True while the port is held."""
        return self._line is not None

    def require(self) -> None:
        """Raise NotConnected, with the reason, unless the port is open."""
        self._opened()

    def ping(self, servo: int, *, tries: int = TRIES) -> int:
        """Return the model number of ``servo``. Raises NoReply if it is not there."""
        self._retried(servo, "ping", Instruction.PING, b"", 0, tries)
        return self.read(servo, MODEL_NUMBER)

    def read(self, servo: int, register: Register) -> int:
        """Return the value of ``register``. Raises NoReply after ``TRIES`` tries, NotConnected, BadRequest."""
        return register.decode(self.read_block(servo, register.address, register.size), register.address)

    def read_block(self, servo: int, address: int, count: int, *, tries: int = TRIES) -> bytes:
        """Return ``count`` bytes of the control table from ``address``. Raises as ``read``."""
        what = f"read of {count} bytes at {address}"
        return self._retried(servo, what, Instruction.READ, bytes((address, count)), count, tries)

    def write(self, servo: int, register: Register, value: int) -> None:
        """Write ``value``. Sent once: without a reply (NoReply) it may have been carried out or not.

        Raises BadRequest for a value that does not fit the register or that the servo refuses, and NotConnected.
        """
        if not register.lower <= value <= register.upper:
            raise BadRequest(
                f"{self.name}: servo {servo}: {register.name} takes {register.lower}..{register.upper}, not {value}"
            )
        self.write_block(servo, register.address, register.encode(value))

    def write_block(self, servo: int, address: int, data: bytes) -> None:
        """Write ``data`` from ``address`` on. Sent once, raises as ``write``."""
        what = f"write of {data.hex(' ')} at {address}"
        # A request that arrived damaged was not carried out, but a servo says so seldom enough not to retry here.
        self._retried(servo, what, Instruction.WRITE, bytes((address,)) + data, 0, 1)

    def sync_write(self, register: Register, values: Mapping[int, int]) -> None:
        """Write ``register`` of many servos in one packet, which none acknowledges. Raises NotConnected."""
        self.sync_write_block(register.address, {servo: register.encode(value) for servo, value in values.items()})

    def sync_write_block(self, address: int, blocks: Mapping[int, bytes]) -> None:
        """Write a block of the same size from ``address`` to many servos at once. Raises as ``sync_write``."""
        if not blocks:
            self._opened()
            return
        sizes = {len(block) for block in blocks.values()}
        parameters = [byte for servo, block in blocks.items() for byte in (servo, *block)]
        if len(sizes) != 1 or len(parameters) > 242:  # the SDK sends packets of at most 250 bytes
            raise BadRequest(f"{self.name}: one sync write cannot hold {len(blocks)} blocks of {sorted(sizes)} bytes")
        with self._lock:
            port = self._opened()
            try:
                self._packets.syncWriteTxOnly(port, address, sizes.pop(), parameters, len(parameters))
            except (serial.SerialException, OSError, termios.error) as error:
                raise self._lost(error) from error
            finally:
                port.is_using = False

    def faults(self, servo: int) -> Fault:
        """Return the error bits of the newest reply of ``servo``; none if it never replied."""
        return self._faults.get(servo, Fault(0))

    def tally(self, servo: int) -> Tally:
        """Return the figures of ``servo`` since the bus was made."""
        return self._tallies.setdefault(servo, Tally())

    def _opened(self) -> Port:
        if self._handler is None:
            raise NotConnected(str(self._trouble), hint=self._trouble.hint)
        return self._handler

    def _retried(self, servo: int, what: str, code: Instruction, parameters: bytes, size: int, tries: int) -> bytes:
        """Send a request until it is answered, ``tries`` times at most; return the ``size`` bytes of the answer."""
        if not 0 <= servo < BROADCAST:
            raise BadRequest(f"{self.name}: a servo's ID is 0..253, not {servo}")
        damaged = self.tally(servo).corrupt
        for _ in range(tries):
            reply = self._exchange(servo, [0, 0, servo, len(parameters) + 2, code, *parameters, 0], size)
            if reply is None:
                continue
            faults = Fault(reply[4])
            self._faults[servo] = faults & ~REFUSAL
            if faults & REFUSAL and len(reply) == 6:
                raise BadRequest(f"{self.name}: servo {servo} refused a {what}: {faults.words}")
            return reply[5:-1]
        raise self._silence(servo, what, tries, self.tally(servo).corrupt - damaged)

    def _exchange(self, servo: int, packet: list[int], size: int) -> bytes | None:
        """Send one packet and return the whole reply if it is sound: ``size`` bytes of data, or a refusal."""
        with self._lock:
            port = self._opened()
            tally = self.tally(servo)
            tally.tries += 1
            try:
                reply, result, _ = self._packets.txRxPacket(port, packet)
            except (serial.SerialException, OSError, termios.error) as error:
                raise self._lost(error) from error
            finally:
                port.is_using = False  # the SDK leaves it set after an exception
            if result == COMM_RX_TIMEOUT:
                tally.misses += 1
            elif result == COMM_RX_CORRUPT or (result == COMM_SUCCESS and not _sound(reply, size)):
                tally.corrupt += 1
            elif result == COMM_SUCCESS:
                return bytes(reply)
            else:
                raise self._lost(OSError(self._packets.getTxRxResult(result)))
            return None

    def _silence(self, servo: int, what: str, tries: int, damaged: int) -> NoReply:
        where = f"{self.port} at {self.baud} baud"
        if damaged:
            return NoReply(
                f"{self.name}: servo {servo}: {damaged} of {tries} replies to a {what} damaged on {where}",
                hint=f"unplug the other servos: two with ID {servo} disturb each other; then try another cable",
            )
        return NoReply(
            f"{self.name}: servo {servo}: no reply to a {what} on {where} ({tries} tries)",
            hint=f"check its power and cable, its ID ({servo}), its baud rate ({self.baud}), its status return level",
        )

    def _lost(self, error: Exception) -> NotConnected:
        trouble = explain(self.name, self.port, error)
        self._release(trouble)
        return trouble

    def _release(self, why: NotConnected) -> None:
        with self._lock:
            line, self._line, self._handler = self._line, None, None
            self._trouble = why
            if line is not None:
                with suppress(serial.SerialException, OSError, termios.error):  # it may be gone already
                    line.close()


def _sound(reply: list[int], size: int) -> bool:
    """Whether a reply carries ``size`` bytes of data, or none because the request is refused, and no checksum error."""
    faults = Fault(reply[4])
    data = len(reply) - 6
    expected = data == size or (data == 0 and bool(faults & REFUSAL))
    return expected and reply[3] == data + 2 and not faults & Fault.CHECKSUM
