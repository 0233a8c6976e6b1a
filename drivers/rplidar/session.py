"""Session with an RPLIDAR: stops an earlier scan, requests the info, checks the health, starts motor and scan."""

from collections.abc import Generator, Iterator
from math import inf
from struct import Struct

from drivers.api import DeviceStatus, StatusCallback
from drivers.clock import Clock
from drivers.errors import DeviceFault, NoReply
from drivers.rplidar import wire
from drivers.rplidar.models import MOTOR_PWM, RPLidarModel
from drivers.transport.link import SerialLink

SessionStep = Iterator[None]
"""Coroutine that executes the start of a scan; it is resumed at each poll until it ends."""

STOP_PAUSE = 0.1
"""Seconds to wait after a stop command, as the vendor's driver does; the protocol requires 1 ms."""

QUIET_TIME = 0.05
"""Seconds without a byte after which the line is quiet: adapters delay bytes by up to 16 ms."""

STOP_TIMEOUT = 1.0
"""Seconds without a quiet line after which the stop is sent again."""

REPLY_TIMEOUT = 0.5
"""Seconds until a request counts as unanswered."""

MAX_TRIES = 3
"""Maximum tries of a request: a byte may be lost on the wire."""

BOOT_TIME = 2.0
"""Seconds for which the RPLIDAR boots after a reset."""

MIN_EXPRESS_FIRMWARE = (1, 17)
"""First firmware with express scans."""

_BOARD = Struct("<I")


