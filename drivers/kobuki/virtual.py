"""Virtual Kobuki at wire level: executes commands, drives its wheels, and reports 50 times per second."""

from collections.abc import Iterable
from math import degrees
from threading import RLock

from drivers.api import Lamp, Pose2D, Sides, Tune
from drivers.kobuki import commands, feedback
from drivers.kobuki.commands import (
    COMMANDS,
    OUTPUTS_AT_START,
    BaseControl,
    Extra,
    GetGains,
    KobukiOutput,
    KobukiSound,
    RequestExtra,
    SetGains,
    SetOutputs,
    SoundSequence,
)
from drivers.kobuki.declared import KobukiKeys
from drivers.kobuki.wire import BAUD, MAX_PAYLOAD, KobukiFrameFinder, KobukiSubpayload, decode, frame, subpayload
from drivers.sim.base_body import BaseBody, merge_sides
from drivers.sim.battery import Battery
from drivers.sim.context import SimContext
from drivers.sim.wheels import DelayLine, SimulatedWheels
from drivers.sim.world_objects import Ground
from drivers.virtual.device import VirtualDevice, make_virtual_base

REPORT_INTERVAL = 0.02
"""Seconds between two reports of the virtual Kobuki."""

FULL_SPEED = 0.7
"""Speed of a wheel in m/s at full pulse width."""

FLOOR, NO_FLOOR = 2000, 100
"""Reading of a floor sensor with the floor beneath it, and without."""

UNKNOWN_ID = 0x63

BUTTONS = (0, 1, 2)

NOTE_STEP = 2.75e-6
"""Seconds of one step of a note's period."""

OVERLOADED_LEFT, OVERLOADED_RIGHT = 1, 2

GAINS_SINCE = (1, 2, 0)
"""First firmware version with commands for the gains of the wheel controller."""


