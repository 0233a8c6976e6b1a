"""How far robots walk in physics before they fall: each as it ships, floor, masses, servos and pushes by chance.

    python -m tests.benchmarks.walking [--robot humanoid] [--gait engine|sine|sheet] [--seeds 101-200] [--json]

A seed chooses friction (0.6 to 1.2), masses (within 5 %), servo delay (0 to 30 ms), a floor that leans by up to 2 deg
whichever way, and a push of up to 0.1 m/s. ``engine`` runs a mission that walks, through the twins; beside it are two
open loops without feeling and without goals that are set ahead: ``sine`` swings the joints of both legs by sines that
nobody has tuned, and ``sheet`` plays the angles of a walk's cycle, as a spreadsheet has them. Told are falls, speed,
energy and drift.
"""

import argparse
import json
import math
import statistics
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np

from config.world import load_world
from drivers.api import Pose2D
from drivers.legs.body import Floats, LeggedBody, body_of
from drivers.legs.declared import LegsKeys, StrideKeys
from drivers.legs.engine import standing_angles, walk_parameters
from drivers.legs.gait import generate_gait
from drivers.sim.rigid.scene import PhysicsScene
from missions.assembly.physics import scene_of
from missions.library.drivers import load_named_robot
from missions.request import RunRequest
from missions.runner import Runner

BEGINS = 4.0
"""Seconds after which the speed is taken: it has come to a stand by then, and made its first steps."""

ENDS = 12.0

PERIOD = 0.01
"""Seconds from one goal of an open loop to the next."""

SPEED = {"humanoid": 0.28, "op3": 0.22}
"""m/s that each is told to walk at: its most."""

Wave = Callable[[float], Floats]


@dataclass(frozen=True)
class Walked:
    """What came of one walk: when it ``fell`` (s; None), m/s, J/m, and metres aside and degrees turned a metre."""

    seed: int
    fell: float | None
    speed: float = 0.0
    energy: float = 0.0
    aside: float = 0.0
    turned: float = 0.0


class Watch:
    """Looks at a robot in physics, time after time."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.fell: float | None = None
        self.seen: list[tuple[float, Pose2D, float]] = []

    def look(self, now: float, scene: PhysicsScene) -> None:
        """Take in where it is."""
        if self.fell is None and scene.has_fallen:
            self.fell = now
        if now >= BEGINS:
            self.seen.append((now, scene.pose(), scene.energy))

    def told(self) -> Walked:
        """Return what came of it."""
        if self.fell is not None or len(self.seen) < 2:
            return Walked(self.seed, self.fell)
        (since, start, before), (until, end, after) = self.seen[0], self.seen[-1]
        dx, dy, c, s = end.x - start.x, end.y - start.y, math.cos(start.heading), math.sin(start.heading)
        ahead, left = c * dx + s * dy, c * dy - s * dx
        far = max(abs(ahead), 0.05)
        turned = math.degrees(end.heading - start.heading)
        return Walked(self.seed, None, ahead / (until - since), (after - before) / far, abs(left) / far, turned / far)


def disturbed(seed: int) -> str:
    """Return the world of a seed."""
    chance = Random(f"walk {seed}")  # noqa: S311 - chance, not a secret
    friction, delay = chance.uniform(0.6, 1.2), chance.uniform(0.0, 30.0)
    way, slope = chance.uniform(0.0, 2 * math.pi), chance.uniform(0.0, 2.0)
    at, towards, speed = chance.uniform(5.0, 9.0), chance.uniform(-180.0, 180.0), chance.uniform(0.0, 0.1)
    lean = f"[{slope * math.cos(way):.4f} deg, {slope * math.sin(way):.4f} deg]"
    push = f"{{at: {at:.3f} s, speed: {speed:.4f} m/s, towards: {towards:.2f} deg}}"
    physics = f"friction: {friction:.4f}, slope: {lean}, masses: 5 %, servo_delay: {delay:.2f} ms, pushes: [{push}]"
    return f"world: rough\nphysics: {{{physics}}}\n"


def by_engine(robot: str, seed: int, folder: Path) -> Walked:
    """Walk by a mission, as a user's would."""
    (folder / "stroll.yaml").write_text(f"mission: stroll\ntree:\n  walk: {{velocity: {SPEED[robot]} m/s}}\n")
    (folder / "rough.yaml").write_text(disturbed(seed))
    mission, world = str(folder / "stroll.yaml"), str(folder / "rough.yaml")
    order = RunRequest(mission, robot=robot, simulate="fast", world=world, seed=seed, eyes="truth", physics=True)
    runner, watch = Runner(order), Watch(seed)
    twins = runner.twins
    if twins is None or twins.scene is None:
        raise RuntimeError(f"{robot}: no physics")
    scene = twins.scene
    for tenth in range(1, round(10 * ENDS)):
        twins.timeline.call_at(tenth / 10, partial(watch.look, tenth / 10, scene))
    twins.timeline.call_at(ENDS, lambda: runner.executive.stop("far enough"))
    runner.run()
    return watch.told()


