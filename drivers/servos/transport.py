"""Serial transport of a servo bus: one request and its replies at a time, with statistics of each servo."""

from collections import defaultdict, deque
from collections.abc import Mapping
from threading import RLock

from drivers.api.fast_dataclass import dataclass
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.servos.codec import Codec, Exchange, ExpectedReply, LateReplies, ServoReply, codecs_for
from drivers.servos.units import RETURN_DELAY_STEP, Framing, Protocol
from drivers.servos.wire import REFUSAL_FAULTS, Packet, ServoFault
from drivers.transport.adapter import BusTransport, TransportOpener, open_transport
from drivers.transport.history import DelayStatistics

MAX_RETURN_DELAY = 254 * RETURN_DELAY_STEP
"""Longest return delay that a servo can be set to, in seconds."""

SECOND_REPLY_DELAY = 0.004
"""Seconds beyond the longest return delay for which the reply of a second servo with the same ID is awaited."""


@dataclass(slots=True)
class ServoStatistics:
    """Counts of requests to one servo and of its replies.

    ``tries`` counts requests that need a reply, ``misses`` those without one, ``corrupt`` those with a damaged one,
    ``late`` replies that arrived after the timeout, ``refused`` refused requests. ``duplicates`` counts surplus intact
    replies: a second servo has the same ID. ``slowest`` is the longest successful exchange, in seconds.
    """

    tries: int = 0
    misses: int = 0
    corrupt: int = 0
    late: int = 0
    refused: int = 0
    duplicates: int = 0
    slowest: float = 0.0


