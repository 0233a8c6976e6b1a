"""An RPLIDAR at the level of its wire: turns, measures what is around it, and answers requests."""

from dataclasses import dataclass
from enum import IntEnum
from math import tau
from struct import Struct, error

import numpy as np
import numpy.typing as npt

from drivers.base.range_twin import NOISE
from drivers.rplidar import capsules, wire
from drivers.rplidar.declared import RPLidarKeys
from drivers.rplidar.models import MODELS, PWM, SAMPLES
from drivers.rplidar.nodes import TURN, Nodes, Words
from drivers.rplidar.session import EXPRESS_SINCE
from drivers.rplidar.wire import BAUD, Command, RequestFinder, Status
from drivers.sim.scanner import Look, looking
from drivers.sim.stage import Stage
from drivers.sim.world import World
from drivers.virtual.plugged import Plugged

RATES = Struct("<HH")
"""The reply to ``Command.RATES``: microseconds from one measurement to the next, plain and express."""

EXPRESS = Struct("<BHH")
"""The payload of ``Command.EXPRESS``: the way to scan by its number, flags, and a number of no use here."""


class Asked(IntEnum):
    """What ``Command.SETTING`` may ask for; all but the first two with the number of a way to scan."""

    COUNT = 0x70
    TYPICAL = 0x7C
    PERIOD = 0x71
    FARTHEST = 0x74
    FORM = 0x75
    NAME = 0x7F


@dataclass(frozen=True, slots=True)
class Mode:
    """A way to scan: microseconds for a measurement, metres that it sees, and the type of its answer."""

    name: str
    period: float
    farthest: float
    form: int

    def told(self, asked: int) -> bytes:
        """Return what it says of itself; nothing of what it does not know. Periods and metres in 1/256."""
        match asked:
            case Asked.PERIOD:
                return round(self.period * 256).to_bytes(4, "little")
            case Asked.FARTHEST:
                return round(self.farthest * 256).to_bytes(4, "little")
            case Asked.FORM:
                return bytes([self.form])
            case Asked.NAME:
                return self.name.encode() + b"\0"
        return b""


def setting(payload: bytes, modes: tuple[Mode, ...], typical: int) -> bytes:
    """Return what a finder with these ``modes`` answers to ``Command.SETTING``; nothing to what it does not know."""
    asked, number = int.from_bytes(payload[:4], "little"), int.from_bytes(payload[4:6], "little")
    if len(payload) < 4:
        return b""
    if asked in (Asked.COUNT, Asked.TYPICAL):
        told = (len(modes) if asked == Asked.COUNT else typical).to_bytes(2, "little")
    else:
        told = modes[number].told(asked) if len(payload) >= 6 and number < len(modes) else b""
    return payload[:4] + told if told else b""


QUALITY = 15
"""What it says of every measurement that came back."""

BOOT_TEXT = b"RP LIDAR System.\r\n"
"""Something of what it prints after a reset, which is no part of the protocol."""

BOOT = 0.5
"""Seconds that it hears nothing after a reset."""

MOST_AT_ONCE = 4096
"""Nodes that it sends at once at most: those of a terminal that has been asleep for longer are lost."""

SETTINGS_SINCE = (1, 24)
"""The firmware from which on it tells of its ways to scan."""

_SERIES_SHIFT = 4