def by_wave(robot: str, wave: Callable[[LeggedBody, StrideKeys], Wave], seed: int, folder: Path) -> Walked:
    """Walk by goals over time alone, from the stand in which the engine begins."""
    config = load_named_robot(robot)
    keys, arm = config.keys(LegsKeys), config.arm
    if keys is None or arm is None:
        raise RuntimeError(f"{robot}: no legs")
    (folder / "rough.yaml").write_text(disturbed(seed))
    world = load_world(folder / "rough.yaml")
    scene, watch = scene_of(config, world, Pose2D(0.0, 0.0, 0.0), seed), Watch(seed)
    body = body_of(keys.body)
    goals, ready = (
        wave(body, keys.stride),
        standing_angles(body, keys.stride, walk_parameters(body, keys.stride).foot_spacing),
    )
    for tick in range(1, round(ENDS / PERIOD)):
        now = tick * PERIOD
        share = min(now / 2, 1.0)
        wanted = share * ready if now < 2.0 else goals(now - 2.0)
        for name, goal in zip(body.leg_joints, wanted.tolist(), strict=True):
            scene.set_goal(name, goal, arm.limits[name].speed)
        scene.advance(now)
        if tick % 10 == 0:
            watch.look(now, scene)
        if watch.fell is not None:
            break
    return watch.told()


def sheet(body: LeggedBody, stride: StrideKeys) -> Wave:
    """Return the angles of a cycle, over and over."""
    angles, _ = generate_gait("cycle", body, stride, stride.longest, 0.0, 0.0).angles(body)
    return lambda time: angles[int(time / stride.period * len(angles)) % len(angles)]


def sine(body: LeggedBody, stride: StrideKeys) -> Wave:
    """Return sines about the stand: both hips and ankles roll the body over one foot, while the other leg swings."""
    ready = standing_angles(body, stride, walk_parameters(body, stride).foot_spacing)
    signs = np.array([body.axis[place].sum() for place in body.leg_indices])
    leg = stride.height - 0.03
    swing, lift, sway = math.asin(stride.longest / 2 / leg), 2 * math.sqrt(stride.rise / leg), -0.12

    def wave(time: float) -> Floats:
        grown = min(time / (2 * stride.period), 1.0)
        added = np.zeros(12)
        for number, side in enumerate((0.0, math.pi)):
            phase = 2 * math.pi * time / stride.period + side
            roll, pitch, bent = sway * math.sin(phase - side), swing * math.cos(phase), lift * max(0.0, math.sin(phase))
            own = [0.0, -roll, pitch - bent / 2, bent, -pitch - bent / 2, roll]
            added[6 * number : 6 * number + 6] = own
        return ready + grown * signs * added

    return wave


def campaign(robot: str, gait: str, seeds: range) -> list[Walked]:
    """Return one walk for each seed."""
    found = []
    with TemporaryDirectory() as name:
        for seed in seeds:
            folder = Path(name)
            wave = {"sine": sine, "sheet": sheet}.get(gait)
            walked = by_engine(robot, seed, folder) if wave is None else by_wave(robot, wave, seed, folder)
            found.append(walked)
            print(f"{robot} {gait}: {summary(found)}", flush=True)
    return found


def summary(found: list[Walked]) -> str:
    """Return what came of walks in a line."""
    fell, upright = [each for each in found if each.fell is not None], [each for each in found if each.fell is None]
    text = f"{len(fell)} of {len(found)} fell"
    if fell:
        text += f" ({', '.join(f'{each.seed} at {each.fell:.1f} s' for each in fell)})"
    if not upright:
        return text

    def mean(word: str) -> float:
        return statistics.fmean(abs(getattr(each, word)) for each in upright)

    slow = min(each.speed for each in upright)
    text += f"; {mean('speed'):.3f} m/s (least {slow:.3f}), {mean('energy'):.0f} J/m, aside {mean('aside'):.3f} m/m"
    return f"{text}, turned {mean('turned'):.1f} deg/m"


def main() -> None:
    """Run campaigns."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", choices=sorted(SPEED), action="append")
    parser.add_argument("--gait", choices=("engine", "sine", "sheet"), action="append")
    parser.add_argument("--seeds", default="101-200", help="the first and the last")
    parser.add_argument("--json", action="store_true", help="tell each walk")
    asked = parser.parse_args()
    first, last = (int(each) for each in asked.seeds.split("-"))
    for robot in asked.robot or sorted(SPEED):
        for gait in asked.gait or ("engine", "sine", "sheet"):
            found = campaign(robot, gait, range(first, last + 1))
            if asked.json:
                print(json.dumps([asdict(each) for each in found]))


if __name__ == "__main__":
    main()
