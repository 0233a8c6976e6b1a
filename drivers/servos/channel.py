"""The line of a bus and who is on it: opened for one owner, one exchange at a time, with an account of every servo."""

from collections import defaultdict, deque
from collections.abc import Mapping
from threading import RLock

from drivers.api.quick import dataclass
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.servos.codec import Codec, Exchange, Overdue, Reply, Wanted, codecs
from drivers.servos.units import RETURN_DELAY_STEP, Framing, Protocol
from drivers.servos.wire import REFUSAL, Fault, Packet
from drivers.transport.adapter import Dial, Line, open_line
from drivers.transport.history import Delays

RETURN_DELAY = 254 * RETURN_DELAY_STEP
"""Seconds: the longest delay that a servo can be set to before it replies."""

SECOND_REPLY_DELAY = 0.004
"""Seconds beyond the longest return delay that a second servo with the same ID is listened for."""


@dataclass(slots=True)
class Tally:
    """What became of the requests to one servo.

    ``tries`` counts all that it was to answer, ``misses`` those without a reply, ``corrupt`` those with a damaged one,
    ``late`` replies that came after all, ``refused`` what it would not do. ``doubles`` counts intact replies beyond the
    one that was requested: a second servo has the same ID. ``worst`` is the longest exchange, in seconds, to which it
    replied.
    """

    tries: int = 0
    misses: int = 0
    corrupt: int = 0
    late: int = 0
    refused: int = 0
    doubles: int = 0
    worst: float = 0.0


