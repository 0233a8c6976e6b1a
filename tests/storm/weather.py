"""What a seed stands for: a mission, a robot, a world, and the schedule of what goes wrong."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from math import degrees
from pathlib import Path
from random import Random
from typing import Any, Literal

from behaviours.leaf import Leaf
from config.diagnostics import InvalidFileError, SourceText
from config.library import find_file
from config.robot import RobotConfig
from config.world import BatteryConfig, WorldConfig, load_world
from drivers.api.sections import ArmKeys
from missions.assembly.part_factory import with_carriers
from missions.language.document import check_plan
from missions.language.plan import Plan
from missions.library.drivers import parse_robot
from missions.library.lookups import LOOKUPS
from missions.library.shipped import load_mission, shipped_missions
from missions.library.target import target_of
from missions.library.vocabulary import load_leaves
from tests.storm.crowds import crowded
from tests.storm.others import OTHERS, others_of
from tests.storm.trees import Trees

LEAVES = Path(__file__).with_name("leaves.py")
"""The leaves of the storm, as a file of a user's own."""

TRIES = 60
"""Missions that are drawn, at most, until one can be run."""

LONGEST = 20.0
"""Seconds of simulated time that a storm lasts at most."""

ROBOTS = ("turtlebot2_arm", "turtlebot2_arm", "turtlebot2_arm", "turtlebot2", "wave_rover", "so101", "humanoid")
WORLDS = (
    "living_room",
    "two_people",
    "walker",
    "party",
    "obstacles",
    "corridor",
    "stairs",
    "dim",
    "square_arena",
    "house",
)

DRAIN = 50.0
"""How many times as fast as a real one a battery empties, where it is not full."""

WALKERS = ("humanoid",)
"""Robots whose base walks on the joints of their arm: they stand here."""

PLAIN = ("wave_rover",)
"""Robots whose base feels nothing."""

UNWATCHED, LONG_PAUSE = 0.15, 7.0
"""The share of runs whose battery empties in a pause, and how many seconds that lasts."""

ABSENT = 0.12
"""The share of those in which the base goes while it moves, and is back later."""

FLAT = 0.15
"""The share of runs whose battery is empty soon, long before their end."""

RECORDED = 0.06
"""The share of runs that are recorded; in half of them something happens to the recorder."""

GUARDED = ("turtlebot2",)
"""Robots whose base has a range guard: people and furniture are put in their way."""

STOPPED = 0.3
"""The share of runs that are stopped in the midst of a command."""

Record = Literal["", "kept", "killed", "full"]
"""Whether a run is recorded, and what happens to who writes that after half of it."""

Physics = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Weather:
    """All that a run of the storm is made of: plain data, which can be sent to another process or written into a test.

    ``mission`` is the name of one that ships, or the text of one. ``pace`` is the share of the robot's speeds that it
    may go, ``limbs`` that of its heads and arms; ``others`` are further parts of ``OTHERS`` that it has. ``faults`` are
    phrases of test files. ``seconds`` after its start somebody ends the mission, if it has not ended by then.
    ``record`` says what becomes of the run's record. At the command of number ``stop_at`` somebody stops it, for
    ``stop_for`` seconds, between its tick and the device; that tick then ``hangs`` for some seconds. If the stop is
    ``alone``, nothing but the latch holds the robot still: ticks go on. ``crowd`` is how many people, and how many
    pieces of furniture, are in the robot's way beside those of the world.
    """

    seed: int
    mission: str
    robot: str
    world: str
    seconds: float
    faults: tuple[str, ...] = ()
    pace: float = 1.0
    rate: int = 20
    others: tuple[str, ...] = ()
    physics: Physics = field(default_factory=dict)
    eyes: Literal["pixels", "truth"] = "truth"
    record: Record = ""
    stop_at: int = 0
    limbs: float = 1.0
    stop_for: float = 1.0
    hangs: float = 0.0
    alone: bool = False
    crowd: int = 0

    def robot_text(self) -> str:
        """Return the robot's file."""
        text = find_file("robots", self.robot).read_text("utf-8")
        text = re.sub(r"max_speed: ([\d.]+) m/s", lambda it: f"max_speed: {float(it[1]) * self.pace:.3f} m/s", text)
        text = re.sub(r"max_turn: ([\d.]+) deg/s", lambda it: f"max_turn: {float(it[1]) * self.pace:.1f} deg/s", text)
        text = re.sub(r"^rate: \d+ Hz", f"rate: {self.rate} Hz", text, flags=re.MULTILINE)
        if self.robot in WALKERS:
            text = re.sub(r"^base:\n(?:[ \t#].*\n|\n)*", "", text, flags=re.MULTILINE)
        text += "".join(OTHERS[name] for name in self.others)
        return re.sub(r"\bspeed: ([\d.]+) deg/s", lambda it: f"speed: {float(it[1]) * self.limbs:.1f} deg/s", text)

    def robot_config(self) -> RobotConfig:
        """Return the robot, read."""
        return parse_robot(SourceText("storm.robot.yaml", self.robot_text()))

    def world_config(self) -> WorldConfig:
        """Return the world, with its physics."""
        world = load_world(find_file("worlds", self.world))
        given: dict[str, Any] = dict(self.physics)
        if "battery" in given:
            given["battery"] = BatteryConfig(level=given["battery"], drain=DRAIN)
        world = replace(world, physics=replace(world.physics, **given))
        chance = Random(f"storm {self.seed} crowd")  # noqa: S311 - a draw is no secret
        return crowded(world, chance, people=self.crowd, furniture=self.crowd) if self.crowd else world

    def plan(self, robot: RobotConfig) -> Plan:
        """Read and check the mission. Raises InvalidFileError."""
        if "\n" not in self.mission:
            return load_mission(self.mission, complete=True, robot=target_of(robot), leaves=_leaves())
        source = SourceText("storm.yaml", self.mission)
        return check_plan(source, _leaves(), LOOKUPS, complete=True, robot=target_of(robot))


