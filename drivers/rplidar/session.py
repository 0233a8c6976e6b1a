"""How a finder is brought to scan: silenced first, whatever it was doing, then asked who it is and how it feels."""

from collections.abc import Generator, Iterator
from math import inf
from struct import Struct

from drivers.api import DeviceStatus, Report
from drivers.clock import Clock
from drivers.errors import DeviceFault, NoReply
from drivers.rplidar import wire
from drivers.rplidar.models import PWM, Model
from drivers.transport.link import Link

Step = Iterator[None]
"""A part of the beginning that goes on each time it is resumed, until it is done."""

STOP_PAUSE = 0.1
"""Seconds that the maker's driver gives it to stop; 1 ms is what the protocol asks for."""

SILENCE = 0.05
"""Seconds without a byte after which the line is clear: adapters hold bytes back for up to 16 ms."""

STUBBORN = 1.0
"""Seconds of noise after which it is told to stop again."""

REPLY_TIMEOUT = 0.5
"""Seconds that it has for an answer."""

TRIES = 3
"""How often it is asked the same: a byte may be lost on the wire."""

BOOT = 2.0
"""Seconds that it has to start anew after a reset."""

EXPRESS_SINCE = (1, 17)
"""The firmware from which on there are express scans."""

_BOARD = Struct("<I")


