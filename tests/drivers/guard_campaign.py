"""The campaign of the range guard: people and furniture in the way of leaves, teleoperation and studio, by seed.

Each seed is a base in simulated time with a simulated range finder, for eight seconds. What counts as a touch, and as
visible in time, is defined by ``tests.storm.touching``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import hypot, inf, pi, radians
from random import Random
from typing import Any

from behaviours.driving.go_to import GoTo
from behaviours.driving.motion import Arc, DriveLeaf, TurnLeaf
from behaviours.leaf import RUNNING, SUCCESS, Leaf
from behaviours.robot import Robot
from behaviours.run import RunState
from behaviours.wander import Wander
from config.world import RoomConfig, StartConfig, WorldConfig
from drivers.api import BASE_RADIUS, Pose2D, is_guarded
from drivers.api.sections import BaseKeys
from drivers.base.arbitrated import settings_of
from drivers.base.range_twin import RangerTwin
from drivers.base.twin import BaseTwin
from drivers.sim.base_body import BaseBody
from drivers.sim.context import SimContext
from drivers.sim.scanner import make_range_function
from drivers.sim.timeline import Timeline
from drivers.sim.wheels import SimulatedWheels
from drivers.sim.world import SimulatedWorld
from missions.control.commands import DriveCommand as StudioDrive
from missions.control.pilot import DriveInput, Pilot
from missions.control.wheels import WheelArbiter as StudioWheels
from missions.library.worlds import build_world
from tests.storm.crowds import crowded
from tests.storm.touching import Touch, TouchWatch

SECONDS, TICK = 8.0, 0.05

PLACE = (0.05, 0.0, 0.0)
"""Where the range finder sits, as on `turtlebot2`."""


@dataclass(frozen=True, slots=True)
class Case:
    """What a seed stands for."""

    seed: int
    world: WorldConfig
    hand: str
    speed: float
    acceleration: float
    lag: float
    slip: float
    dropouts: float


@dataclass(frozen=True, slots=True)
class Played:
    """What came of a case: its touches, how far the base drove (m), for how long the guard slowed it down (s)."""

    case: Case
    touches: tuple[Touch, ...]
    way: float
    slowed: float

    @property
    def bad(self) -> list[Touch]:
        return [touch for touch in self.touches if touch.in_time]


def draw(seed: int) -> Case:
    """Return what a seed stands for."""
    chance = Random(f"range guard {seed}")  # noqa: S311 - a draw is no secret
    room = RoomConfig(length=round(chance.uniform(4, 10), 1), width=round(chance.uniform(3, 8), 1), centre=(1.0, 0.0))
    x = 1.0 + (room.length / 2 - 0.5) * chance.uniform(-1, 1)
    y = (room.width / 2 - 0.5) * chance.uniform(-1, 1)
    start = StartConfig(at=(round(x, 2), round(y, 2)), heading=round(chance.uniform(-pi, pi), 2))
    world = WorldConfig(name="crowd", room=room, start=start)
    world = crowded(world, chance, people=chance.choice([0, 1, 2, 3, 4]), furniture=chance.choice([0, 2, 4, 6]))
    return Case(
        seed,
        world,
        chance.choice(["leaves", "teleop", "studio"]),
        chance.choice([0.23, 0.3, 0.5, 0.7, 1.0]),
        chance.choice([0.3, 0.5, 1.0]),
        chance.choice([0.0, 0.1, 0.2]),
        chance.choice([0.0, 0.0, 0.05, 0.1]),
        chance.choice([0.0, 0.02, 0.1]),
    )


def play(seed: int) -> Played:
    """Play a seed."""
    case = draw(seed)
    chance = Random(f"range guard {seed} hand")  # noqa: S311
    timeline, world = Timeline(), build_world(case.world)
    clock = timeline.clock
    body = BaseBody(wheels=SimulatedWheels(pose=world.start, dead_time=case.lag, slip=case.slip), ground=world)
    keys = BaseKeys(max_speed=case.speed, acceleration=case.acceleration)
    stage = SimContext(clock, world, lambda _: body.pose)
    base = BaseTwin(clock, body=body, seed=seed, **settings_of(keys, stage))
    ranger = RangerTwin(
        make_range_function(world, PLACE, lambda _: body.pose), clock, place=PLACE, dropouts=case.dropouts, seed=seed
    )
    base.guard_by(ranger)
    watch = TouchWatch(world, base, PLACE, acceleration=case.acceleration)
    timeline.call_every(base.STEP_INTERVAL, base.step)
    timeline.call_every(ranger.STEP_INTERVAL, ranger.step)
    base.open()
    ranger.open()
    command = HANDS[case.hand](base, ranger, timeline, chance)
    timeline.call_every(TICK, command, start=0.6)
    slowed, last, way = 0, body.pose, 0.0

    def look() -> None:
        nonlocal slowed, last, way
        body.advance(clock.now())
        watch.look(clock.now())
        slowed += is_guarded(base.steering())
        way += ((body.pose.x - last.x) ** 2 + (body.pose.y - last.y) ** 2) ** 0.5
        last = body.pose

    timeline.call_every(0.02, look, start=0.5)
    while clock.now() < SECONDS and not watch.over:
        timeline.run_until(clock.now() + 0.5)
    base.close()
    ranger.close()
    return Played(case, tuple(watch.touches), way, slowed * 0.02)


@dataclass(frozen=True, slots=True)
class Errand:
    """How a clean mission ended: the leaves that succeeded, of how many, after how long; and how near it came (m)."""

    succeeded: int
    leaves: int
    seconds: float
    nearest: float


CLEAN_SECONDS = 120.0


def run_errand(seed: int, *, guarded: bool) -> Errand:
    """Drive a few motions among furniture that stands, without people, one after the other, until one fails."""
    case = draw(seed)
    chance = Random(f"range guard {seed} errand")  # noqa: S311
    world = build_world(replace(case.world, people=()))
    timeline = Timeline()
    clock, body = timeline.clock, BaseBody(wheels=SimulatedWheels(pose=world.start, dead_time=case.lag), ground=world)
    keys = BaseKeys(max_speed=case.speed, acceleration=case.acceleration)
    base = BaseTwin(clock, body=body, seed=seed, **settings_of(keys, SimContext(clock, world, lambda _: body.pose)))
    ranger = RangerTwin(make_range_function(world, PLACE, lambda _: body.pose), clock, place=PLACE, seed=seed)
    if guarded:
        base.guard_by(ranger)
    for part in (base, ranger):
        timeline.call_every(part.STEP_INTERVAL, part.step)
        part.open()
    timeline.run_until(0.6)
    run, robot = RunState(clock), Robot(base_part=base, ranger_part=ranger)
    leaves, succeeded, nearest = chance.choice([2, 3, 4]), 0, inf
    for _ in range(leaves):
        leaf = _motion(run, robot, chance, endless=False)
        while clock.now() < CLEAN_SECONDS:
            run.tick += 1
            leaf.tick_once()
            if leaf.status is not RUNNING:
                break
            timeline.run_until(clock.now() + TICK)
            nearest = min(nearest, clearance(world, body.pose, clock.now()))
        if leaf.status is not SUCCESS:
            break
        succeeded += 1
    base.close()
    return Errand(succeeded, leaves, clock.now(), nearest)


def clearance(world: SimulatedWorld, pose: Pose2D, time: float) -> float:
    """Return how far the rim of the base is from anything, in metres."""
    x, y = pose.x, pose.y
    (x_low, x_high), (y_low, y_high) = world.room.extent()
    near = min(x - x_low, x_high - x, y - y_low, y_high - y)
    return min([near, *(hypot(*solid.nearest_offset(x, y)) for solid in world.solids(time))]) - BASE_RADIUS


Hand = Callable[[BaseTwin, RangerTwin, Timeline, Random], Callable[[], None]]


def _motion(run: RunState, robot: Robot, chance: Random, *, endless: bool = True) -> Leaf:
    """Return a leaf that drives, drawn by chance; ``endless`` ones are among them."""
    kind: Any = chance.choice([DriveLeaf, DriveLeaf, DriveLeaf, TurnLeaf, Arc, GoTo, *([Wander] if endless else [])])
    given: dict[str, float] = {
        DriveLeaf: {
            "distance": chance.choice([-1, 1, 1, 1]) * chance.uniform(0.3, 4),
            "speed": chance.uniform(0.1, 0.7),
        },
        TurnLeaf: {"angle": radians(chance.uniform(-180, 180))},
        Arc: {"radius": chance.uniform(0.3, 2.0), "angle": radians(chance.uniform(30, 180))},
        GoTo: {"x": chance.uniform(-2, 4), "y": chance.uniform(-2, 2)},
        Wander: {"speed": chance.uniform(0.1, 0.7)},
    }[kind]
    leaf: Leaf = kind(kind.tag)
    leaf.run, leaf.robot, leaf.kind, leaf.scope = run, robot, leaf.tag, run.variables
    for name, value in given.items():
        setattr(leaf, name, value)
    return leaf


def _leaves(base: BaseTwin, ranger: RangerTwin, timeline: Timeline, chance: Random) -> Callable[[], None]:
    """Return what ticks leaves that drive, one after the other."""
    run, robot = RunState(timeline.clock), Robot(base_part=base, ranger_part=ranger)
    leaf: Leaf | None = None

    def tick() -> None:
        nonlocal leaf
        leaf = leaf or _motion(run, robot, chance)
        run.tick += 1
        leaf.tick_once()
        if leaf.status is not RUNNING:
            leaf = None

    return tick


def _pushes(chance: Random) -> Callable[[float], DriveInput]:
    """Return which way somebody pushes at a time: mostly ahead, for a moment."""
    until, push = 0.0, DriveInput(0.0, 0.0)

    def at(now: float) -> DriveInput:
        nonlocal until, push
        if now >= until:
            until = now + chance.uniform(0.3, 2.5)
            push = DriveInput(
                chance.choice([1.0, 1.0, 1.0, 0.6, 0.0, -1.0, -0.5]), chance.choice([0.0, 0.0, 0.3, -0.3, 1.0, -1.0])
            )
        return push

    return at


def _teleop(base: BaseTwin, ranger: RangerTwin, timeline: Timeline, chance: Random) -> Callable[[], None]:
    del ranger
    pilot, pushes = Pilot(base, speed_share=chance.choice([0.5, 1.0])), _pushes(chance)
    return lambda: pilot.steer(pushes(timeline.clock.now()))


def _studio(base: BaseTwin, ranger: RangerTwin, timeline: Timeline, chance: Random) -> Callable[[], None]:
    del ranger
    wheels, pushes = StudioWheels(base, None, timeline.clock), _pushes(chance)
    wheels.take("page", "Ada")
    pace, number = chance.choice([0.5, 1.0]), iter(range(1, 1_000_000))

    def send() -> None:
        push = pushes(timeline.clock.now())
        wheels.drive(
            "page",
            StudioDrive(n=next(number), stamp=wheels.stamp(), ahead=push.ahead, left=push.left, pace=pace),
        )

    return send


HANDS: dict[str, Hand] = {"leaves": _leaves, "teleop": _teleop, "studio": _studio}