@cache
def _leaves() -> Mapping[str, type[Leaf]]:
    """Return what missions of the storm are made of."""
    return load_leaves([LEAVES])


def draw(seed: int) -> Weather:
    """Return what this seed stands for: the same on every machine."""
    chance = Random(f"storm {seed}")  # noqa: S311 - a draw is no secret
    robot = chance.choice(ROBOTS)
    weather = Weather(
        seed,
        "",
        robot,
        chance.choice(WORLDS),
        round(chance.uniform(3.0, LONGEST), 2),
        pace=chance.choice([1.0, 1.0, 0.6, 0.3]),
        rate=chance.choice([20, 20, 10, 50]),
        others=others_of(robot, chance),
        physics=_physics(chance),
        eyes="pixels" if chance.random() < 0.03 else "truth",
        limbs=chance.choice([1.0, 0.5, 0.2, 0.1, 0.1, 0.1]),
        stop_for=chance.choice([1.0, 4.0, 4.0]),
        hangs=chance.choice([0.0, 2.0, 2.0]),
        alone=chance.random() < 0.4,
    )
    config = weather.robot_config()
    if robot in GUARDED:  # by a draw of its own: others are as they were
        weather = replace(weather, crowd=Random(f"storm {seed} crowds").choice([0, 1, 2, 3]))  # noqa: S311
    weather, plan = _with_mission(weather, config, chance)
    parts = sorted(with_carriers(config, plan.tree.parts))
    faults = (*_schedule(weather, config, parts, chance), *_further(weather, parts, chance))
    record: Record = chance.choice(["kept", "kept", "killed", "full"]) if chance.random() < RECORDED else ""
    stop_at = chance.choice([1, 2, 3, 5, 8, 13, 21]) if chance.random() < STOPPED else 0
    if chance.random() < FLAT and "base" in parts and robot not in PLAIN:
        faults += (f"base battery at {chance.randint(1, 4)} % at {chance.uniform(0.1, weather.seconds / 4):.2f} s",)
    return replace(weather, faults=faults, record=record, stop_at=stop_at)


def _physics(chance: Random) -> Physics:
    """Return how the base errs, in some runs."""
    drawn = {
        "slip": chance.uniform(0.0, 0.2),
        "lag": chance.uniform(0.0, 0.3),
        "gyro_noise": chance.uniform(0.0, 0.1),
        "dropouts": chance.uniform(0.0, 0.5),
        "mishearing": chance.uniform(0.0, 0.5),
        "battery": chance.uniform(0.08, 1.0),
    }
    return {name: round(value, 3) for name, value in drawn.items() if chance.random() < 0.25}


