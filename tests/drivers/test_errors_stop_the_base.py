"""An error anywhere on the way to a command of the wheels never leaves the last speed standing."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from math import inf, nan
from typing import Any

import numpy as np
import pytest

from drivers.api import ZERO_VELOCITY, BaseState, Pose2D, RangeScan, Source, Velocity, is_guarded
from drivers.api.steering import GUARD_FAILED_REASON, SCANS_MISSING_REASON
from drivers.base.limits import VelocityLimits
from drivers.base.motion_fault import MotionFault
from drivers.base.velocity_multiplexer import GUARD_REPORT_INTERVAL, VelocityMultiplexer
from tests.contract.rigs import simulated
from tests.contract.test_base_contract import BaseRig, TwinBase, WireBase
from tests.contract.test_plain_base_contract import PiCar, Twin, WaveRover, Waveshare
from tests.contract.test_ros2_base_contract import Topics
from tests.drivers.guarded import GuardedBase, ScriptedRanger

AHEAD = Velocity(0.2, 0.0)
STANDING = BaseState(Pose2D(0.0, 0.0, 0.0), ZERO_VELOCITY)


class BrokenGuard:
    """A range guard that raises in each of its methods while it is ``broken``, every ``each`` time."""

    def __init__(self, *, each: int = 1) -> None:
        self.stops, self.broken, self._each, self._calls = False, False, each, 0

    def limit(self, going: Velocity, *_: object, **__: object) -> tuple[Velocity, str]:
        self._break()
        return going, ""

    def rest(self, now: float) -> None:
        del now
        self.stops = False
        self._break()

    def _break(self) -> None:
        self._calls += 1
        if self.broken and self._calls % self._each == 0:
            raise ZeroDivisionError("no beams")


def raising(*_: object, **__: object) -> Any:
    raise RuntimeError("broken")


class Driven:
    """A multiplexer that is commanded and asked 50 times a second."""

    def __init__(self) -> None:
        self.now, self.felt = 0.0, STANDING
        self.mux = VelocityMultiplexer(VelocityLimits(0.5, 1.9, 5.0, 5.0))
        self.mux.monitor.update = lambda *_: None  # type: ignore[method-assign]
        self.mux.guard = self.guard = BrokenGuard()
        self.faults: list[object] = []

    def drive(self, seconds: float, wanted: Velocity | None = AHEAD) -> list[Velocity]:
        sent = []
        for _ in range(round(seconds / 0.02)):
            self.now += 0.02
            if wanted is not None:
                self.mux.request(wanted, self.now, self.felt, Source.TELEOP)
            self.mux.on_state(self.felt, self.now)
            sent.append(self.mux.next_velocity(self.now, self.felt))
            if self.mux.fault is not None and self.mux.fault not in self.faults:
                self.faults.append(self.mux.fault)
        return sent


# --- the multiplexer --------------------------------------------------------------------------------------------------


def test_exception_in_the_guard_stops_the_base_for_one_renewal() -> None:
    bench = Driven()
    assert bench.drive(0.5)[-1] == AHEAD
    bench.guard.broken = True
    assert bench.drive(0.5) == [ZERO_VELOCITY] * 25
    assert bench.mux.steering.reason.startswith(GUARD_FAILED_REASON)
    assert is_guarded(bench.mux.steering)
    assert len(bench.faults) == 1
    bench.guard.broken = False
    assert bench.drive(0.5)[-1] == AHEAD


def test_expired_command_during_a_guard_failure_leaves_zero() -> None:
    bench = Driven()
    bench.drive(0.5)
    bench.guard.broken = True
    assert set(bench.drive(1.0, None)) == {ZERO_VELOCITY}
    assert bench.mux.fault is not None


def test_lasting_guard_failure_is_reported_at_intervals() -> None:
    bench = Driven()
    bench.guard.broken = True
    reported: list[MotionFault | None] = []
    for _ in range(round(2.5 * GUARD_REPORT_INTERVAL / 0.02)):
        bench.drive(0.02)
        if not reported or bench.mux.fault is not reported[-1]:
            reported.append(bench.mux.fault)
    assert len(reported) == 3


@pytest.mark.parametrize("broken", ["_limits", "_arbiter", "_safety"])
def test_an_error_in_the_arbitration_latches_the_base_with_a_zero(broken: str) -> None:
    bench = Driven()
    assert bench.drive(0.5)[-1] == AHEAD
    good = getattr(bench.mux, broken)
    setattr(bench.mux, broken, Broken(good))
    assert set(bench.drive(0.5, None)) == {ZERO_VELOCITY}
    assert bench.mux.fault is not None
    assert "broken" in bench.mux.fault.reason
    assert bench.mux.latched == bench.mux.fault.reason
    assert len(bench.faults) == 1
    setattr(bench.mux, broken, good)
    assert set(bench.drive(0.5)) == {ZERO_VELOCITY}
    bench.mux.enable()
    assert bench.drive(0.5)[-1] == AHEAD


class Broken:
    """Something whose methods raise; its attributes do not."""

    def __init__(self, good: object) -> None:
        self._good = good

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._good, name)
        return raising if callable(found) and name not in ("cancel_back_off", "drop", "release") else found


def test_exception_in_the_reflexes_latches_the_base(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Driven()
    bench.drive(0.5)
    monkeypatch.setattr(bench.mux._safety, "update", raising)
    assert set(bench.drive(0.5)) == {ZERO_VELOCITY}
    assert "reflexes failed: RuntimeError: broken" in bench.mux.latched


# --- every base -------------------------------------------------------------------------------------------------------


@pytest.fixture(
    params=[
        simulated(WireBase, "kobuki"),
        simulated(TwinBase, "its twin"),
        simulated(Waveshare, "waveshare"),
        simulated(WaveRover, "wave rover"),
        simulated(PiCar, "pi car"),
        simulated(Topics, "ros 2"),
        simulated(Twin, "plain twin"),
    ]
)
def rig(request: pytest.FixtureRequest) -> Iterator[BaseRig]:
    rig = request.param()
    rig.start()
    yield rig
    with suppress(RuntimeError):
        rig.close()


def under_way(rig: BaseRig) -> Any:
    """Have it drive; return its multiplexer."""
    rig.drive(0.2, 0.0, lambda: rig.device.steering().allowed == AHEAD and rig.truth().x > 0.02)
    return rig.device._mux  # type: ignore[attr-defined]


def goes_on(rig: BaseRig, seconds: float) -> float:
    """Command it for so long; return how far it went after the first 0.3 s."""
    places = []
    for _ in range(round(seconds / 0.02)):
        with suppress(Exception):
            rig.device.drive(AHEAD)
        with suppress(RuntimeError):  # a twin raises it to whoever steps it
            rig.wait(0.02)
        places.append(rig.truth().x)
    return places[-1] - places[15]


def test_exception_in_the_guard_stops_every_base_with_a_report(rig: BaseRig) -> None:
    mux = under_way(rig)
    mux.guard = guard = BrokenGuard()
    guard.broken = True
    assert goes_on(rig, 1.0) == pytest.approx(0.0, abs=1e-3)
    assert rig.told("fault", GUARD_FAILED_REASON)


@pytest.mark.parametrize("part", ["next_velocity", "on_state", "on_report"])
def test_an_error_of_the_multiplexer_stops_every_base(rig: BaseRig, part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mux = under_way(rig)
    monkeypatch.setattr(mux, part, raising)
    before = rig.truth().x
    assert goes_on(rig, 1.5) <= 0.06  # by the last command's end
    at = rig.truth().x
    for _ in range(50):
        with suppress(RuntimeError):
            rig.wait(0.02)
    assert rig.truth().x == pytest.approx(at, abs=1e-3)
    assert at - before < 0.15


@pytest.mark.parametrize("kind", [WireBase, Waveshare, WaveRover, PiCar, Topics])
def test_unreadable_report_stops_the_base_at_once(kind: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = kind()
    rig.start()
    under_way(rig)
    parse, failures = rig.device.protocol.parse, iter([True])

    def lose(data: bytes, now: float) -> object:
        found = parse(data, now)  # which may have told of a contact, or of a restart
        if found.states and next(failures, False):
            raise RuntimeError("broken")
        return found

    monkeypatch.setattr(rig.device.protocol, "parse", lose)
    before = rig.truth().x
    for _ in range(10):
        rig.wait(0.02)
    assert next(failures, None) is None
    assert rig.device.steering().allowed == ZERO_VELOCITY
    assert rig.truth().x - before < 0.03
    rig.drive(0.2, 0.0, lambda: rig.device.steering().allowed == AHEAD)  # it goes on when it is commanded anew
    rig.close()


# --- scans that cannot be used ----------------------------------------------------------------------------------------


def scan(ranges: object, *, start: float = 0.0, step: float = 0.0175, stamp: float | None = None) -> Callable[..., Any]:
    return lambda now: RangeScan(ranges, start, step, now if stamp is None else stamp, 10**6, 0.1, 12.0)  # type: ignore[arg-type]


FULL = np.full(360, 3.0, np.float32)


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (scan(np.empty(0, np.float32)), "no beams"),
        (scan(np.full((2, 180), 3.0, np.float32)), "one dimension"),
        (scan([3.0] * 360), "one dimension"),
        (scan(FULL, step=0.0), "step of 0.0"),
        (scan(FULL, step=-0.1), "step of -0.1"),
        (scan(FULL, step=nan), "step of nan"),
        (scan(FULL, start=inf), "begins at inf"),
        (scan(FULL, stamp=nan), "time nan"),
    ],
)
def test_unusable_scan_stops_the_base_with_a_reason(made: Callable[[float], RangeScan], said: str) -> None:
    ranger = ScriptedRanger()
    room = GuardedBase(ranger=ranger)
    numbers = iter(range(1, 10_000))
    room.drive(0.4, seconds=1.0, each=lambda: ranger.see(room.now, number=next(numbers)))
    assert room.base.body.velocity.linear > 0.3

    def look() -> None:
        ranger.value = made(room.now)

    room.drive(0.4, seconds=1.2, each=look)
    assert room.base.body.velocity == ZERO_VELOCITY
    assert room.because.startswith(SCANS_MISSING_REASON)
    assert said in room.because
    assert sum(said in each for each in room.faults) == 1
    room.drive(0.4, seconds=1.0, each=lambda: ranger.see(room.now, number=next(numbers)))
    assert room.base.body.velocity.linear > 0.3


@pytest.mark.parametrize("place", ["_points.add", "_poses.at", "_outline.clearance", "_poses.newest"])
def test_an_error_in_any_part_of_the_range_guard_stops_the_base(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    room = GuardedBase()
    room.drive(0.4, seconds=1.0)
    owner, name = place.split(".")
    monkeypatch.setattr(getattr(room.base._mux.guard, owner), name, raising)
    room.drive(0.4, seconds=5.5 if name == "clearance" else 1.0)
    if name != "clearance" or room.because:  # it is asked where something is near
        assert room.base.body.velocity == ZERO_VELOCITY
        assert GUARD_FAILED_REASON in room.because
    room.base.stop()
    room.run(1.0)
    assert room.base.body.velocity == ZERO_VELOCITY
