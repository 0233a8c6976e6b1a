"""A tick loop that stalls leaves a base that comes to rest: by the deadman in the driver's own thread.

First to the microsecond, with the real driver and the virtual base on a clock that stands still; then with a whole
mission in real time, on the base's own clock, in which one behaviour holds up the tick.
"""

import random
from pathlib import Path

import pytest
from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, Leaf
from config.library import find_file
from drivers.api import Velocity
from drivers.api.sections import BaseKeys
from drivers.clock import Clock, ManualClock, SystemClock
from drivers.kobuki.driver import kobuki_base
from drivers.kobuki.virtual import REPORT_INTERVAL as REPORT
from drivers.kobuki.virtual import VirtualKobuki
from drivers.virtual.terminal import PseudoTerminal
from missions.library.drivers import load_robot
from missions.request import RunRequest
from missions.runner import Runner
from tests.drivers.test_kobuki_driver import DirectLink
from tests.missions.lone_base import LONE_ROBOT, Witness
from tests.waiting import wait_until

WITHIN = 0.5
"""Seconds from the last command of a tick loop to rest, straight ahead at the speed that turtlebot2 ships with."""

PERIOD = 0.05
"""Seconds from tick to tick."""

TURTLEBOT, ARM = "turtlebot2", "turtlebot2_arm"


def base_of(robot: str) -> BaseKeys:
    config = load_robot(find_file("robots", robot)).base
    assert config is not None
    return config


# The deadman waits for 0.3 s, whatever the speed; then a wheel brakes by 2 m/s^2, as we assume of the firmware. So the
# bound of 0.5 s is for wheels of up to 0.35 m/s: in a tight curve, or on the faster robot, braking takes longer.
@pytest.mark.parametrize(
    ("robot", "ahead", "turn", "within"),
    [(TURTLEBOT, 1.0, 0.0, WITHIN), (TURTLEBOT, 0.0, 1.0, WITHIN), (TURTLEBOT, 1.0, 0.5, 0.55), (ARM, 1.0, 0.0, 0.6)],
    ids=["straight", "on the spot", "a curve", "straight at 0.5 m/s"],
)
def test_a_stall_at_any_moment_of_driving_brings_the_base_to_rest(
    robot: str, ahead: float, turn: float, within: float
) -> None:
    config, chance = base_of(robot), random.Random(3)  # noqa: S311 - chance, not a secret
    wanted = Velocity(ahead * config.max_speed, turn * config.max_turn)
    took = [time_to_rest(config, wanted, seconds) for seconds in (*(chance.uniform(0.2, 3.0) for _ in range(20)), 3.0)]
    assert max(took) <= within


def time_to_rest(config: BaseKeys, wanted: Velocity, seconds: float) -> float:
    """Drive so for a while, then tick no more; return the seconds from the last tick to rest."""
    clock, kobuki = ManualClock(), VirtualKobuki()
    link = DirectLink(kobuki, clock)
    base = kobuki_base(link, clock, max_linear=config.max_speed, max_angular=config.max_turn)
    base.open()
    link.run(0.1)
    ticked = 0.0
    while clock.now() < seconds:
        ticked = clock.now()
        base.drive(wanted)
        link.run(PERIOD)
    assert speed(kobuki) > 0.0
    while speed(kobuki) > 0.0:
        link.run(0.01)
        kobuki.pose(clock.now())
        assert clock.now() - ticked < 5.0
    base.close()
    return clock.now() - ticked


def speed(kobuki: VirtualKobuki) -> float:
    return max(map(abs, kobuki.wheels.speeds))


class Stalling(Leaf):
    """Drive ahead for a while, and then do not come back before the base is at rest."""

    drives = frozenset({"base"})

    def __init__(self, name: str, clock: Clock, witness: Witness) -> None:
        super().__init__(name)
        self.clock = clock
        self.witness = witness
        self.stalled_at = 0.0

    def update(self) -> Status:
        base = self.robot.base
        base.drive(Velocity(base.limits.speed, 0.0))
        if self.witness.seen.top < 0.99 * base.limits.speed:
            return RUNNING
        self.stalled_at = self.clock.now()
        self.witness.forget()
        wait_until(lambda: not self.witness.seen.moving)
        return FAILURE


@pytest.mark.real_time
def test_blocked_tick_leaves_the_base_stopped(tmp_path: Path) -> None:
    mission = tmp_path / "ahead.yaml"
    mission.write_text("mission: ahead\ntree:\n  drive: 100 m\n  timeout: 30 s\n", encoding="utf-8")
    clock, witness = SystemClock(), Witness()
    stalling = Stalling("ahead", clock, witness)
    terminal = PseudoTerminal("kobuki", witness, clock)
    terminal.open()
    try:
        order = RunRequest(str(mission), robot=LONE_ROBOT, ports={"base": terminal.path}, without_stop=True)
        assert Runner(order, substitute=lambda *_: stalling).run().result == "failure"
    finally:
        terminal.close()
    took = witness.seen.rest_at - stalling.stalled_at
    # The driver renews its command with every report. When it was later than that, it was this machine that was late.
    late = max(0.0, witness.seen.gap - REPORT)
    assert late < 0.2, "this machine is too busy to tell"
    assert took <= WITHIN + late