def _with_mission(weather: Weather, config: RobotConfig, chance: Random) -> tuple[Weather, Plan]:
    """Return it with a mission that this robot can do: one that ships, or more often one by chance."""
    arms = {part: section.keys.limits for part, section in config.sections.items() if isinstance(section.keys, ArmKeys)}
    joints = {
        arm: {name: (degrees(each.lower), degrees(each.upper)) for name, each in limits.items()}
        for arm, limits in arms.items()
    }
    trees = Trees(chance, config.parts, joints, config.extra_parts)
    for _ in range(TRIES):
        shipped = chance.random() < 0.2
        mission = chance.choice(sorted(shipped_missions())) if shipped else trees.mission()
        found = replace(weather, mission=mission)
        try:
            return found, found.plan(config)
        except InvalidFileError:
            continue
    found = replace(weather, mission="mission: storm\ntree:\n  wait: 5 s\n")
    return found, found.plan(config)


def _schedule(weather: Weather, config: RobotConfig, parts: list[str], chance: Random) -> Iterator[str]:
    """Yield what goes wrong, and when: up to six things, of which some wait for a moment of the base."""
    kinds = [kind for part in parts for kind in faults_of(part, config.extra_parts.get(part, part), weather.robot)]
    kinds += RUN_FAULTS
    for _ in range(chance.choice([0, 1, 2, 3, 4, 6])):
        words = chance.choice(kinds)
        joint = chance.choice(sorted(config.sections[words.split()[0]].keys.limits)) if "JOINT" in words else ""
        words = words.replace("JOINT", joint).replace("SIDE", chance.choice(["left", "centre", "right"]))
        words = words.replace("ANGLE", f"{chance.uniform(-60, 60):.0f} deg").replace(
            "SHARE", f"{chance.randint(3, 60)} %"
        )
        when = f"at {chance.uniform(0.1, weather.seconds):.2f} s"
        if "base" in parts and chance.random() < 0.2:
            when = f"when base {chance.choice(['moves', 'stops'])}"
        lasting = any(f" {word}" in words for word in ("battery", "overloaded", "turned"))
        how_long = chance.choice([0.05, 0.2, 0.5, 0.9, 1.5, 3.0, 6.0])
        yield f"{words} {when}" + ("" if lasting else f" for {how_long} s")


def _further(weather: Weather, parts: list[str], chance: Random) -> Iterator[str]:
    """Yield, in some runs, what empties the battery in a pause, or an absence of what moves."""
    kind, spare = chance.random(), weather.seconds - LONG_PAUSE
    if "base" not in parts:
        return
    if kind < UNWATCHED and spare > 0 and weather.robot not in PLAIN:
        start = chance.uniform(0.1, 0.1 + spare)
        yield f"run paused at {start:.2f} s for {LONG_PAUSE:g} s"
        yield f"base battery at {chance.randint(1, 4)} % at {start + 0.2:.2f} s"
    elif UNWATCHED <= kind < UNWATCHED + ABSENT:
        yield f"base unplugged when base moves for {chance.choice([1.5, 3.0])} s"


OF_DRIVES = [
    "base blocked", "base slipping", "base reversed", "base uncounted", "base e_stopped", "base drifting at 2 deg/s",
    "base late by 0.5 s",
]  # fmt: skip
"""Faults of a base's drive and odometry."""

RUN_FAULTS = ["run stalled", "run stopped", "run paused", "run stopped"]


def faults_of(part: str, kind: str, robot: str) -> list[str]:
    """Return what may happen to a part of a kind, as test files write it."""
    match kind:
        case "base" if robot not in PLAIN:
            felt = [
                "base bumped SIDE",
                "base cliff SIDE",
                "base lifted",
                "base button 0 pressed",
                "base button 2 pressed",
            ]
            others = ["base unplugged", "base docked", "base driven", "base driven", "base battery at SHARE"]
            return [*felt, *others, *OF_DRIVES]
        case "base":
            return ["base unplugged", "base driven", *OF_DRIVES]
        case "arm":
            return [f"{part} unplugged", f"{part} overloaded JOINT", f"{part} turned JOINT to ANGLE"]
        case "camera":
            return ["camera unplugged", "camera frozen", "camera covered", "camera slow"]
        case "microphone":
            return ["microphone unplugged", "microphone deaf"]
        case "voice":
            return ["voice unplugged", "voice hanging"]
        case _:
            return [f"{part} unplugged"]
