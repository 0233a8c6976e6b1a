"""A campaign of motion faults: random motions on every base with a random fault, judged by where the base truly is.

    python -m tests.drivers.motion_faults 500 --seed 1000

prints, by fault and base, how far bases went beyond their goals, as a share of what they may.
"""

import argparse
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from math import hypot, radians
from random import Random
from typing import Any

import click
from py_trees.common import Status

from behaviours.driving.go_to import GoTo
from behaviours.driving.motion import Arc, BaseMotion, DriveLeaf, TurnLeaf
from behaviours.leaf import RUNNING, SUCCESS
from behaviours.robot import Robot
from drivers.api import ZERO_VELOCITY, BaseLimits, Pose2D
from drivers.base.diff_drive import DiffDriveBase
from drivers.base.reckoning import TwoWheels
from drivers.base.twin import BaseTwin, WheelTwinOdometry
from drivers.kobuki.driver import kobuki_base
from drivers.kobuki.virtual import VirtualKobuki
from drivers.pi_car.driver import GuardianProtocol
from drivers.ros2.base import Ros2BaseProtocol
from drivers.ros2.virtual_topics import VirtualRos2Base
from drivers.sim.base_body import BaseBody
from drivers.sim.timeline import Timeline
from drivers.sim.wheels import SimulatedWheels
from drivers.sim.world_objects import BackupLimit
from drivers.virtual.guardian import VirtualCar
from drivers.waveshare.driver import waveshare_base
from drivers.waveshare.virtual import VirtualWaveshare
from drivers.waveshare.wire import FULL_POWER
from missions.plugins.testing.recorders import LeafTestBench
from tests.drivers.cranked import HandWire

ACCELERATION, TURN_ACCELERATION = 0.5, 3.5
"""The limits of every base here (m/s^2, rad/s^2)."""

TICK, PERIOD = 0.05, 0.02
TRACK, FASTEST = 0.23, 1.25
PLAIN = {"cmd_vel": "/cmd_vel", "odom": "/odom"}
CREATE3 = {**PLAIN, "hazards": "/hazard_detection"}

FAULTS = (
    "blocked", "slipping", "reversed", "encoders swapped", "encoders lost", "gyro drift", "e-stop", "backup limit",
    "late odometry", "one encoder lost", "one motor lost", "one motor reversed",
)  # fmt: skip

LATEST = 120.0
"""Seconds after which a motion counts as hanging."""


@dataclass
class Stand:
    """A base on its body, in simulated time. ``odometer`` is what reports its motion, None where nothing does."""

    timeline: Timeline
    body: BaseBody
    base: Any
    odometer: Any = None
    held_up: list[tuple[float, float]] = field(default_factory=list)
    """From when to when its computer is held up."""

    def stalls(self) -> bool:
        now = self.timeline.clock.now()
        return any(since <= now < until for since, until in self.held_up)

    def truth(self) -> Pose2D:
        return self.body.advance(self.timeline.clock.now())


def on_wire(device: Any, timeline: Timeline, make: Callable[[HandWire], Any], *, measures: bool = True) -> Stand:
    """Return a real driver that ``make`` makes on the wire of a virtual device."""
    wire = HandWire(device, timeline)
    stand = Stand(timeline, device.body, make(wire), device if measures else None)
    arrive = wire.take

    def take(said: bytes) -> None:
        if stand.stalls():
            waiting.append(said)
            return
        arrive(b"".join(waiting) + said)
        waiting.clear()

    waiting: list[bytes] = []
    wire.take = take  # type: ignore[method-assign]
    return stand


def twin(base: BaseTwin, timeline: Timeline, *, measures: bool = True) -> Stand:
    """Return a twin."""
    stand = Stand(timeline, base.body, base, base if measures else None)
    timeline.call_every(PERIOD, lambda: None if stand.stalls() else base.step())
    return stand


def kobuki_wire(body: BaseBody, timeline: Timeline) -> Stand:
    device = VirtualKobuki()
    device.body, device.wheels = body, body.wheels
    return on_wire(device, timeline, lambda wire: kobuki_base(wire.link("base"), timeline.clock))


def kobuki_twin(body: BaseBody, timeline: Timeline) -> Stand:
    return twin(BaseTwin(timeline.clock, body=body, gyro_noise=0.003), timeline)


