"""State of a Kobuki from its reports.

Distances come from the encoders, headings from the gyro. Frames and signs are those of REP 105 and 103.
"""

from functools import cache
from math import radians

from drivers.api import ZERO_VELOCITY, BaseState, DockBeam, DockSignals, Sides
from drivers.base.reckoning import GyroOdometry
from drivers.kobuki.commands import WHEEL_SEPARATION
from drivers.kobuki.feedback import DROPPED_LEFT, DROPPED_RIGHT, METRES_PER_TICK, Core, DockInfrared, Inertia, Side

MAX_REPORT_GAP = 1.0
"""Seconds without a report after which differences of the encoder counts are not used.

The base may have been switched off and on, which resets its counters. After 4 s at full speed they may also have
wrapped.
"""


class KobukiOdometry(GyroOdometry):
    """Odometry of a Kobuki from its reports. The pose is zero at the first report, whatever the gyro's heading is."""

    def __init__(self) -> None:
        super().__init__(WHEEL_SEPARATION)
        self._last: tuple[Core, Inertia, float] | None = None

    def anchor(self) -> None:
        """Keep the pose at the next report, which may have restarted counters, and measure the motion from there."""
        self._last = None
        self.velocity = ZERO_VELOCITY

    def update(self, core: Core, inertia: Inertia, now: float) -> None:
        """Add the motion since the previous report; ``now`` is the time of this report in seconds."""
        last, self._last = self._last, (core, inertia, now)
        if last is None:
            return
        core_before, inertia_before, before = last
        # By the clock of the base: several reports may arrive at once.
        elapsed = ((core.time_ms - core_before.time_ms) & 0xFFFF) / 1000
        if max(elapsed, now - before) > MAX_REPORT_GAP:
            self.velocity = ZERO_VELOCITY
            return
        left = METRES_PER_TICK * _wrap(core.left_encoder - core_before.left_encoder, 0x10000)
        right = METRES_PER_TICK * _wrap(core.right_encoder - core_before.right_encoder, 0x10000)
        turn = radians(_wrap(inertia.heading_cdeg - inertia_before.heading_cdeg, 36000) / 100)
        self.add(left, right, turn, inertia.rate, elapsed)


def _wrap(difference: int, period: int) -> int:
    """Return the signed ``difference`` of two counters that wrap at ``period``; it is at most half a period."""
    return (difference + period // 2) % period - period // 2


FULL_VOLTAGE, EMPTY_VOLTAGE = 16.5, 13.2
LOW_VOLTAGE = 14.0
"""Voltage in volts at which the vendor's driver calls the battery low."""

NO_DOCK = DockSignals()


class KobukiStateBuilder:
    """Combines the parts of Kobuki reports into states of the base.

    It keeps the pose, the last heading of the gyro, and the voltage at which the battery was full.
    """

    def __init__(self) -> None:
        self.odometry = KobukiOdometry()
        self._inertia: Inertia | None = None
        self._full_voltage = FULL_VOLTAGE
        self._dock = DockInfrared()

    def update(
        self, core: Core | None, inertia: Inertia | None, now: float, dock: DockInfrared | None = None
    ) -> BaseState | None:
        """Return the state of the base after one frame at ``now``; None if heading or core report are still missing.

        An argument is None if the frame has no such part. Without an inertial part the last heading is used.
        """
        self._inertia = inertia or self._inertia
        self._dock = dock or self._dock
        if core is None or self._inertia is None:
            return None
        self.odometry.update(core, self._inertia, now)
        if core.full and core.voltage > LOW_VOLTAGE:
            self._full_voltage = core.voltage
        return BaseState(
            pose=self.odometry.pose,
            velocity=self.odometry.velocity,
            bumper=_sides(core.bumper),
            cliff=_sides(core.cliff),
            wheel_drop=_wheels(core.wheel_drop, left=DROPPED_LEFT, right=DROPPED_RIGHT),
            buttons=_buttons(core.buttons),
            battery_voltage=core.voltage,
            battery_percent=battery_percent(core.voltage, self._full_voltage),
            charging=core.charging,
            docked=core.docked,
            dock=_dock_signals(self._dock),
            overcurrent=_wheels(core.overcurrent, left=1, right=2),
            settling=self.odometry.bias.settling,
            odometers=self.odometry.odometers,
        )


def battery_percent(voltage: float, full_voltage: float = FULL_VOLTAGE) -> float:
    """Return the charge in 0..100 percent, by the linear rule of the vendor's driver: 5 if empty, 100 if full."""
    return min(max(5 + 95 * (voltage - EMPTY_VOLTAGE) / (full_voltage - EMPTY_VOLTAGE), 0.0), 100.0)


def _dock_signals(dock: DockInfrared) -> DockSignals:
    if not (dock.left or dock.centre or dock.right):
        return NO_DOCK
    return DockSignals(DockBeam(dock.left), DockBeam(dock.centre), DockBeam(dock.right))


@cache
def _sides(bits: int) -> Sides:
    return Sides(left=bool(bits & Side.LEFT), centre=bool(bits & Side.CENTRE), right=bool(bits & Side.RIGHT))


@cache
def _wheels(bits: int, *, left: int, right: int) -> Sides:
    return Sides(left=bool(bits & left), right=bool(bits & right))


@cache
def _buttons(bits: int) -> frozenset[int]:
    return frozenset(number for number in range(3) if bits >> number & 1)
