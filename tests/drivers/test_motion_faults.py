"""Motion faults on all bases: none drives on for long, none hangs; and no base that obeys is stopped."""

import pytest
from py_trees.common import Status

from behaviours.driving.motion import BaseMotion, DriveLeaf, TurnLeaf
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.robot import Robot
from drivers.base.motion_fault import MAX_FAULTS
from drivers.sim.base_body import BaseBody
from drivers.sim.timeline import Timeline
from drivers.sim.wheels import SimulatedWheels
from missions.plugins.testing.recorders import LeafTestBench
from tests.drivers.motion_faults import BASES, FAULTS, TICK, TRACK, MotionCase, draw, play
from tests.tries import tries


@pytest.mark.parametrize("seed", range(tries(16, most=500)))
def test_a_fault_stops_the_base_within_a_second_and_ends_the_motion(seed: int) -> None:
    ending = play(draw(seed, faulty=True))
    assert not ending.missed, ending


@pytest.mark.parametrize("seed", range(tries(16, most=500)))
def test_slipping_climbing_or_rarely_reporting_base_is_not_stopped(seed: int) -> None:
    ending = play(draw(seed, faulty=False))
    assert ending.status is SUCCESS, ending


def test_the_campaign_draws_every_base_and_every_fault() -> None:
    cases = [draw(seed, faulty=True) for seed in range(500)]
    assert {case.fault for case in cases} == set(FAULTS)
    assert {case.base for case in cases} == set(BASES)


@pytest.mark.parametrize("motion", ["drive", "go_to"])
def test_slow_base_with_one_encoder_is_stopped(motion: str) -> None:
    ending = play(MotionCase(1, "kobuki, wire", motion, 1.3, 0.0, 0.045, fault="one encoder lost"))
    assert ending.status is FAILURE
    assert ending.seconds < 7.0
    assert ending.reason.startswith("commanded ")


@pytest.mark.parametrize("drift", [0.6, -3.0, 5.0])
@pytest.mark.parametrize("base", ["kobuki, twin", "kobuki, wire", "ros2, wire"])
def test_a_turn_ends_though_the_gyro_drifts(base: str, drift: float) -> None:
    ending = play(MotionCase(1, base, "turn", 0.0, 1.57, 1.0, fault="gyro drift", amount=drift * 0.01745))
    assert ending.status is SUCCESS, ending
    assert ending.beyond < 0.05


@pytest.mark.parametrize("base", ["kobuki, wire", "create3, wire", "rover with encoders, wire"])
@pytest.mark.parametrize("fault", ["blocked", "e-stop", "encoders lost", "reversed"])
def test_faulty_base_fails_with_a_reason_within_two_seconds(base: str, fault: str) -> None:
    ending = play(MotionCase(1, base, "drive", 0.5, 0.0, 0.2, fault=fault))
    assert ending.seconds < 2.0
    assert ending.reason.startswith("commanded ")


class Run:
    """A run of leaves, one after the other, on a base."""

    def __init__(self, base: str) -> None:
        self.timeline = Timeline()
        self.stand = BASES[base](BaseBody(wheels=SimulatedWheels(separation=TRACK)), self.timeline)
        self.stand.base.open()
        self.timeline.run_until(1.0)
        self.bench = LeafTestBench(self.timeline.clock)
        self.bench.robot = Robot(base_part=self.stand.base)

    def play(self, leaf: BaseMotion, **arguments: float) -> Status:
        """Tick a leaf at once, and until it ends."""
        self.bench.put(leaf, **arguments)
        for _ in range(1000):
            self.bench.run.tick += 1
            status = leaf.execute_tick()
            if status is not RUNNING:
                return status
            self.timeline.run_until(self.timeline.clock.now() + TICK)
        raise AssertionError(leaf.reason)


COMPARED = ["kobuki, twin", "kobuki, wire", "ros2, wire", "rover with encoders, wire"]


@pytest.mark.parametrize("base", COMPARED)
def test_the_next_branch_of_a_selector_moves_a_base_at_once_after_a_fault(base: str) -> None:
    run = Run(base)
    run.stand.body.wheels.blocked = True
    assert run.play(DriveLeaf("drive"), distance=1.0) is FAILURE
    run.stand.body.wheels.blocked = False
    turn = TurnLeaf("turn")
    assert run.play(turn, angle=1.57) is SUCCESS, turn.reason
    run.stand.base.close()


@pytest.mark.parametrize("base", COMPARED)
def test_a_retry_against_an_obstacle_tries_each_time_and_ends_latched(base: str) -> None:
    run = Run(base)
    run.stand.body.wheels.blocked = True
    for number in range(MAX_FAULTS):
        began, drive = run.timeline.clock.now(), DriveLeaf("drive")
        assert run.play(drive, distance=1.0) is FAILURE
        assert run.timeline.clock.now() - began > 0.5, "it has tried"
        assert bool(run.stand.base.latched) is (number == MAX_FAULTS - 1), drive.reason
    assert run.play(TurnLeaf("turn"), angle=1.57) is FAILURE
    run.stand.base.close()


def test_create3_at_its_backup_limit_fails_with_a_reason() -> None:
    ending = play(MotionCase(1, "create3, wire", "drive", -0.3, 0.0, 0.2, fault="backup limit"))
    assert ending.seconds < 2.5
    assert "commanded -0.2 m/s" in ending.reason


def test_turn_with_rare_odometry_succeeds() -> None:
    case = draw(40016, faulty=False)
    assert (case.base, case.motion) == ("ros2 at 3 Hz, wire", "turn")
    assert play(case).status is SUCCESS