def rover_wire(body: BaseBody, timeline: Timeline, *, encoders: bool = True) -> Stand:
    unit = 1.0 if encoders else FULL_POWER / FASTEST
    device = VirtualWaveshare(body, track=TRACK, unit=unit, encoders=encoders)

    def make(wire: HandWire) -> DiffDriveBase:
        link = wire.link("base")
        return waveshare_base(link, timeline.clock, track=TRACK, encoders=encoders, speed_at_full=FASTEST)

    return on_wire(device, timeline, make, measures=encoders)


def car_wire(body: BaseBody, timeline: Timeline) -> Stand:
    wheels = TwoWheels(TRACK, FASTEST)

    def make(wire: HandWire) -> DiffDriveBase:
        return DiffDriveBase(wire.link("base"), timeline.clock, GuardianProtocol(TRACK, FASTEST))

    return on_wire(VirtualCar(body, wheels), timeline, make, measures=False)


def plain_twin(body: BaseBody, timeline: Timeline, *, reckoned: bool = False, gyro: bool = False) -> Stand:
    wheels = TwoWheels(TRACK, FASTEST)
    odometry = WheelTwinOdometry(wheels, reckoned=reckoned, gyro=gyro)
    made = BaseTwin(timeline.clock, odometry=odometry, feels=False, body=body)
    return twin(made, timeline, measures=not reckoned)


def ros2_wire(
    body: BaseBody, timeline: Timeline, *, topics: Mapping[str, str] = PLAIN, interval: float = PERIOD
) -> Stand:
    device = VirtualRos2Base(body, topics)
    device.odometry_interval = interval

    def make(wire: HandWire) -> DiffDriveBase:
        limits = BaseLimits(0.5, 1.9, 0.5, 3.5)
        protocol = Ros2BaseProtocol("base", timeline.clock, device.channels, list(topics), limits)
        return DiffDriveBase(wire.link("base"), timeline.clock, protocol)

    return on_wire(device, timeline, make)


BASES: Mapping[str, Callable[[BaseBody, Timeline], Stand]] = {
    "kobuki, twin": kobuki_twin,
    "kobuki, wire": kobuki_wire,
    "rover with encoders, twin": plain_twin,
    "rover with encoders, wire": rover_wire,
    "ros2, twin": partial(plain_twin, gyro=True),
    "ros2, wire": ros2_wire,
    "ros2 at 3 Hz, wire": partial(ros2_wire, interval=1 / 3),
    "create3, twin": kobuki_twin,
    "create3, wire": partial(ros2_wire, topics=CREATE3),
    "wave_rover, twin": partial(plain_twin, reckoned=True),
    "wave_rover, wire": partial(rover_wire, encoders=False),
    "pi_car, wire": car_wire,
}
RECKONED = frozenset({"wave_rover, twin", "wave_rover, wire", "pi_car, wire"})
"""Bases that measure nothing: only the clock ends their motions."""

GYRO = frozenset(name for name in BASES if name.startswith(("kobuki", "ros2", "create3")))


@dataclass(frozen=True)
class MotionCase:
    """A motion on a base: ``way`` in metres, ``angle`` in radians, ``speed`` in m/s or rad/s; with a fault, perhaps."""

    seed: int
    base: str
    motion: str
    way: float
    angle: float
    speed: float
    fault: str = ""
    amount: float = 0.0
    since: float = 0.0
    slip: float = 0.0
    reaches: float = 1.0
    lag: float = 0.0
    loaded: bool = False

    @property
    def allowed(self) -> float:
        """How far (m, rad) beyond its goal the base may go: the larger of 20 % and speed x 1 s + braking."""
        goal = abs(self.angle) if self.motion == "turn" else abs(self.way)
        braking = self.speed**2 / 2 / (TURN_ACCELERATION if self.motion == "turn" else ACCELERATION)
        return max(0.2 * goal, self.speed + braking)