class VirtualKobuki:
    """Virtual Kobuki: a ``drivers.virtual.terminal.WireDevice``. Thread-safe.

    Its contacts are those of its ``body`` on the ground, and those that a test sets at any time: ``bumper``, ``cliff``,
    ``wheel_drop`` (no centre), ``buttons`` (of ``BUTTONS``). ``sockets`` are the values of its input sockets.
    ``battery_voltage`` and ``charger`` (as in ``feedback.Charger``) replace the simulated values of battery and dock
    unless they are None. ``gyro_offset`` in radians is the gyro's angle at the heading 0; ``late`` delays all reports.
    To simulate faults of the firmware, set ``frozen`` (no reports are sent), ``shortened`` (the ID of a part whose last
    byte is left out) or ``chatty`` (reports have an unknown part). ``played`` lists the received tunes and tones
    (hertz, seconds), ``outputs`` is the last output word.
    """

    def __init__(
        self,
        *,
        wheels: SimulatedWheels | None = None,
        ground: Ground | None = None,
        battery: Battery | None = None,
        firmware: tuple[int, int, int] = (1, 2, 0),
    ) -> None:
        self.body = BaseBody(wheels=wheels, ground=ground, battery=battery)
        self.wheels = self.body.wheels
        self.bumper = self.cliff = self.wheel_drop = Sides()
        self.buttons: frozenset[int] = frozenset()
        self.sockets = feedback.Inputs()
        self.battery_voltage: float | None = None
        self.charger: int | None = None
        self.gyro_offset = 0.0
        self.frozen = False
        self.late: DelayLine[bytes] = DelayLine()
        self.shortened: int | None = None
        self.chatty = False
        self.played: list[Tune | tuple[float, float]] = []
        self.outputs = int(OUTPUTS_AT_START)
        self.gains = feedback.KobukiGains()
        self._firmware = firmware
        self._finder = KobukiFrameFinder()
        self._answers: list[KobukiSubpayload] = []
        self._started_at = self._next_at = 0.0
        self._reports = self._samples = 0
        self._lock = RLock()

    @property
    def baud(self) -> int:
        """Baud rate."""
        return BAUD

    def feed(self, data: bytes, now: float) -> bytes:
        """Handle commands; replies are sent with the next report, so the result is empty."""
        with self._lock:
            self.body.advance(now)
            for payload in self._finder.feed(data):
                for command in decode(payload, COMMANDS).parts:
                    self._execute(command, now)
        return b""

    def poll(self, now: float) -> bytes:
        """Return the reports that are due by ``now``; the first call switches the base on."""
        with self._lock:
            if self._reports == 0:
                self._started_at = self._next_at = now
            while self._next_at <= now:
                self.body.advance(self._next_at)
                self.late.put(self._next_at, self._report(self._next_at))
                self._reports += 1
                self._next_at = self._started_at + self._reports * REPORT_INTERVAL
            return b"".join(self.late.pop_due(now))

    def next_poll_time(self) -> float | None:
        """Return the time of the next report; None before the base is switched on."""
        with self._lock:
            return self._next_at if self._reports else None

    def press(self, number: int, *, down: bool = True) -> None:
        """Press or release a button. Raises ValueError for an unknown button."""
        if number not in BUTTONS:
            raise ValueError(f"kobuki: no button {number}, only {BUTTONS}")
        self.buttons = self.buttons | {number} if down else self.buttons - {number}

    @property
    def lights(self) -> dict[int, Lamp]:
        """Colours of the two lights."""
        word = KobukiOutput(self.outputs)
        return {
            1: _lamp(KobukiOutput.LED1_RED in word, KobukiOutput.LED1_GREEN in word),
            2: _lamp(KobukiOutput.LED2_RED in word, KobukiOutput.LED2_GREEN in word),
        }

    def pose(self, now: float) -> Pose2D:
        """Return the true pose of the base at time ``now``."""
        with self._lock:
            return self.body.advance(now)

    def _execute(self, command: KobukiSubpayload, now: float) -> None:
        match command:
            case BaseControl():
                self.body.command(*command.velocity, now)
            case RequestExtra(flags=flags):
                self._answers += self._extras(flags)
            case SetOutputs(word=word):
                self.outputs = word
            case SoundSequence(tune=tune) if tune in list(commands.KobukiTune):
                self.played.append(Tune[commands.KobukiTune(tune).name])
            case KobukiSound(note=note, duration_ms=milliseconds) if note:
                self.played.append((1 / (note * NOTE_STEP), milliseconds / 1000))
            case SetGains(user=user) if self._firmware >= GAINS_SINCE:
                self.gains = (
                    feedback.KobukiGains(user, command.p_thousandths, command.i_thousandths, command.d_thousandths)
                    if user
                    else feedback.KobukiGains()
                )
            case GetGains() if self._firmware >= GAINS_SINCE:
                self._answers.append(self.gains)
            case _:
                pass  # unknown commands are ignored

    def _extras(self, flags: int) -> Iterable[KobukiSubpayload]:
        if flags & Extra.HARDWARE:
            yield feedback.HardwareVersion(patch=4, minor=0, major=1)
        if flags & Extra.FIRMWARE:
            major, minor, patch = self._firmware
            yield feedback.FirmwareVersion(patch, minor, major)
        if flags & Extra.UNIQUE_ID:
            yield feedback.UniqueId(0x4B6F6275, 0x6B690000, 0x00000001)

    def _report(self, now: float) -> bytes:
        """Return a frame with all sensor values at ``now``, and as many pending replies as fit."""
        if self.frozen:
            return b""
        parts = [
            self._core(now),
            self._dock(),
            self._inertia(now),
            self._floor(),
            self._currents(),
            self._gyro(),
            self.sockets,
        ]
        payload = b"".join(self._subpayload(part) for part in parts)
        payload += subpayload(UNKNOWN_ID, b"\x01\x02") if self.chatty else b""
        while self._answers and len(payload + (answer := self._subpayload(self._answers[0]))) <= MAX_PAYLOAD:
            payload += answer
            del self._answers[0]
        return frame(payload)

    def _subpayload(self, part: KobukiSubpayload) -> bytes:
        data = part.pack()
        return subpayload(part.ID, data[:-1] if self.shortened == part.ID else data)

    def _core(self, now: float) -> feedback.Core:
        left, right = self.wheels.speeds
        left_encoder, right_encoder = self.body.encoders
        wheel_drop = merge_sides(self.wheel_drop, self.body.wheel_drop)
        overcurrent, voltage = self.body.overcurrent, self.battery_voltage
        return feedback.Core(
            time_ms=round(1000 * (now - self._started_at)) & 0xFFFF,
            bumper=_bits(merge_sides(self.bumper, self.body.bumper)),
            wheel_drop=(feedback.DROPPED_LEFT if wheel_drop.left else 0)
            | (feedback.DROPPED_RIGHT if wheel_drop.right else 0),
            cliff=_bits(merge_sides(self.cliff, self.body.cliff)),
            left_encoder=left_encoder & 0xFFFF,
            right_encoder=right_encoder & 0xFFFF,
            left_pwm=_clip(0x7F * left / FULL_SPEED, 0x7F),
            right_pwm=_clip(0x7F * right / FULL_SPEED, 0x7F),
            buttons=sum(1 << number for number in self.buttons),
            charger=self._charger() if self.charger is None else self.charger,
            battery_decivolts=round(10 * (self.body.battery.voltage if voltage is None else voltage)),
            overcurrent=(OVERLOADED_LEFT if overcurrent.left else 0) | (OVERLOADED_RIGHT if overcurrent.right else 0),
        )

    def _charger(self) -> int:
        charger = feedback.Charger
        if not self.body.docked:
            return 0
        return int(charger.POWERED | charger.CHARGING) if self.body.battery.is_charging else int(charger.POWERED)

    def _dock(self) -> feedback.DockInfrared:
        heard = self.body.dock_signals()
        return feedback.DockInfrared(right=heard.right, centre=heard.centre, left=heard.left)

    def _currents(self) -> feedback.MotorCurrent:
        """Return the currents of the motors; a byte holds 2.55 A at most."""
        left, right = (min(round(100 * amperes), 0xFF) for amperes in self.body.currents)
        return feedback.MotorCurrent(left, right)

    def _inertia(self, now: float) -> feedback.Inertia:
        gyro = self.body.gyro_drift
        heading = round(100 * degrees(self.body.pose.heading + self.gyro_offset + gyro.error(now)))
        rate = 100 * degrees(self.body.velocity.angular + gyro.rate)
        return feedback.Inertia((heading + 18000) % 36000 - 18000, _clip(rate, 0x7FFF))

    def _floor(self) -> feedback.CliffDistance:
        cliff = merge_sides(self.cliff, self.body.cliff)
        seen = [NO_FLOOR if side else FLOOR for side in (cliff.right, cliff.centre, cliff.left)]
        return feedback.CliffDistance(*seen)

    def _gyro(self) -> feedback.RawGyro:
        """Return two samples of the gyro, and three in every 25th report, as real reports have both."""
        count = 3 if self._reports % 25 == 24 else 2
        self._samples += count
        sample = (0, 0, _clip(self.body.velocity.angular / feedback.GYRO_STEP, 0x7FFF))
        return feedback.RawGyro(self._samples & 0xFF, (sample,) * count)


def _bits(sides: Sides) -> int:
    side = feedback.Side
    pairs = ((sides.left, side.LEFT), (sides.centre, side.CENTRE), (sides.right, side.RIGHT))
    return sum(int(bit) for on, bit in pairs if on)


def _lamp(red: bool, green: bool) -> Lamp:
    return Lamp.ORANGE if red and green else Lamp.RED if red else Lamp.GREEN if green else Lamp.OFF


def _clip(value: float, most: int) -> int:
    return max(-most, min(round(value), most))


def make(keys: KobukiKeys, context: SimContext) -> VirtualDevice:  # noqa: ARG001 - all makers are called with both
    """Return the virtual Kobuki for its section of a robot file."""
    device = VirtualKobuki(wheels=context.make_wheels(), ground=context.world, battery=context.physics.battery)
    return make_virtual_base(device, "kobuki")