class Session:
    """One connection to a finder, from the opening of the port on. Served by the link's thread.

    ``info`` is what it says that it is, once it has. ``since`` is when its nodes began to come; infinity before. They
    come in capsules where the scan is ``express``: twice as many, where its firmware has that, and unless it is to be
    ``plain``.
    """

    def __init__(self, name: str, model: Model, link: Link, clock: Clock, report: Report) -> None:
        self.info: wire.Info | None = None
        self.since = inf
        self.express = self.plain = False
        self._name = name
        self._model = model
        self._link = link
        self._clock = clock
        self._report = report
        self._pwm = False  # its board sets the pulse width of the motor
        self._was_reset = False
        self._told: set[str] = set()
        self._buffer = bytearray()
        self._heard_at = -inf
        self._steps: Step = self._begin(0.0)

    def again(self, delay: float) -> None:
        """Stop, and begin once more in ``delay`` seconds. Raises NotConnected when the port has gone."""
        self.since = inf
        self.stop()
        self._steps = self._begin(delay)

    def received(self, data: bytes) -> None:
        """Take bytes."""
        self._heard_at = self._clock.now()
        self._buffer += data

    def pulse(self) -> bytes:
        """Go on as far as is possible now; return the bytes of nodes that have come.

        Raises NoReply when it does not answer, DeviceFault when it does not work, NotConnected when the port has gone.
        """
        next(self._steps, None)
        if self.since == inf:
            return b""
        nodes = bytes(self._buffer)
        self._buffer.clear()
        return nodes

    def stop(self) -> None:
        """End the scan and the turning. Raises NotConnected when the port has gone."""
        self._link.write(wire.request(wire.Command.STOP))
        if self._pwm:
            self._link.write(wire.motor(0))
        self._link.set_dtr(on=True)

    # --- the beginning, step by step ----------------------------------------------------------------------------------

    def _begin(self, delay: float) -> Step:
        yield from self._wait(delay)
        yield from self._silence()
        info = yield from self._ask(wire.request(wire.Command.INFO), wire.INFO_REPLY, 20)
        self._meet(wire.Info.unpack(info))
        yield from self._examine()
        yield from self._start_motor()
        self.express = yield from self._express()
        if not self.express:
            yield from self._ask(wire.request(wire.Command.SCAN), wire.SCAN_REPLY, 0)
        self.since = self._clock.now()

    def _express(self) -> Generator[None, None, bool]:
        """Ask for an express scan, once; return whether it has begun."""
        if self.plain or self.info is None or self.info.firmware < EXPRESS_SINCE:
            return False
        try:
            yield from self._ask(wire.EXPRESS, wire.EXPRESS_REPLY, 0, tries=1)
        except NoReply:  # a firmware of another maker
            yield from self._silence()
            return False
        return True

    def _silence(self) -> Step:
        """Stop what it is sending since whoever talked to it last, and let the rest of it go by."""
        while True:
            self._link.write(wire.request(wire.Command.STOP))
            began = self._clock.now()
            yield from self._wait(STOP_PAUSE)
            while self._clock.now() - began < STUBBORN:
                if self._clock.now() - self._heard_at >= SILENCE:
                    self._buffer.clear()
                    return
                yield

    def _examine(self) -> Step:
        """Ask how it feels; one that is out of order is reset, once."""
        while True:
            reply = yield from self._ask(wire.request(wire.Command.HEALTH), wire.HEALTH_REPLY, 3)
            found = wire.Condition.unpack(reply)
            if found.status < wire.Status.ERROR:
                if found.status == wire.Status.WARNING:
                    self._tell(f"it warns of trouble, code {found.code}", "clean its window, see that it turns freely")
                return
            what = f"{self._who()}: it is out of order, code {found.code}"
            if self._was_reset:
                raise DeviceFault(f"{what}, and a reset did not help", hint="take its power away for a moment")
            self._was_reset = True
            self._tell(f"it is out of order, code {found.code}: reset", "see that nothing blocks it")
            self._link.write(wire.request(wire.Command.RESET))
            yield from self._wait(BOOT)
            yield from self._silence()

    def _start_motor(self) -> Step:
        """Turn: an A1 whenever DTR is off, an A2 by pulse width where its board can set that."""
        if self._model.pwm and not self._pwm:
            try:
                reply = yield from self._ask(wire.BOARD, wire.BOARD_REPLY, 4)
                self._pwm = bool(_BOARD.unpack(reply)[0] & 1)
            except NoReply:
                pass  # a board of another maker: DTR switches the motor, or it always turns
        self._link.set_dtr(on=False)
        if self._pwm:
            self._link.write(wire.motor(PWM))

    def _wait(self, seconds: float) -> Step:
        end = self._clock.now() + seconds
        while self._clock.now() < end:
            yield

    def _ask(self, request: bytes, descriptor: bytes, size: int, tries: int = TRIES) -> Generator[None, None, bytes]:
        """Send a request; return the ``size`` bytes behind the descriptor of its answer. Raises NoReply."""
        for _ in range(tries):
            self._link.write(request)
            end = self._clock.now() + REPLY_TIMEOUT
            while self._clock.now() < end:
                start = self._buffer.find(descriptor)
                stop = start + len(descriptor) + size
                if start >= 0 and len(self._buffer) >= stop:
                    reply = bytes(self._buffer[stop - size : stop])
                    del self._buffer[:stop]
                    return reply
                yield
        raise self._unanswered(len(self._buffer))

    # --- words --------------------------------------------------------------------------------------------------------

    def _who(self) -> str:
        return f"{self._name}: {self._link.port}"

    def _unanswered(self, heard: int) -> NoReply:
        if heard:
            noise = f"{heard} bytes heard at {self._link.baud} baud, none of them an answer of an RPLIDAR"
            return NoReply(
                f"{self._who()}: {noise}", hint=f"is it the right port? only A1 and A2 run at {wire.BAUD} baud"
            )
        return NoReply(
            f"{self._who()}: open but silent", hint="is the finder's own cable in its adapter? has it power?"
        )

    def _meet(self, info: wire.Info) -> None:
        self.info = info
        if info.series != self._model.series:
            what = f"it is an A{info.series} (model {info.model:#x}), not an {self._model.name}"
            self._tell(what, "set `model` in the robot file")

    def _tell(self, what: str, hint: str) -> None:
        """Report a fault, once in a connection."""
        if what not in self._told:
            self._told.add(what)
            self._report(DeviceStatus(self._name, "fault", f"{self._who()}: {what}", hint))