def draw(seed: int, *, faulty: bool) -> MotionCase:
    """Return the case of a seed."""
    chance = Random(f"motion {faulty} {seed}")  # noqa: S311 - chance, not a secret
    motion = chance.choice(("drive", "drive", "turn", "turn", "arc", "go_to"))
    side = chance.choice((-1.0, 1.0))
    way, speed = chance.uniform(0.15, 1.5), chance.uniform(0.05, 0.45)
    angle = side * radians(chance.uniform(15.0, 270.0))
    if motion == "turn":
        speed = radians(chance.uniform(10.0, 100.0))
    case = MotionCase(
        seed, chance.choice(tuple(BASES)), motion, way * side if motion == "drive" else way, angle, speed,
        lag=chance.uniform(0.0, 0.2), slip=chance.uniform(0.0, 0.2), reaches=chance.uniform(0.85, 1.1),
    )  # fmt: skip
    if not faulty:
        return replace(case, loaded=chance.random() < 0.5)
    fault, base = chance.choice(FAULTS), case.base
    if fault == "gyro drift":
        base = chance.choice(sorted(GYRO))
    if fault == "backup limit":
        base = chance.choice(("create3, twin", "create3, wire"))
        case = replace(case, motion="drive", way=-abs(case.way), speed=chance.uniform(0.05, 0.45))
    amount = {"gyro drift": side * radians(chance.uniform(0.0, 5.0)), "late odometry": chance.uniform(0.2, 1.0)}
    since = 0.0 if chance.random() < 0.5 else chance.uniform(0.2, 3.0)
    return replace(case, base=base, fault=fault, amount=amount.get(fault, 0.0), since=since, slip=0.0, reaches=1.0)


@dataclass(frozen=True)
class Ending:
    """How a motion ended; ``beyond`` is how far the base went beyond its goal, ``rests`` whether it stands."""

    case: MotionCase
    status: Status
    reason: str
    beyond: float
    seconds: float
    rests: bool

    @property
    def share(self) -> float:
        """How far it went beyond its goal, as a share of what it may."""
        return self.beyond / self.case.allowed

    @property
    def missed(self) -> bool:
        """Whether the motion hung, the base did not come to rest, or went too far though something measures that."""
        too_far = self.share > 1.0 and self.case.base not in RECKONED
        return self.status is RUNNING or not self.rests or too_far


def leaf_of(case: MotionCase) -> tuple[BaseMotion, dict[str, float]]:
    """Return the leaf of a case, and its arguments."""
    match case.motion:
        case "drive":
            return DriveLeaf("drive"), {"distance": case.way, "speed": case.speed}
        case "turn":
            return TurnLeaf("turn"), {"angle": case.angle, "speed": case.speed}
        case "arc":
            return Arc("arc"), {"radius": case.way / abs(case.angle), "angle": case.angle, "speed": case.speed}
        case _:
            return GoTo("go_to"), {"x": case.way, "y": 0.0, "speed": case.speed}


def strike(stand: Stand, case: MotionCase) -> None:
    """Begin the fault."""
    body, now = stand.body, stand.timeline.clock.now()
    delay_line = (
        next(
            (
                vars(stand.odometer)[name]
                for name in ("late", "report_delay", "odometry_delay")
                if name in vars(stand.odometer)
            ),
            None,
        )
        if stand.odometer is not None
        else None
    )
    begin: Mapping[str, Callable[[], object]] = {
        "blocked": lambda: setattr(body.wheels, "blocked", True),
        "slipping": lambda: setattr(body.wheels, "slip", 0.95),
        "reversed": lambda: setattr(body, "reversed", True),
        "encoders swapped": lambda: setattr(body.wheel_encoders, "is_swapped", True),
        "encoders lost": lambda: setattr(body.wheel_encoders, "is_lost", True),
        "one encoder lost": lambda: body.wheel_encoders.set_signs(0.0, 1.0),
        "one motor lost": lambda: setattr(body.wheels, "gains", (0.0, 1.0)),
        "one motor reversed": lambda: setattr(body.wheels, "gains", (1.0, -1.0)),
        "gyro drift": lambda: body.gyro_drift.set_rate(case.amount, now),
        "e-stop": lambda: setattr(body, "e_stop", True),
        "backup limit": lambda: setattr(body, "backup_limit", BackupLimit(0.025)),
        "late odometry": lambda: None if delay_line is None else setattr(delay_line, "delay", case.amount),
    }
    if case.fault:
        begin[case.fault]()