class Channel:
    """Owns the line of a chain of servos. Safe between threads: a second one waits for the first.

    ``patience`` (seconds) is what a reply may take beyond its bytes and the longest return delay; the timer of a slow
    USB adapter is added to it. A transport error closes the port; ``open`` may be called again. ``dial`` opens the
    line; ``framing`` says whose code makes packets and finds them.
    """

    def __init__(
        self,
        port: str,
        clock: Clock,
        *,
        baud: int = 1_000_000,
        name: str = "servos",
        patience: float = 0.004,
        dial: Dial = open_line,
        framing: Framing = "own",
    ) -> None:
        self.port = port
        self.name = name
        self.latency = 0.0  # seconds for which the adapter may hold a reply back, known once it was open
        self._baud = baud
        self._clock = clock
        self._patience = patience
        self._dial = dial
        self._lock = RLock()
        self._line: Line | None = None
        self._trouble = NotConnected(f"{name}: {port}: not opened yet")
        self._codecs = codecs(framing)
        self._parsers = {protocol: codec.parser() for protocol, codec in self._codecs.items()}
        self._overdue = Overdue()
        self._sent: deque[Packet] = deque(maxlen=4)  # what an echo may repeat
        self._tallies: defaultdict[int, Tally] = defaultdict(Tally)
        self._faults: dict[int, Fault] = {}
        self._busy = 0.0
        self._used_until = 0.0
        self.exchanges = Delays()
        """From a request to the last of its replies, where all came, since the bus was made."""

    def open(self) -> None:
        """Take the port for this process alone. Raises NotConnected, with what to try; does nothing if it is open."""
        with self._lock:
            if self._line is not None:
                return
            try:
                self._line = self._dial(self.name, self.port, self._baud, self._clock)
            except NotConnected as error:
                self._trouble = error
                raise
            self.latency = self._line.latency
            self._busy = 0.0
            self._overdue.forget()

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

    @property
    def baud(self) -> int:
        """The rate of the line. Setting it keeps the port; raises NotConnected where the adapter cannot follow."""
        return self._baud

    @baud.setter
    def baud(self, baud: int) -> None:
        with self._lock:
            self._baud = baud
            self._overdue.forget()
            if self._line is not None:
                try:
                    self._line.tune(baud)
                except NotConnected as error:
                    self._release(error)
                    raise

    def now(self) -> float:
        """Return the time of its clock, in seconds."""
        return self._clock.now()

    def busy(self) -> float:
        """Return for how many seconds the line was in use, by requests, replies and the wait for them, since open."""
        return self._busy

    def noise(self) -> int:
        """Return how many bytes have come that were part of no sound packet, since the bus was made."""
        return sum(parser.skipped for parser in self._parsers.values())

    def faults(self, servo: int) -> Fault:
        """Return what the newest reply of ``servo`` complained of, apart from the request; nothing before the first."""
        return self._faults.get(servo, Fault(0))

    def tally(self, servo: int) -> Tally:
        """Return the figures of ``servo`` since the bus was made."""
        return self._tallies[servo]

    def listen(self, protocol: Protocol, size: int, extra: float = SECOND_REPLY_DELAY) -> None:
        """Wait for as long as a second servo with the same ID may take for a reply of ``size`` bytes of data.

        That is the longest return delay and ``extra`` seconds. Its reply counts in ``Tally.doubles``. Raises
        NotConnected.
        """
        codec = self._codecs[protocol]
        with self._lock:
            line = self._opened()
            reply = (codec.overhead + size) * 10 / self._baud
            until = self._clock.now() + reply + RETURN_DELAY + extra + self.latency
            try:
                while self._clock.now() < until:
                    self._overhear(line, codec, until)
            except NotConnected as error:
                self._release(error)
                raise

    # --- for the bus --------------------------------------------------------------------------------------------------

    def _transact(
        self, codec: Codec, request: Packet, wanted: Mapping[int, Wanted], *, wait: float = 0.0
    ) -> dict[int, Reply]:
        """Send a request once and return the replies of those who are ``wanted``, by ID; missing ones are missing.

        ``wait`` (seconds) is what the replies may take beyond the usual. Raises NotConnected, and BadRequest for what
        no packet can hold.
        """
        try:
            frame = codec.frame(request.id, request.code, request.parameters)
        except ValueError as error:
            raise BadRequest(f"{self.name}: {error}") from error
        with self._lock:
            line = self._opened()
            try:
                self._sweep(line, codec, wanted)
                sent = self._clock.now()
                line.send(frame)
                self._sent.append(request)
                # Only now: who was held up before the request had left would take the reply for late.
                leaving = max(self._clock.now(), self._used_until) + len(frame) * 10 / self._baud
                if not wanted:
                    self._use(sent, leaving)
                    return {}
                exchange = Exchange(codec, wanted, self._stray, self._sent)
                self._listen(line, exchange, leaving + wait)
            except NotConnected as error:
                self._release(error)
                raise
            self._account(exchange, wanted, sent, self._clock.now())
            return exchange.replies

    def _listen(self, line: Line, exchange: Exchange, begin: float) -> None:
        """Take what comes until all have answered, or the next reply should have come: the first from ``begin`` on."""
        parser = self._parsers[exchange.codec.protocol]
        deadline, over = begin + self._budget(exchange), False
        while exchange.missing:
            waiting = len(exchange.missing)
            heard = line.hear(deadline)
            for packet in parser.feed(heard):
                exchange.take(packet)
            if exchange.missing and len(exchange.missing) < waiting:
                deadline, over = max(deadline, self._clock.now() + self._budget(exchange)), False
            elif over or not heard:
                return
            elif exchange.missing:
                over = self._clock.now() >= deadline

    def _budget(self, exchange: Exchange) -> float:
        """Return the seconds that the next reply may take: ten bits a byte, the servo's delay, and our patience."""
        size = exchange.codec.overhead + next(iter(exchange.missing.values())).size
        return size * 10 / self._baud + RETURN_DELAY + self._patience + self.latency

    def _sweep(self, line: Line, codec: Codec, wanted: Mapping[int, Wanted]) -> None:
        """Take what has come since without being waited for; wait for what could be mistaken for what is ``wanted``."""
        self._overhear(line, codec, 0.0)
        for servo, want in wanted.items():
            while (until := self._overdue.until(servo, want)) > self._clock.now():
                self._overhear(line, codec, until)
        self._parsers[codec.protocol].reset()

    def _overhear(self, line: Line, codec: Codec, until: float) -> None:
        """Take what comes by ``until`` although nobody is asked."""
        if heard := line.hear(until):
            for packet in self._parsers[codec.protocol].feed(heard):
                if packet.intact and (reply := codec.reply(packet)) is not None and packet not in self._sent:
                    self._tallies[reply.id].doubles += not self._stray(reply)

    def _stray(self, reply: Reply) -> bool:
        """Take note of a reply that nobody waits for; return whether it is one that was overdue."""
        if overdue := self._overdue.came(reply.id, len(reply.data)):
            self._tallies[reply.id].late += 1
        return overdue

    def _account(self, exchange: Exchange, wanted: Mapping[int, Wanted], sent: float, now: float) -> None:
        """Enter what has become of a request into the figures of those who were to answer it."""
        self._use(sent, now)
        for servo in exchange.doubles:
            self._tallies[servo].doubles += 1
        if len(exchange.replies) == len(wanted):
            self.exchanges.add(now - sent)
        for servo, want in wanted.items():
            tally = self._tallies[servo]
            tally.tries += 1
            if reply := exchange.replies.get(servo):
                self._faults[servo] = reply.faults and reply.faults & ~REFUSAL
                tally.worst = max(tally.worst, now - sent)
                self._overdue.answered(servo, want)
                continue
            if servo in exchange.spoilt or (exchange.garbled and len(wanted) == 1):
                tally.corrupt += 1
            else:
                tally.misses += 1
            self._overdue.add(servo, want, now)  # what came damaged was perhaps not the reply

    def _use(self, begin: float, end: float) -> None:
        """Count the line as used from ``begin`` to ``end``; what overlaps counts once."""
        self._busy += max(0.0, end - max(begin, self._used_until))
        self._used_until = max(self._used_until, end)

    def _opened(self) -> Line:
        if self._line is None:
            raise NotConnected(str(self._trouble), hint=self._trouble.hint)
        return self._line

    def _release(self, why: NotConnected) -> None:
        with self._lock:
            line, self._line = self._line, None
            self._trouble = why
            if line is not None:
                line.close()