class VirtualLidar:
    """A ``drivers.virtual.terminal.WireDevice``; ``look`` is what it sees, at bearings of the base.

    ``model`` is a key of ``MODELS``, ``yaw`` how it is turned on the base (radians). Each distance errs by ``noise``, a
    share of it (standard deviation), and is lost for the share ``dropouts`` of them, drawn from ``seed``. With
    ``streaming`` somebody left it scanning. A pseudo-terminal has no DTR: an A1 turns all the time, an A2 by ``pwm``.

    ``firmware`` is its version: from 1.17 on it has express scans, from 1.24 on it tells of its ways to scan.

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
        firmware: tuple[int, int] = (1, 29),
    ) -> None:
        self.model = MODELS[model]
        self.condition = wire.Condition(Status.GOOD)
        self.curable = True
        self.stuck = False
        self.mute = False
        self.streaming = streaming
        self.pwm = PWM if streaming or not self.model.pwm else 0
        self.requests: dict[int, int] = {}
        self._firmware = firmware
        self._express = self._forced = False
        self._modes = (
            Mode("Standard", 1e6 / SAMPLES, self.model.most, 0x81),
            Mode("Express", 1e6 / capsules.SAMPLES, self.model.most, 0x82),
        )
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
        several = capsules.COUNT if self._express else 1
        due = int((now - self._since) * self._samples / several) * several
        first, self._sent = max(self._sent, due - MOST_AT_ONCE), due
        if due <= first or not (self.turning or self._forced):
            return b""
        return (self._encapsulated if self._express else self._measure)(np.arange(first, due), now)

    @property
    def _samples(self) -> float:
        return capsules.SAMPLES if self._express else SAMPLES

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
                major, minor = self._firmware
                info = wire.Info(self.model.series << _SERIES_SHIFT | 8, minor, major, 7, bytes(range(16)))
                return wire.INFO_REPLY + info.pack()
            case Command.HEALTH:
                return wire.HEALTH_REPLY + self.condition.pack()
            case Command.BOARD if self.model.pwm:
                return wire.BOARD_REPLY + bytes([1, 0, 0, 0])
            case Command.SCAN | Command.FORCED if self._works or command == Command.FORCED:
                self._begin(now, forced=command == Command.FORCED)
                return wire.SCAN_REPLY
            case _ if self._firmware >= EXPRESS_SINCE:
                return self._obey_newer(command, payload, now)
        return b""

    def _obey_newer(self, command: int, payload: bytes, now: float) -> bytes:
        """Do what firmware 1.17 and 1.24 have learnt."""
        match command:
            case Command.EXPRESS if self._works and payload[:1] in (b"\0", b"\1"):
                self._begin(now, express=True)
                return wire.EXPRESS_REPLY
            case Command.RATES:
                return wire.RATES_REPLY + RATES.pack(*(round(mode.period) for mode in self._modes))
            case Command.SETTING if self._firmware >= SETTINGS_SINCE:
                told = setting(payload, self._modes, 1)
                return wire.setting_reply(told) if told else b""
        return b""

    @property
    def _works(self) -> bool:
        return self.condition.status != Status.ERROR

    def _begin(self, now: float, *, express: bool = False, forced: bool = False) -> None:
        self.streaming, self._since, self._sent = True, now, 0
        self._express, self._forced = express, forced

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
        new = np.floor(numbers * step) > np.floor((numbers - 1) * step)
        angle, distance = self._sampled(numbers, now)
        quality = np.where(distance == 0, 0, QUALITY).astype(np.uint8)
        return Nodes(new, quality, angle, distance).pack()

    def _encapsulated(self, numbers: npt.NDArray[np.int64], now: float) -> bytes:
        """Return the capsules of as many nodes; the first of a scan says so."""
        angle, distance = self._sampled(numbers, now)
        return b"".join(
            capsules.capsule(int(angle[at]), distance[at : at + capsules.COUNT], first=bool(numbers[at] == 0))
            for at in range(0, len(numbers), capsules.COUNT)
        )

    def _sampled(self, numbers: npt.NDArray[np.int64], now: float) -> tuple[Words, Words]:
        """Return angles and distances of the measurements with these numbers."""
        turns = numbers * (self.model.rate / self._samples) * self.turning
        angle = np.floor(turns % 1.0 * TURN)
        far = self._look(self._yaw - angle * (tau / TURN), now)
        far = far * (1 + self._noise * self._random.standard_normal(len(far)))
        lost = ~((far >= self.model.least) & (far <= self.model.most)) | (
            self._random.random(len(far)) < self._dropouts
        )
        return angle.astype(np.uint16), np.where(lost, 0, far * 4000).astype(np.uint16)


def make(keys: RPLidarKeys, stage: Stage) -> Plugged:
    """Return a virtual RPLIDAR, which sees the world from where the base truly is."""
    world = World() if stage.world is None else stage.world
    look = looking(world, keys.place, stage.pose, height=keys.position[2])
    return Plugged(VirtualLidar(look, model=keys.model, yaw=keys.yaw, seed=stage.seed), "rplidar")
