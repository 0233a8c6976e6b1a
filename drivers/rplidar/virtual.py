"""Virtual RPLIDAR at wire level: rotates, measures the simulated world, and replies to requests."""

from dataclasses import dataclass
from enum import IntEnum
from math import tau
from struct import Struct, error

import numpy as np
import numpy.typing as npt

from drivers.base.range_twin import NOISE
from drivers.rplidar import capsules, wire
from drivers.rplidar.declared import RPLidarKeys
from drivers.rplidar.models import MODELS, MOTOR_PWM, SAMPLE_RATE
from drivers.rplidar.nodes import STEPS_PER_TURN, Nodes, Words
from drivers.rplidar.session import MIN_EXPRESS_FIRMWARE
from drivers.rplidar.wire import BAUD, RequestFinder, RPLidarCommand, RPLidarStatus
from drivers.sim.context import SimContext
from drivers.sim.scanner import RangeFunction, make_range_function
from drivers.sim.world import SimulatedWorld
from drivers.virtual.device import VirtualDevice

SAMPLE_RATES = Struct("<HH")
"""Format of the reply to ``RPLidarCommand.SAMPLE_RATES``: microseconds per measurement, plain and express."""

EXPRESS_PAYLOAD = Struct("<BHH")
"""Format of the payload of ``RPLidarCommand.EXPRESS``: number of the scan mode, flags, and an unused number."""


class ScanModeSetting(IntEnum):
    """Settings that ``RPLidarCommand.SETTING`` queries. All but the first two belong to a scan mode.

    The query then has the number of the scan mode.
    """

    COUNT = 0x70
    TYPICAL = 0x7C
    PERIOD = 0x71
    MAX_RANGE = 0x74
    ANSWER_TYPE = 0x75
    NAME = 0x7F


@dataclass(frozen=True, slots=True)
class ScanMode:
    """Scan mode: microseconds per measurement, maximum range in metres, and the type of its reply."""

    name: str
    period: float
    max_range: float
    answer_type: int

    def setting_value(self, setting: int) -> bytes:
        """Return a setting of this scan mode as bytes; empty for an unknown setting.

        Period (microseconds) and range (metres) are in units of 1/256.
        """
        match setting:
            case ScanModeSetting.PERIOD:
                return round(self.period * 256).to_bytes(4, "little")
            case ScanModeSetting.MAX_RANGE:
                return round(self.max_range * 256).to_bytes(4, "little")
            case ScanModeSetting.ANSWER_TYPE:
                return bytes([self.answer_type])
            case ScanModeSetting.NAME:
                return self.name.encode() + b"\0"
        return b""


def answer_setting(payload: bytes, modes: tuple[ScanMode, ...], typical: int) -> bytes:
    """Return the payload of the reply to ``RPLidarCommand.SETTING``; empty if the setting is unknown.

    ``modes`` are the scan modes, ``typical`` is the number of the recommended one.
    """
    setting, number = int.from_bytes(payload[:4], "little"), int.from_bytes(payload[4:6], "little")
    if len(payload) < 4:
        return b""
    if setting in (ScanModeSetting.COUNT, ScanModeSetting.TYPICAL):
        value = (len(modes) if setting == ScanModeSetting.COUNT else typical).to_bytes(2, "little")
    else:
        value = modes[number].setting_value(setting) if len(payload) >= 6 and number < len(modes) else b""
    return payload[:4] + value if value else b""


NODE_QUALITY = 15
"""Quality of every measurement of the virtual RPLIDAR that has an echo."""

BOOT_TEXT = b"RP LIDAR System.\r\n"
"""Part of the text that the device prints after a reset, outside of the protocol."""

BOOT_TIME = 0.5
"""Seconds after a reset in which the device ignores requests."""

MAX_NODES_PER_POLL = 4096
"""Maximum number of nodes that a poll returns.

Older ones are lost, such as after the terminal was suspended.
"""

MIN_SETTINGS_FIRMWARE = (1, 24)
"""First firmware that replies to queries of scan modes."""

_SERIES_SHIFT = 4


