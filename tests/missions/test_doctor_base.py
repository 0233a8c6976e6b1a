"""``mission doctor --move`` and a base: motors, encoders and gyro that are wrong, at the wire and in twins."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import cos, degrees, hypot, radians, sin
from random import Random
from typing import Any

import pytest

from behaviours.leaf import RUNNING, SUCCESS
from drivers.api import ZERO_VELOCITY, Pose2D, Steering
from drivers.clock import ManualClock
from missions.plugins.setup.doctor.base_verdict import (
    DRIVE_DISTANCE,
    TURN_ANGLE,
    SeenMotion,
    TryBase,
    encoder_fault,
    judge_base,
)
from missions.plugins.testing.recorders import LeafTestBench
from tests.contract.test_base_contract import BaseRig, TwinBase, WireBase
from tests.contract.test_plain_base_contract import Twin, WaveRover, Waveshare
from tests.contract.test_ros2_base_contract import Topics
from tests.machines import walk
from tests.tries import tries


class PlainTwin(Twin):
    reckoned = False


RIGS: dict[str, Callable[[], BaseRig]] = {
    "kobuki": WireBase, "kobuki twin": TwinBase, "waveshare": Waveshare, "plain twin": PlainTwin, "ros2": Topics,
}  # fmt: skip

Wiring = Callable[[float, float], tuple[float, float]]

MOTORS: dict[str, Wiring] = {
    "": lambda left, right: (left, right),
    "the left and the right motor are swapped": lambda left, right: (right, left),
    "both motors turn the wrong way": lambda left, right: (-left, -right),
    "the left motor turns the wrong way": lambda left, right: (-left, right),
    "the right motor turns the wrong way": lambda left, right: (left, -right),
    "the left and the right motor are swapped, and both": lambda left, right: (-right, -left),
    "the left wheel does not turn": lambda left, right: (0.0 * left, right),
    "the right wheel does not turn": lambda left, right: (left, 0.0 * right),
    "it did not move": lambda left, right: (0.0 * left, 0.0 * right),
}
ENCODERS: dict[str, Wiring] = {
    "": lambda left, right: (left, right),
    "do not count, though the wheels turn": lambda left, right: (0.0 * left, 0.0 * right),
    "the left one does not count": lambda left, right: (0.0 * left, right),
    "the right one does not count": lambda left, right: (left, 0.0 * right),
    "left and right are swapped": lambda left, right: (right, left),
    "both count the wrong way": lambda left, right: (-left, -right),
    "the left one counts the wrong way": lambda left, right: (-left, right),
    "the right one counts the wrong way": lambda left, right: (left, -right),
}


class Counters:
    """Encoders that are wired wrongly."""

    is_lost = is_swapped = False

    def __init__(self, wheels: Any, wiring: Wiring) -> None:
        self._wheels, self._wiring = wheels, wiring

    @property
    def travel(self) -> tuple[float, float]:
        return self._wiring(self._wheels.left, self._wheels.right)

    @property
    def speeds(self) -> tuple[float, float]:
        return self._wiring(*self._wheels.speeds)


class Gyro:
    """A gyro that shows ``share`` of each turn, and drifts by ``drift`` rad/s."""

    def __init__(self, body: Any, share: float, drift: float) -> None:
        self._body, self._share, self._drift = body, share, drift

    @property
    def rate(self) -> float:
        return float((self._share - 1) * self._body.velocity.angular + self._drift)

    def error(self, now: float) -> float:
        return float((self._share - 1) * self._body.pose.heading + self._drift * now)


def body_of(rig: Any) -> Any:
    for name in ("kobuki", "rover", "robot", "device"):
        if hasattr(getattr(rig, name, None), "body"):
            return getattr(rig, name).body
    raise AssertionError(rig)


def fault(
    rig: BaseRig, motors: Wiring = MOTORS[""], encoders: Wiring = ENCODERS[""], gyro: float = 1.0, drift: float = 0.0
) -> None:
    body = body_of(rig)
    wheels, obey = body.wheels, body.wheels.command

    def command(linear: float, angular: float, now: float) -> None:
        half = angular * wheels.separation / 2
        left, right = motors(linear - half, linear + half)
        obey((left + right) / 2, (right - left) / wheels.separation, now)

    wheels.command = command
    if encoders is not ENCODERS[""]:
        body.wheel_encoders = Counters(wheels, encoders)
    if (gyro, drift) != (1.0, 0.0):
        body.gyro_drift = Gyro(body, gyro, drift)


class Trial:
    """The leaf on a rig, and what a person sees of it."""

    def __init__(self, rig: BaseRig) -> None:
        self.rig = rig
        self.leaf = TryBase("try_base")
        bench = LeafTestBench(rig.clock)  # type: ignore[arg-type]
        bench.robot = replace(bench.robot, base_part=rig.device)
        self.bench = bench
        bench.put(self.leaf)
        self.seen: dict[str, SeenMotion] = {}
        self.reach = self.turned = 0.0

    def run(self, limit: float = 30.0) -> Any:
        """Tick until it ends; note how each named movement truly went."""
        start = before = self.rig.truth()
        began, step = self.rig.clock.now(), -1
        while self.rig.clock.now() - began < limit:
            self.bench.run.tick += 1
            status = self.leaf.execute_tick()
            here = self.rig.truth()
            self.reach = max(self.reach, hypot(here.x - start.x, here.y - start.y))
            self.turned = max(self.turned, abs(here.heading - start.heading))
            if self.leaf._index != step:
                self._note(step, before, here)
                step, before = self.leaf._index, here
            if status is not RUNNING:
                return status
            self.rig.wait(0.05)
        raise AssertionError("it has no end")

    def _note(self, step: int, before: Pose2D, here: Pose2D) -> None:
        if step in (1, 3):
            self.seen["turn" if step == 1 else "ahead"] = saw(before, here)

    def findings(self) -> dict[str, tuple[str, str]]:
        found = judge_base(self.leaf.trial, self.seen["turn"], self.seen["ahead"])
        return {each.about: (each.verdict, each.message) for each in found}


def saw(before: Pose2D, here: Pose2D) -> SeenMotion:
    """Return what a person sees of a movement: the greater part of it, by the way of a wheel."""
    turn = here.heading - before.heading
    dx, dy = here.x - before.x, here.y - before.y
    way = dx * cos(before.heading) + dy * sin(before.heading)
    if max(abs(turn), abs(way) / 0.115) < radians(1.5):
        return SeenMotion.NONE
    if abs(turn) * 0.115 >= 0.8 * abs(way):
        return SeenMotion.LEFT if turn > 0 else SeenMotion.RIGHT
    return SeenMotion.AHEAD if way > 0 else SeenMotion.BACK


@pytest.fixture(params=[*RIGS.values()], ids=[*RIGS])
def rig(request: pytest.FixtureRequest) -> Iterator[BaseRig]:
    made: BaseRig = request.param()
    yield made
    made.close()


def tried(rig: BaseRig) -> tuple[Trial, dict[str, tuple[str, str]]]:
    rig.start()
    trial = Trial(rig)
    assert trial.run() is SUCCESS, trial.leaf.feedback_message
    return trial, trial.findings()


@pytest.mark.parametrize("motors", MOTORS)
def test_doctor_names_swapped_or_reversed_motors(rig: BaseRig, motors: str) -> None:
    fault(rig, motors=MOTORS[motors])
    trial, found = tried(rig)
    verdict, what = found["motors"]
    assert (verdict, what.startswith(motors or "turn as commanded")) == ("wrong" if motors else "ok", True), what
    assert trial.reach < DRIVE_DISTANCE + 0.06
    assert trial.turned < TURN_ANGLE + radians(30)


@pytest.mark.parametrize("encoders", ENCODERS)
@pytest.mark.parametrize("motors", ["", "the left and the right motor are swapped", "both motors turn the wrong way"])
def test_encoders_are_named_apart_from_motors(rig: BaseRig, motors: str, encoders: str) -> None:
    if isinstance(rig, Topics):
        return  # its odometry is its node's own
    fault(rig, motors=MOTORS[motors], encoders=ENCODERS[encoders])
    _, found = tried(rig)
    verdict, what = found["encoders"]
    assert (verdict, what.startswith(encoders or "agree with")) == ("wrong" if encoders else "ok", True), what
    assert found["motors"][1].startswith(motors or "turn as commanded")


@pytest.mark.parametrize("drift", [0.0, 0.6, -2.0, 8.0])
@pytest.mark.parametrize("made", [WireBase, TwinBase])
def test_the_drift_of_a_gyro_is_measured_at_rest(made: Callable[[], BaseRig], drift: float) -> None:
    rig = made()
    fault(rig, drift=radians(drift))
    _, found = tried(rig)
    rig.close()
    verdict, what = found["gyro drift"]
    assert verdict == ("ok" if not drift else "warning" if abs(drift) < 5 else "wrong")
    if drift:
        assert float(what.split()[0]) == pytest.approx(drift, rel=0.05)


@pytest.mark.parametrize(("share", "words"), [(0.0, "shows no turn"), (-1.0, "sign is reversed"), (0.3, "the gyro")])
@pytest.mark.parametrize("made", [WireBase, TwinBase])
def test_doctor_names_the_likely_fault_of_gyro_or_encoders(
    made: Callable[[], BaseRig], share: float, words: str
) -> None:
    rig = made()
    fault(rig, gyro=share)
    trial, _ = tried(rig)
    rig.close()
    found = list(judge_base(trial.leaf.trial, SeenMotion.LEFT, SeenMotion.AHEAD))
    assert any(each.about == "gyro" and words in each.message and each.verdict != "ok" for each in found), found


def test_base_without_odometry_is_judged_by_the_person() -> None:
    rig = WaveRover()
    fault(rig, motors=MOTORS["the left and the right motor are swapped"])
    _, found = tried(rig)
    rig.close()
    assert found["motors"][0] == "wrong"
    assert found["odometry"] == ("ok", "no odometry: its pose is estimated from the commanded speeds")


def test_healthy_bases_raise_no_false_alarm() -> None:
    for seed in range(tries(6, most=60)):
        chance = Random(seed)  # noqa: S311 - chance, not a secret
        made = list(RIGS.values())[seed % len(RIGS)]()
        body = body_of(made)
        body.wheels.slip = chance.uniform(0.0, 0.2)
        if made.__class__ in (WireBase, TwinBase):
            body.gyro_drift = Gyro(body, 1.0, radians(chance.uniform(-0.25, 0.25)))
        if hasattr(made.device, "_gyro_noise"):
            made.device._gyro_noise = radians(chance.uniform(0.0, 0.5))
        if hasattr(getattr(made, "kobuki", None), "late"):
            made.kobuki.late.delay = chance.uniform(0.0, 0.3)  # type: ignore[attr-defined]
        _, found = tried(made)
        made.close()
        assert all(verdict == "ok" for verdict, _ in found.values()), (seed, found)


def test_silent_base_ends_the_doctor_trial() -> None:
    rig = TwinBase()
    rig.start()
    trial = Trial(rig)
    rig.unplug()
    assert trial.run() is not SUCCESS
    assert "no report from the base for 2 s" in trial.leaf.feedback_message
    rig.close()


def test_runaway_base_is_stopped_in_the_doctor_trial() -> None:
    rig = TwinBase()
    fault(rig, motors=lambda left, right: (9 * left, 9 * right))
    _, found = tried(rig)
    rig.close()
    trial = Trial(rig)
    assert trial.turned < radians(60)
    assert found


@pytest.mark.parametrize("encoders", ENCODERS)
def test_faults_of_encoders_by_signs_alone(encoders: str) -> None:
    truth = ((-1, 1), (1, 1))
    wired = tuple(tuple(int(it) for it in ENCODERS[encoders](*signs)) for signs in truth)
    assert encoder_fault(truth, wired).startswith(encoders)  # type: ignore[arg-type]


def test_degrees_of_the_example() -> None:
    assert degrees(TURN_ANGLE) == pytest.approx(10)


def test_random_times_and_faults_take_every_transition_and_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    class Driven(LeafTestBench):
        """The leaf on a base that moves as it likes."""

        def __init__(self) -> None:
            super().__init__(ManualClock())
            self.leaf = self.put(TryBase("try_base"))

    def tick(driven: Driven, chance: Random) -> None:
        driven.base.steers = Steering(None, ZERO_VELOCITY, ZERO_VELOCITY, fault=chance.choice(("", "", "", "blocked")))
        driven.tick(driven.leaf, after=chance.choice((0.05, 0.4, 1.1)))

    table = walk(monkeypatch, "missions.plugins.setup.doctor.base_verdict.TRANSITIONS", Driven, [tick], walks=60)
    assert table.visited == set(table)
    assert not table.missing
