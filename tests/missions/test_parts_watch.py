"""The levels of a robot's parts: what makes each, and how old what they measured is."""

from dataclasses import replace
from math import nan

from behaviours.robot import Robot
from drivers.api import ZERO_VELOCITY, BaseState, HeadPose, Health, JointState, Pose2D, Quality, Reading
from drivers.clock import ManualClock
from missions.executive.events import Event, ReflexFired
from missions.executive.parts import PartsMonitor, PartStatus
from missions.plugins.testing.recorders.bench import RecordedBase, RecordedHead, RecordedJoints


class Base(RecordedBase):
    """A base whose health the test sets."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__(clock)
        self.well = Health(online=True)

    def health(self) -> Health:
        return self.well


class Stand:
    """A robot of a base and a head, with whoever watches it."""

    def __init__(self) -> None:
        clock = ManualClock()
        self.base, self.head = Base(clock), RecordedHead(clock)
        self.looked: float | None = None
        robot = Robot(base_part=self.base, head_part=self.head)
        devices = {"base": self.base, "head": self.head}
        self.watch = PartsMonitor(devices, robot, lambda: self.looked)

    def look(self, now: float = 0.0) -> PartStatus:
        """Return how the base is."""
        return self.watch.check(now)[0]

    def hear(self, what: str, *, on: bool) -> None:
        event: Event = ReflexFired(0.0, 0, what, "", on)
        self.watch.on_event(event)


def test_healthy_part_is_ok_with_values_and_age() -> None:
    stand = Stand()
    stand.head.reading = Reading(HeadPose(0.5, -0.25), 1.0, Quality.GOOD)
    assert stand.watch.check(1.25)[1] == PartStatus("head", "OK", 0.25, {"pan": 0.5, "tilt": -0.25})


def test_disconnected_part_is_an_error_with_a_hint() -> None:
    stand = Stand()
    stand.base.well = Health(False, "base: /dev/kobuki: no such device", "plug it in")
    state = stand.look()
    assert (state.level, state.detail, state.hint) == ("ERROR", "/dev/kobuki: no such device", "plug it in")


def test_latched_base_is_an_error_until_enabled() -> None:
    stand = Stand()
    stand.base.latched = "by hand"
    assert (stand.look().level, stand.look().detail) == ("ERROR", "stopped until it is enabled: by hand")
    stand.base.latched = ""
    assert stand.look().level == "OK"


def test_old_reading_is_stale_and_missing_reading_has_no_age() -> None:
    stand = Stand()
    stand.base.reading = replace(stand.base.reading, quality=Quality.STALE)
    state = stand.look(7.0)
    assert (state.level, state.age, state.detail) == ("STALE", 7.0, "no new reading")
    stand.base.reading = Reading(None, 7.0, Quality.NONE)
    state = stand.look(7.0)
    assert (state.level, state.age, state.detail) == ("STALE", None, "no reading yet")


def test_part_with_a_problem_is_a_warning() -> None:
    stand = Stand()
    stand.base.well = Health(True, "the adapter is slow", "a new one")
    state = stand.look()
    assert (state.level, state.detail, state.hint) == ("WARN", "the adapter is slow", "a new one")


def test_low_battery_is_a_warning_and_critical_battery_an_error() -> None:
    stand = Stand()
    levels = []
    for what, on in (("battery_low", True), ("battery_critical", True), ("battery_critical", False), ("bumper", True)):
        stand.hear(what, on=on)
        levels.append(stand.look().level)
    stand.hear("battery_low", on=False)
    assert [*levels, stand.look().level] == ["WARN", "ERROR", "WARN", "WARN", "OK"]


def test_missed_replies_are_a_warning_for_two_seconds() -> None:
    stand = Stand()
    levels = []
    for now, misses in ((0.0, 3), (0.5, 3), (1.0, 5), (2.5, 5), (3.5, 5)):
        stand.base.well = Health(online=True, counters={"misses": misses, "misses of one": misses})
        levels.append(stand.look(now).level)
        if now == 1.0:
            assert stand.look(now).detail == "2 replies missed within 2 s"
    assert levels == ["OK", "OK", "WARN", "WARN", "OK"]


def test_nan_values_of_a_part_are_omitted() -> None:
    stand = Stand()
    stand.base.reading = Reading(BaseState(Pose2D(nan, 0.0, 0.0), ZERO_VELOCITY), 0.0, Quality.GOOD)
    assert "x" not in stand.look().values
    assert stand.look().values["y"] == 0.0


def test_arm_status_names_silent_joints_and_has_the_oldest_age() -> None:
    joint = JointState(0.0, 0.0, None, 0.0, 12.0, 40.0, moving=True, torque=True)
    clock = ManualClock()
    arm = RecordedJoints(clock)
    readings = {
        "elbow": Reading(joint, 4.0, Quality.GOOD),
        "wrist": Reading(replace(joint, temperature=55.0, moving=False), 1.0, Quality.STALE),
    }
    arm.readings = readings
    (state,) = PartsMonitor({"arm": arm}, Robot(arm_part=arm)).check(5.0)
    figures = {"joints": 2.0, "moving": 1.0, "hottest": 55.0}
    assert state == PartStatus("arm", "STALE", 4.0, figures, "silent: wrist")


def test_camera_without_new_pictures_is_stale() -> None:
    stand = Stand()
    camera = PartsMonitor({"camera": stand.head}, Robot(), lambda: stand.looked)
    assert camera.check(9.0)[0].level == "OK"
    stand.looked = 8.5
    assert (camera.check(9.0)[0].level, camera.check(9.0)[0].age) == ("OK", 0.5)
    assert (camera.check(12.0)[0].level, camera.check(12.0)[0].detail) == ("STALE", "no new picture")
