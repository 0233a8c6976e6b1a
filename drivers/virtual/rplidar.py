"""An RPLIDAR at the level of its wire: turns, measures what is around it, and answers requests."""

from math import tau
from struct import error

import numpy as np
import numpy.typing as npt

from drivers.rplidar import wire
from drivers.rplidar.models import MODELS, PWM, SAMPLES
from drivers.rplidar.nodes import TURN, Nodes
from drivers.rplidar.wire import BAUD, Command, RequestFinder, Status
from drivers.sim.scanner import Look
from drivers.sim.twins.ranger import NOISE

QUALITY = 15
"""What it says of every measurement that came back."""

BOOT_TEXT = b"RP LIDAR System.\r\n"
"""Something of what it prints after a reset, which is no part of the protocol."""

BOOT = 0.5
"""Seconds that it hears nothing after a reset."""

MOST_AT_ONCE = 4096
"""Nodes that it sends at once at most: those of a terminal that has been asleep for longer are lost."""

_SERIES_SHIFT = 4


class VirtualLidar:
    """A ``drivers.virtual.terminal.WireDevice``; ``look`` is what it sees, at bearings of the base.

    ``model`` is a key of ``MODELS``, ``yaw`` how it is turned on the base (radians). Each distance errs by ``noise``, a
    share of it (standard deviation), and is lost for the share ``dropouts`` of them, drawn from ``seed``. With
    ``streaming`` somebody left it scanning. A pseudo-terminal has no DTR: an A1 turns all the time, an A2 by ``pwm``.

    What is set from outside, at any time: ``condition``, what it says of its health; ``curable``, that a reset makes
    that good; ``stuck``: the motor does not turn, so nothing is measured; ``mute``: it hears nothing.
    ``requests`` counts what it was asked.
    """

    def __init__(
        self,
        look: Look,
        *,
        model: str = "a1",
        yaw: float = 0.0,
        noise: float = NOISE,
        dropouts: float = 0.0,
        seed: int = 0,
        streaming: bool = False,
    ) -> None:
        self.model = MODELS[model]
        self.condition = wire.Condition(Status.GOOD)
        self.curable = True
        self.stuck = False
        self.mute = False
        self.streaming = streaming
        self.pwm = PWM if streaming or not self.model.pwm else 0
        self.requests: dict[int, int] = {}
        self._look = look
        self._yaw = yaw
        self._noise = noise
        self._dropouts = dropouts
        self._random = np.random.default_rng(seed)
        self._requests = RequestFinder()
        self._since = 0.0  # when the scan began
        self._sent = 0  # nodes since then
        self._awake = 0.0

    @property
    def baud(self) -> int:
        """The rate it listens at."""
        return BAUD

    @property
    def turning(self) -> bool:
        """Whether its motor turns."""
        return self.pwm > 0 and not self.stuck

    def feed(self, data: bytes, now: float) -> bytes:
        """Take requests; return the answers. While it scans it hears only STOP and RESET, and what sets the motor."""
        if self.mute or now < self._awake:
            return b""
        return b"".join(self._obey(command, payload, now) for command, payload in self._requests.feed(data))

    def poll(self, now: float) -> bytes:
        """Return the nodes that were measured by ``now``."""
        if not self.streaming:
            return b""
        due = int((now - self._since) * SAMPLES)
        first, self._sent = max(self._sent, due - MOST_AT_ONCE), due
        return self._measure(np.arange(first, due), now) if due > first and self.turning else b""

    def _obey(self, command: int, payload: bytes, now: float) -> bytes:
        self.requests[command] = self.requests.get(command, 0) + 1
        match command:
            case Command.STOP:
                self.streaming = False
            case Command.RESET:
                return self._restart(now)
            case Command.PWM:
                self._set_motor(payload)
            case _ if self.streaming:
                pass
            case Command.INFO:
                info = wire.Info(self.model.series << _SERIES_SHIFT | 8, 29, 1, 7, bytes(range(16)))
                return wire.INFO_REPLY + info.pack()
            case Command.HEALTH:
                return wire.HEALTH_REPLY + self.condition.pack()
            case Command.BOARD if self.model.pwm:
                return wire.BOARD_REPLY + bytes([1, 0, 0, 0])
            case Command.SCAN if self.condition.status != Status.ERROR:
                self.streaming, self._since, self._sent = True, now, 0
                return wire.SCAN_REPLY
        return b""

    def _restart(self, now: float) -> bytes:
        self.streaming = False
        self._awake = now + BOOT
        if self.curable:
            self.condition = wire.Condition(Status.GOOD)
        return BOOT_TEXT

    def _set_motor(self, payload: bytes) -> None:
        if self.model.pwm:
            try:
                self.pwm = wire.pwm_of(payload)
            except error:
                return  # as the board does with a request of another length

    def _measure(self, numbers: npt.NDArray[np.int64], now: float) -> bytes:
        """Return the nodes with these numbers, counted from the beginning of the scan."""
        step = self.model.rate / SAMPLES
        turns = numbers * step
        angle = np.floor(turns % 1.0 * TURN)
        new = np.floor(turns) > np.floor((numbers - 1) * step)
        far = self._look(self._yaw - angle * (tau / TURN), now)
        far = far * (1 + self._noise * self._random.standard_normal(len(far)))
        lost = ~((far >= self.model.least) & (far <= self.model.most)) | (
            self._random.random(len(far)) < self._dropouts
        )
        distance = np.where(lost, 0, far * 4000)
        quality = np.where(lost, 0, QUALITY)
        return Nodes(new, quality.astype(np.uint8), angle.astype(np.uint16), distance.astype(np.uint16)).pack()