class RPLidarSession:
    """Session with an RPLIDAR, from the opening of the port on. All methods are called on the link's thread.

    ``info`` is the model and firmware, None until received. ``scanning_since`` is the start time of the scan, infinity
    before. ``is_express`` is True for an express scan, which has capsules and twice the sample rate. It is used if the
    firmware supports it, unless ``avoids_express`` is set.
    """

    def __init__(self, name: str, model: RPLidarModel, link: SerialLink, clock: Clock, report: StatusCallback) -> None:
        self.info: wire.RPLidarInfo | None = None
        self.scanning_since = inf
        self.is_express = self.avoids_express = False
        self._name = name
        self._model = model
        self._link = link
        self._clock = clock
        self._report = report
        self._has_pwm = False  # its board can set the duty cycle of the motor
        self._was_reset = False
        self._reported_faults: set[str] = set()
        self._buffer = bytearray()
        self._received_at = -inf
        self._steps: SessionStep = self._start_steps(0.0)

    def restart(self, delay: float) -> None:
        """Stop the scan, and start it again after ``delay`` seconds. Raises NotConnected if the port is gone."""
        self.scanning_since = inf
        self.stop()
        self._steps = self._start_steps(delay)

    def on_data(self, data: bytes) -> None:
        """Buffer received bytes."""
        self._received_at = self._clock.now()
        self._buffer += data

    def poll(self) -> bytes:
        """Continue the start of the scan; return the bytes of the scan that have arrived, none before its start.

        Raises NoReply if the device does not reply, DeviceFault if it reports a fault, NotConnected if the port is
        gone.
        """
        next(self._steps, None)
        if self.scanning_since == inf:
            return b""
        nodes = bytes(self._buffer)
        self._buffer.clear()
        return nodes

    def stop(self) -> None:
        """Stop the scan and the motor. Raises NotConnected if the port is gone."""
        self._link.write(wire.request(wire.RPLidarCommand.STOP))
        if self._has_pwm:
            self._link.write(wire.motor_request(0))
        self._link.set_dtr(on=True)

    # --- the beginning, step by step ----------------------------------------------------------------------------------

    def _start_steps(self, delay: float) -> SessionStep:
        yield from self._wait(delay)
        yield from self._quieten()
        info = yield from self._request(wire.request(wire.RPLidarCommand.INFO), wire.INFO_REPLY, 20)
        self._on_info(wire.RPLidarInfo.unpack(info))
        yield from self._check_health()
        yield from self._start_motor()
        self.is_express = yield from self._start_express()
        if not self.is_express:
            yield from self._request(wire.request(wire.RPLidarCommand.SCAN), wire.SCAN_REPLY, 0)
        self.scanning_since = self._clock.now()

    def _start_express(self) -> Generator[None, None, bool]:
        """Request an express scan, once; return whether it has started."""
        if self.avoids_express or self.info is None or self.info.firmware < MIN_EXPRESS_FIRMWARE:
            return False
        try:
            yield from self._request(wire.EXPRESS_REQUEST, wire.EXPRESS_REPLY, 0, tries=1)
        except NoReply:  # firmware of another vendor
            yield from self._quieten()
            return False
        return True

    def _quieten(self) -> SessionStep:
        """Stop a scan that an earlier program left running, and wait until no more bytes arrive."""
        while True:
            self._link.write(wire.request(wire.RPLidarCommand.STOP))
            began = self._clock.now()
            yield from self._wait(STOP_PAUSE)
            while self._clock.now() - began < STOP_TIMEOUT:
                if self._clock.now() - self._received_at >= QUIET_TIME:
                    self._buffer.clear()
                    return
                yield

    def _check_health(self) -> SessionStep:
        """Check the health; reset a device that is out of order, once."""
        while True:
            reply = yield from self._request(wire.request(wire.RPLidarCommand.HEALTH), wire.HEALTH_REPLY, 3)
            health = wire.RPLidarHealth.unpack(reply)
            if health.status < wire.RPLidarStatus.ERROR:
                if health.status == wire.RPLidarStatus.WARNING:
                    self._report_once(
                        f"it reports a warning, code {health.code}", "clean its window, check that it turns freely"
                    )
                return
            message = f"{self._prefix()}: it is out of order, code {health.code}"
            if self._was_reset:
                raise DeviceFault(f"{message}, and a reset did not help", hint="cut its power for a moment")
            self._was_reset = True
            self._report_once(f"it is out of order, code {health.code}: reset", "check that nothing blocks it")
            self._link.write(wire.request(wire.RPLidarCommand.RESET))
            yield from self._wait(BOOT_TIME)
            yield from self._quieten()

    def _start_motor(self) -> SessionStep:
        """Start the motor: by DTR on an A1, by PWM on an A2 if its board supports that."""
        if self._model.has_pwm and not self._has_pwm:
            try:
                reply = yield from self._request(wire.BOARD_REQUEST, wire.BOARD_REPLY, 4)
                self._has_pwm = bool(_BOARD.unpack(reply)[0] & 1)
            except NoReply:
                pass  # board of another vendor: DTR switches the motor, or it always turns
        self._link.set_dtr(on=False)
        if self._has_pwm:
            self._link.write(wire.motor_request(MOTOR_PWM))

    def _wait(self, seconds: float) -> SessionStep:
        end = self._clock.now() + seconds
        while self._clock.now() < end:
            yield

    def _request(
        self, request: bytes, descriptor: bytes, size: int, tries: int = MAX_TRIES
    ) -> Generator[None, None, bytes]:
        """Send a request; return the ``size`` bytes behind the descriptor of the reply. Raises NoReply."""
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
        raise self._no_reply_error(len(self._buffer))

    # --- words --------------------------------------------------------------------------------------------------------

    def _prefix(self) -> str:
        return f"{self._name}: {self._link.port}"

    def _no_reply_error(self, byte_count: int) -> NoReply:
        if byte_count:
            noise = f"{byte_count} bytes received at {self._link.baud} baud, none of them a reply of an RPLIDAR"
            return NoReply(
                f"{self._prefix()}: {noise}", hint=f"is it the right port? only A1 and A2 run at {wire.BAUD} baud"
            )
        return NoReply(
            f"{self._prefix()}: open but silent", hint="is the finder's own cable in its adapter? has it power?"
        )

    def _on_info(self, info: wire.RPLidarInfo) -> None:
        self.info = info
        if info.series != self._model.series:
            message = f"it is an A{info.series} (model {info.model:#x}), not an {self._model.name}"
            self._report_once(message, "set `model` in the robot file")

    def _report_once(self, message: str, hint: str) -> None:
        if message not in self._reported_faults:
            self._reported_faults.add(message)
            self._report(DeviceStatus(self._name, "fault", f"{self._prefix()}: {message}", hint))