def play(case: MotionCase) -> Ending:
    """Let a base do a motion, and return how that ended."""
    timeline, chance = Timeline(), Random(f"load {case.seed}")  # noqa: S311
    body = BaseBody(wheels=SimulatedWheels(separation=TRACK, dead_time=case.lag, slip=case.slip))
    body.speed_factor = case.reaches
    stand = BASES[case.base](body, timeline)
    if case.loaded:
        starts = sorted(chance.uniform(1.0, 12.0) for _ in range(6))
        stand.held_up += [(since, since + chance.uniform(0.05, 0.3)) for since in starts]
    stand.base.open()
    if case.since == 0.0:
        strike(stand, case)
    timeline.run_until(1.0)
    bench = LeafTestBench(timeline.clock)
    bench.robot = Robot(base_part=stand.base)
    leaf, arguments = leaf_of(case)
    bench.put(leaf, **arguments)
    began, status, beyond = timeline.clock.now(), RUNNING, 0.0
    if case.since > 0.0:
        timeline.call_at(began + case.since, partial(strike, stand, case))
    travel = Travel(case, stand.truth())
    while status is RUNNING and timeline.clock.now() - began < LATEST:
        timeline.run_until(timeline.clock.now() + TICK)
        if not stand.stalls():
            bench.run.tick += 1
            status = leaf.execute_tick()
        beyond = max(beyond, travel.beyond(stand.truth()))
    seconds = timeline.clock.now() - began
    for _ in range(40):
        timeline.run_until(timeline.clock.now() + TICK)
        beyond = max(beyond, travel.beyond(stand.truth()))
    rests = body.velocity == ZERO_VELOCITY
    stand.base.close()
    return Ending(case, status, leaf.feedback_message, beyond, seconds, rests)


class Travel:
    """Follows a base, and says how far beyond its goal, or the wrong way from its start, it is."""

    def __init__(self, case: MotionCase, start: Pose2D) -> None:
        self._case, self._here, self._start = case, start, start
        self._gone = 0.0

    def beyond(self, here: Pose2D) -> float:
        case, before, start = self._case, self._here, self._start
        self._here = here
        step = hypot(here.x - before.x, here.y - before.y)
        self._gone += step
        if case.motion == "turn":
            side = 1.0 if case.angle > 0 else -1.0
            turned = side * (here.heading - start.heading)
            return max(turned - abs(case.angle), -turned, 0.0)
        if case.motion == "arc":
            return max(self._gone - abs(case.way), 0.0)
        side = 1.0 if case.way > 0 else -1.0
        along = side * (here.x - start.x)
        return max(along - abs(case.way), -along, 0.0)


def table(endings: list[Ending]) -> str:
    """Return how far bases went beyond their goals, by fault and base."""
    groups: dict[tuple[str, str], list[Ending]] = defaultdict(list)
    for ending in endings:
        groups[ending.case.fault, ending.case.base].append(ending)
    lines = [f"{'fault':18} {'base':26} {'runs':>4} {'failed':>6} {'longest':>8} {'beyond, worst share of allowed':>8}"]
    for (fault, base), group in sorted(groups.items()):
        failed = sum(each.status is not SUCCESS for each in group)
        longest, worst = max(each.seconds for each in group), max(each.share for each in group)
        clock = "  only the clock" if base in RECKONED else ""
        lines.append(f"{fault:18} {base:26} {len(group):4} {failed:6} {longest:6.1f} s {100 * worst:6.0f} %{clock}")
    return "\n".join(lines)


def main() -> None:
    """Play both campaigns."""
    parser = argparse.ArgumentParser()
    parser.add_argument("runs", type=int)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    seeds = range(asked.seed, asked.seed + asked.runs)
    faulty = [play(draw(seed, faulty=True)) for seed in seeds]
    click.echo(table(faulty))
    for ending in faulty:
        if ending.missed:
            click.echo(f"MISSED {ending}")
    clean = [play(draw(seed, faulty=False)) for seed in seeds]
    stopped = [ending for ending in clean if ending.status is not SUCCESS]
    click.echo(f"clean: {len(clean)} runs, {len(stopped)} stopped")
    for ending in stopped:
        click.echo(f"STOPPED {ending}")


if __name__ == "__main__":
    main()