class ServoTransport:
    """Owner of the serial line of a servo bus. Thread-safe: requests of other threads wait.

    A reply is awaited for the time of its bytes on the wire, the longest return delay, the latency of the USB adapter
    and ``reply_timeout`` (seconds). A transport error closes the port; call ``open`` again. ``dial`` is the function
    that opens the line; ``framing`` selects the packet code of MissionTree ("own") or of ROBOTIS ("sdk").
    """

    def __init__(
        self,
        port: str,
        clock: Clock,
        *,
        baud: int = 1_000_000,
        name: str = "servos",
        reply_timeout: float = 0.004,
        dial: TransportOpener = open_transport,
        framing: Framing = "own",
    ) -> None:
        self.port = port
        self.name = name
        self.latency = 0.0  # seconds for which the adapter may hold a reply back, known once it was open
        self._baud = baud
        self._clock = clock
        self._reply_timeout = reply_timeout
        self._dial = dial
        self._lock = RLock()
        self._line: BusTransport | None = None
        self._last_error = NotConnected(f"{name}: {port}: not opened yet")
        self._codecs = codecs_for(framing)
        self._parsers = {protocol: codec.parser() for protocol, codec in self._codecs.items()}
        self._late_replies = LateReplies()
        self._recent_requests: deque[Packet] = deque(maxlen=4)  # an echo may repeat one of them
        self._statistics: defaultdict[int, ServoStatistics] = defaultdict(ServoStatistics)
        self._faults: dict[int, ServoFault] = {}
        self._busy_time = 0.0
        self._busy_until = 0.0
        self.exchanges = DelayStatistics()
        """Times from a request to the last of its replies, for complete exchanges since the bus was created."""

    def open(self) -> None:
        """Open the port exclusively. Does nothing if it is open. Raises NotConnected, with a hint."""
        with self._lock:
            if self._line is not None:
                return
            try:
                self._line = self._dial(self.name, self.port, self._baud, self._clock)
            except NotConnected as error:
                self._last_error = error
                raise
            self.latency = self._line.latency
            self._busy_time = 0.0
            self._late_replies.reset()

    def close(self) -> None:
        """Release the port. Safe from any state, more than once."""
        self._release(NotConnected(f"{self.name}: {self.port}: closed"))

    @property
    def is_open(self) -> bool:
        """True while the port is open."""
        return self._line is not None

    def require_open(self) -> None:
        """Raise NotConnected, with the reason, unless the port is open."""
        self._require_line()

    @property
    def baud(self) -> int:
        """Baud rate of the line. Setting it keeps the port open.

        The setter raises NotConnected if the adapter does not support the rate.
        """
        return self._baud

    @baud.setter
    def baud(self, baud: int) -> None:
        with self._lock:
            self._baud = baud
            self._late_replies.reset()
            if self._line is not None:
                try:
                    self._line.set_baud(baud)
                except NotConnected as error:
                    self._release(error)
                    raise

    def now(self) -> float:
        """Return the time of the bus clock, in seconds."""
        return self._clock.now()

    def busy_time(self) -> float:
        """Return the seconds since ``open`` in which the line carried requests or replies, or a reply was awaited."""
        return self._busy_time

    def noise_bytes(self) -> int:
        """Return the number of received bytes outside of intact packets since the bus was created."""
        return sum(parser.skipped_bytes for parser in self._parsers.values())

    def faults(self, servo: int) -> ServoFault:
        """Return the faults of ``servo`` itself in its newest reply, without refusals; none before the first reply."""
        return self._faults.get(servo, ServoFault(0))

    def statistics(self, servo: int) -> ServoStatistics:
        """Return the statistics of ``servo`` since the bus was created."""
        return self._statistics[servo]

    def listen_for_duplicate(self, protocol: Protocol, size: int, extra_time: float = SECOND_REPLY_DELAY) -> None:
        """Wait for a second servo with the same ID to send a reply with ``size`` bytes of data.

        Waits for the longest return delay and ``extra_time`` seconds. The reply counts in
        ``ServoStatistics.duplicates``. Raises NotConnected.
        """
        codec = self._codecs[protocol]
        with self._lock:
            line = self._require_line()
            reply = (codec.overhead + size) * 10 / self._baud
            until = self._clock.now() + reply + MAX_RETURN_DELAY + extra_time + self.latency
            try:
                while self._clock.now() < until:
                    self._receive_unrequested(line, codec, until)
            except NotConnected as error:
                self._release(error)
                raise

    # --- for the bus --------------------------------------------------------------------------------------------------

    def _transact(
        self, codec: Codec, request: Packet, expected: Mapping[int, ExpectedReply], *, extra_time: float = 0.0
    ) -> dict[int, ServoReply]:
        """Send a request once; return the replies of the ``expected`` servos by ID, without those that did not answer.

        ``extra_time`` (seconds) extends the reply timeout. Raises NotConnected, and BadRequest for a request that does
        not fit a packet.
        """
        try:
            frame = codec.frame(request.id, request.code, request.parameters)
        except ValueError as error:
            raise BadRequest(f"{self.name}: {error}") from error
        with self._lock:
            line = self._require_line()
            try:
                self._drain(line, codec, expected)
                sent = self._clock.now()
                line.send(frame)
                self._recent_requests.append(request)
                # Only now: after a delay before sending, an earlier time would make the reply seem late.
                leaving = max(self._clock.now(), self._busy_until) + len(frame) * 10 / self._baud
                if not expected:
                    self._add_busy_time(sent, leaving)
                    return {}
                exchange = Exchange(codec, expected, self._on_stray_reply, self._recent_requests)
                self._receive_replies(line, exchange, leaving + extra_time)
            except NotConnected as error:
                self._release(error)
                raise
            self._count(exchange, expected, sent, self._clock.now())
            return exchange.replies

    def _receive_replies(self, line: BusTransport, exchange: Exchange, begin: float) -> None:
        """Receive packets until all servos have answered, or the next reply is overdue.

        The first reply is due from time ``begin`` on.
        """
        parser = self._parsers[exchange.codec.protocol]
        deadline, over = begin + self._reply_time(exchange), False
        while exchange.missing:
            waiting = len(exchange.missing)
            heard = line.receive(deadline)
            for packet in parser.feed(heard):
                exchange.receive(packet)
            if exchange.missing and len(exchange.missing) < waiting:
                deadline, over = max(deadline, self._clock.now() + self._reply_time(exchange)), False
            elif over or not heard:
                return
            elif exchange.missing:
                over = self._clock.now() >= deadline

    def _reply_time(self, exchange: Exchange) -> float:
        """Return the seconds within which the next reply must arrive.

        This is the sum of its time on the wire (ten bits a byte), the longest return delay, the reply timeout and the
        latency.
        """
        size = exchange.codec.overhead + next(iter(exchange.missing.values())).size
        return size * 10 / self._baud + MAX_RETURN_DELAY + self._reply_timeout + self.latency

    def _drain(self, line: BusTransport, codec: Codec, expected: Mapping[int, ExpectedReply]) -> None:
        """Discard received bytes, and wait for late replies that could be mistaken for an ``expected`` one."""
        self._receive_unrequested(line, codec, 0.0)
        for servo, want in expected.items():
            while (until := self._late_replies.blocked_until(servo, want)) > self._clock.now():
                self._receive_unrequested(line, codec, until)
        self._parsers[codec.protocol].reset()

    def _receive_unrequested(self, line: BusTransport, codec: Codec, until: float) -> None:
        """Receive packets until ``until`` while no request is pending."""
        if heard := line.receive(until):
            for packet in self._parsers[codec.protocol].feed(heard):
                if packet.intact and (reply := codec.reply(packet)) is not None and packet not in self._recent_requests:
                    self._statistics[reply.id].duplicates += not self._on_stray_reply(reply)

    def _on_stray_reply(self, reply: ServoReply) -> bool:
        """Record a reply that does not belong to the current request; return True if it is late, for an earlier one."""
        if overdue := self._late_replies.pop(reply.id, len(reply.data)):
            self._statistics[reply.id].late += 1
        return overdue

    def _count(self, exchange: Exchange, expected: Mapping[int, ExpectedReply], sent: float, now: float) -> None:
        """Update the statistics of the ``expected`` servos after an exchange."""
        self._add_busy_time(sent, now)
        for servo in exchange.duplicates:
            self._statistics[servo].duplicates += 1
        if len(exchange.replies) == len(expected):
            self.exchanges.add(now - sent)
        for servo, want in expected.items():
            tally = self._statistics[servo]
            tally.tries += 1
            if reply := exchange.replies.get(servo):
                self._faults[servo] = reply.faults and reply.faults & ~REFUSAL_FAULTS
                tally.slowest = max(tally.slowest, now - sent)
                self._late_replies.on_reply(servo, want)
                continue
            if servo in exchange.damaged or (exchange.has_damaged_packet and len(expected) == 1):
                tally.corrupt += 1
            else:
                tally.misses += 1
            self._late_replies.add(servo, want, now)  # damaged bytes may not have been the reply

    def _add_busy_time(self, begin: float, end: float) -> None:
        """Add the time from ``begin`` to ``end`` to the busy time, except for a part that was already counted."""
        self._busy_time += max(0.0, end - max(begin, self._busy_until))
        self._busy_until = max(self._busy_until, end)

    def _require_line(self) -> BusTransport:
        if self._line is None:
            raise NotConnected(str(self._last_error), hint=self._last_error.hint)
        return self._line

    def _release(self, reason: NotConnected) -> None:
        with self._lock:
            line, self._line = self._line, None
            self._last_error = reason
            if line is not None:
                line.close()