class VirtualRPLidar:
    """Virtual RPLIDAR: a ``drivers.virtual.terminal.WireDevice``. ``look`` returns the distances at given bearings.

    ``model`` is a key of ``MODELS``, ``yaw`` the mounting angle on the base (radians). Each distance has an error of
    the standard deviation ``noise``, as a share of it, and is lost with the probability ``dropout_share``, drawn from
    ``seed``. With ``streaming`` an earlier program has left the scan running. ``firmware`` is the version: from 1.17 on
    with express scans, from 1.24 on with queries of scan modes. A pseudo-terminal has no DTR, so the motor of an A1
    always turns; that of an A2 turns while ``pwm`` is not 0.

    These attributes may be set at any time to simulate faults. ``condition`` is the reported health,
    ``is_fixed_by_reset`` whether a reset makes it good again. With ``is_stuck`` the motor does not turn, so there are
    no measurements. With ``is_deaf`` requests are ignored. ``requests`` counts the received requests by command.
    """

    def __init__(
        self,
        look: RangeFunction,
        *,
        model: str = "a1",
        yaw: float = 0.0,
        noise: float = NOISE,
        dropout_share: float = 0.0,
        seed: int = 0,
        streaming: bool = False,
        firmware: tuple[int, int] = (1, 29),
    ) -> None:
        self.model = MODELS[model]
        self.condition = wire.RPLidarHealth(RPLidarStatus.GOOD)
        self.is_fixed_by_reset = True
        self.is_stuck = False
        self.is_deaf = False
        self.streaming = streaming
        self.pwm = MOTOR_PWM if streaming or not self.model.has_pwm else 0
        self.requests: dict[int, int] = {}
        self._firmware = firmware
        self._express = self._forced = False
        self._modes = (
            ScanMode("Standard", 1e6 / SAMPLE_RATE, self.model.max_range, 0x81),
            ScanMode("Express", 1e6 / capsules.EXPRESS_SAMPLE_RATE, self.model.max_range, 0x82),
        )
        self._look = look
        self._yaw = yaw
        self._noise = noise
        self._dropouts = dropout_share
        self._random = np.random.default_rng(seed)
        self._requests = RequestFinder()
        self._since = 0.0  # when the scan began
        self._sent = 0  # nodes since then
        self._booted_at = 0.0

    @property
    def baud(self) -> int:
        """Baud rate."""
        return BAUD

    @property
    def is_turning(self) -> bool:
        """Whether the motor turns."""
        return self.pwm > 0 and not self.is_stuck

    def feed(self, data: bytes, now: float) -> bytes:
        """Handle requests; return the replies. During a scan only STOP, RESET and the motor's PWM are handled."""
        if self.is_deaf or now < self._booted_at:
            return b""
        return b"".join(self._execute(command, payload, now) for command, payload in self._requests.feed(data))

    def poll(self, now: float) -> bytes:
        """Return the nodes or capsules that were measured since the last poll, until ``now``."""
        if not self.streaming:
            return b""
        several = capsules.CAPSULE_NODES if self._express else 1
        due = int((now - self._since) * self._sample_rate / several) * several
        first, self._sent = max(self._sent, due - MAX_NODES_PER_POLL), due
        if due <= first or not (self.is_turning or self._forced):
            return b""
        return (self._measure_capsules if self._express else self._measure)(np.arange(first, due), now)

    @property
    def _sample_rate(self) -> float:
        return capsules.EXPRESS_SAMPLE_RATE if self._express else SAMPLE_RATE

    def _execute(self, command: int, payload: bytes, now: float) -> bytes:
        self.requests[command] = self.requests.get(command, 0) + 1
        match command:
            case RPLidarCommand.STOP:
                self.streaming = False
            case RPLidarCommand.RESET:
                return self._restart(now)
            case RPLidarCommand.PWM:
                self._set_motor(payload)
            case _ if self.streaming:
                pass
            case RPLidarCommand.INFO:
                major, minor = self._firmware
                info = wire.RPLidarInfo(self.model.series << _SERIES_SHIFT | 8, minor, major, 7, bytes(range(16)))
                return wire.INFO_REPLY + info.pack()
            case RPLidarCommand.HEALTH:
                return wire.HEALTH_REPLY + self.condition.pack()
            case RPLidarCommand.BOARD if self.model.has_pwm:
                return wire.BOARD_REPLY + bytes([1, 0, 0, 0])
            case RPLidarCommand.SCAN | RPLidarCommand.FORCE_SCAN if (
                self._is_working or command == RPLidarCommand.FORCE_SCAN
            ):
                self._begin(now, forced=command == RPLidarCommand.FORCE_SCAN)
                return wire.SCAN_REPLY
            case _ if self._firmware >= MIN_EXPRESS_FIRMWARE:
                return self._execute_newer(command, payload, now)
        return b""

    def _execute_newer(self, command: int, payload: bytes, now: float) -> bytes:
        """Return the reply to a command that firmware 1.17 or 1.24 has added; empty for other commands."""
        match command:
            case RPLidarCommand.EXPRESS if self._is_working and payload[:1] in (b"\0", b"\1"):
                self._begin(now, express=True)
                return wire.EXPRESS_REPLY
            case RPLidarCommand.SAMPLE_RATES:
                return wire.RATES_REPLY + SAMPLE_RATES.pack(*(round(mode.period) for mode in self._modes))
            case RPLidarCommand.SETTING if self._firmware >= MIN_SETTINGS_FIRMWARE:
                reply = answer_setting(payload, self._modes, 1)
                return wire.setting_reply(reply) if reply else b""
        return b""

    @property
    def _is_working(self) -> bool:
        return self.condition.status != RPLidarStatus.ERROR

    def _begin(self, now: float, *, express: bool = False, forced: bool = False) -> None:
        self.streaming, self._since, self._sent = True, now, 0
        self._express, self._forced = express, forced

    def _restart(self, now: float) -> bytes:
        self.streaming = False
        self._booted_at = now + BOOT_TIME
        if self.is_fixed_by_reset:
            self.condition = wire.RPLidarHealth(RPLidarStatus.GOOD)
        return BOOT_TEXT

    def _set_motor(self, payload: bytes) -> None:
        if self.model.has_pwm:
            try:
                self.pwm = wire.unpack_pwm(payload)
            except error:
                return  # as the board does with a payload of another length

    def _measure(self, numbers: npt.NDArray[np.int64], now: float) -> bytes:
        """Return the nodes with these numbers, counted from the start of the scan."""
        step = self.model.turn_rate / SAMPLE_RATE
        new = np.floor(numbers * step) > np.floor((numbers - 1) * step)
        angle, distance = self._sample(numbers, now)
        quality = np.where(distance == 0, 0, NODE_QUALITY).astype(np.uint8)
        return Nodes(new, quality, angle, distance).pack()

    def _measure_capsules(self, numbers: npt.NDArray[np.int64], now: float) -> bytes:
        """Return the capsules of these measurements; the first of a scan is marked."""
        angle, distance = self._sample(numbers, now)
        return b"".join(
            capsules.pack_capsule(
                int(angle[at]), distance[at : at + capsules.CAPSULE_NODES], first=bool(numbers[at] == 0)
            )
            for at in range(0, len(numbers), capsules.CAPSULE_NODES)
        )

    def _sample(self, numbers: npt.NDArray[np.int64], now: float) -> tuple[Words, Words]:
        """Return angles and distances of the measurements with these numbers."""
        turns = numbers * (self.model.turn_rate / self._sample_rate) * self.is_turning
        angle = np.floor(turns % 1.0 * STEPS_PER_TURN)
        distances = self._look(self._yaw - angle * (tau / STEPS_PER_TURN), now)
        distances = distances * (1 + self._noise * self._random.standard_normal(len(distances)))
        lost = ~((distances >= self.model.min_range) & (distances <= self.model.max_range)) | (
            self._random.random(len(distances)) < self._dropouts
        )
        return angle.astype(np.uint16), np.where(lost, 0, distances * 4000).astype(np.uint16)


def make(keys: RPLidarKeys, context: SimContext) -> VirtualDevice:
    """Return a virtual RPLIDAR, which sees the world from the true pose of the base."""
    world = SimulatedWorld() if context.world is None else context.world
    look = make_range_function(world, keys.place, context.pose, height=keys.position[2])
    return VirtualDevice(VirtualRPLidar(look, model=keys.model, yaw=keys.yaw, seed=context.seed), "rplidar")
