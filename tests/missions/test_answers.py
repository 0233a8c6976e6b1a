"""What a robot's parts answer within a moment: once each, anew after a command, and all of it kept in order."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.leaf import Leaf
from behaviours.robot import Robot
from drivers.api import Coupling, Device, HeadPose, Lamp, Reading, Source, Tune, Velocity
from drivers.errors import BadRequest, DeviceFault, DriverError, NotConnected
from missions.executive.proxied_robot import with_proxies
from missions.executive.tick_cache import TickCache
from missions.executive.tick_record import Answer
from missions.plugins.testing.recorders import LeafTestBench, good

FORWARD = Velocity(0.2, 0.0)
LEFT = HeadPose(0.5, 0.0)


class Moments:
    """A robot of recorders, asked through answers that are kept; ``asked`` counts what reached its head."""

    def __init__(self) -> None:
        self.bench = LeafTestBench()
        self.answers = TickCache()
        self.answers.is_recording = True
        self.refusal: DriverError | None = None
        self.asked = 0
        self.pose: Callable[[], Reading[HeadPose]] = self.bench.head.pose
        self.bench.head.pose = self._pose  # type: ignore[method-assign] # to count
        self.robot = with_proxies(self.bench.robot, self.answers, self._permit)

    def _pose(self) -> Reading[HeadPose]:
        self.asked += 1
        return self.pose()

    def _permit(self, device: Device, leaf: Leaf | None) -> None:
        del device, leaf
        if self.refusal is not None:
            raise self.refusal

    def begin(self) -> None:
        self.answers.is_open = True

    def said(self) -> list[Answer]:
        """End the moment, and return what was said in it."""
        return self.answers.take_answers()


@pytest.fixture
def moments() -> Moments:
    return Moments()


# --- questions --------------------------------------------------------------------------------------------------------


def test_part_is_queried_once_per_tick(moments: Moments) -> None:
    moments.begin()
    first = moments.robot.head.pose()
    moments.bench.head.reading = good(LEFT)
    assert moments.robot.head.pose() is first
    assert (moments.asked, moments.said()) == (1, [("head", "pose", (), first)])


def test_part_is_queried_again_in_the_next_tick(moments: Moments) -> None:
    for number in (1, 2):
        moments.begin()
        moments.robot.head.pose()
        moments.said()
        assert moments.asked == number


def test_queries_outside_a_tick_are_neither_cached_nor_recorded(moments: Moments) -> None:
    moments.robot.head.pose()
    moments.robot.head.pose()
    moments.robot.head.look(LEFT)
    assert (moments.asked, moments.said()) == (2, [])


def test_answers_are_not_recorded_while_recording_is_off(moments: Moments) -> None:
    moments.answers.is_recording = False
    moments.begin()
    moments.robot.head.pose()
    moments.robot.head.look(LEFT)
    assert moments.said() == []


def test_nothing_is_an_answer_too(moments: Moments) -> None:
    moments.bench.sight.searched = None
    moments.begin()
    assert [moments.robot.sight.looked() for _ in range(2)] == [None, None]
    assert moments.said() == [("sight", "looked", (), None)]


def test_query_is_cached_per_argument(moments: Moments) -> None:
    moments.begin()
    for stamp in (1.0, 2.0, 1.0):
        moments.robot.base.heading_at(stamp)
    assert moments.said() == [("base", "heading_at", (1.0,), 0.0), ("base", "heading_at", (2.0,), 0.0)]


def test_all_parts_are_recorded_under_their_names(moments: Moments) -> None:
    robot, sight = moments.robot, moments.robot.sight
    moments.begin()
    found: list[object] = [robot.base.state(), robot.base.latched, robot.base.limits, robot.base.steering()]
    found += [robot.head.limits, robot.head.pose_at(1.0), robot.arm.limits, robot.arm.states(), robot.arm.health()]
    found += [robot.ranger.place, robot.ranger.scan()]
    found += [sight.faces(), sight.things(), sight.markers(), sight.looked(), sight.scene()]
    said = moments.said()
    assert [value for *_, value in said] == found
    assert [f"{part}.{what}" for part, what, _, _ in said] == [
        *("base.state", "base.latched", "base.limits", "base.steering"),
        *("head.limits", "head.pose_at", "arm.limits", "arm.states", "arm.health"),
        *("ranger.place", "ranger.scan"),
        *("sight.faces", "sight.things", "sight.markers", "sight.looked", "sight.scene"),
    ]


def test_robot_without_parts_gets_no_proxies() -> None:
    assert with_proxies(Robot(), TickCache()) == Robot()


# --- commands ---------------------------------------------------------------------------------------------------------


def test_command_invalidates_only_the_answers_of_its_part(moments: Moments) -> None:
    moments.begin()
    before = moments.robot.head.pose()
    moments.robot.base.drive(FORWARD)
    assert moments.robot.head.pose() is before
    moments.bench.head.reading = good(LEFT)
    moments.robot.head.look(LEFT)
    assert moments.robot.head.pose().value == LEFT
    assert moments.said() == [
        ("head", "pose", (), before),
        ("base", "drive", (FORWARD, Source.MISSION), FORWARD),
        ("head", "look", (LEFT,), LEFT),
        ("head", "pose", (), good(LEFT)),
    ]


def test_commands_are_recorded_with_all_arguments(moments: Moments) -> None:
    base, arm, goals = moments.robot.base, moments.robot.arm, {"elbow": 0.5}
    moments.begin()
    base.stop(source=Source.MISSION)
    base.sounds.play(Tune.ON)  # type: ignore[union-attr]
    base.sounds.tone(440.0, 0.1)  # type: ignore[union-attr]
    base.lights.light(1, Lamp.RED)  # type: ignore[union-attr]
    base.latch("enough")
    base.enable()
    base.rest()
    arm.move(goals, speeds={"elbow": 1.0})
    goals["elbow"] = 0.0  # the leaf's own again
    arm.hold()
    arm.relax(["elbow"])
    arm.follow([])
    moments.robot.head.stop()
    assert [(f"{part}.{what}", arguments) for part, what, arguments, _ in moments.said()] == [
        ("base.stop", (Source.MISSION,)),
        ("base.play", (Tune.ON,)),
        ("base.tone", (440.0, 0.1)),
        ("base.light", (1, Lamp.RED)),
        ("base.latch", ("enough",)),
        ("base.enable", ()),
        ("base.rest", ()),
        ("arm.move", ({"elbow": 0.5}, {"elbow": 1.0})),
        ("arm.hold", (None,)),
        ("arm.relax", (("elbow",),)),
        ("arm.follow", ((),)),
        ("head.stop", ()),
    ]


def test_utterances_are_recorded_by_number(moments: Moments) -> None:
    moments.begin()
    first, second = moments.robot.voice.say("one"), moments.robot.voice.say("two")
    assert [first.done(), second.done(), first.done()] == [False, False, False]
    second.cancel()
    assert [first.done(), second.done()] == [False, True]
    assert [(what, arguments, value) for _, what, arguments, value in moments.said()] == [
        ("say", ("one", None, None), 1),
        ("say", ("two", None, None), 2),
        ("done", (1,), False),
        ("done", (2,), False),
        ("cancel", (2,), None),
        ("done", (1,), False),
        ("done", (2,), True),
    ]


# --- what goes wrong --------------------------------------------------------------------------------------------------


def test_an_error_of_a_driver_is_an_answer_and_raised_again_alike(moments: Moments) -> None:
    error = NotConnected("the cable is out", hint="plug it in")

    def gone() -> Reading[HeadPose]:
        raise error

    moments.pose = gone
    moments.begin()
    for _ in range(2):
        with pytest.raises(NotConnected) as caught:
            moments.robot.head.pose()
        assert caught.value is error
    assert moments.asked == 1
    moments.robot.base.stop()
    with pytest.raises(NotConnected):
        moments.robot.head.pose()
    moments.robot.head.stop()
    moments.pose = lambda: good(LEFT)
    assert moments.robot.head.pose().value == LEFT
    assert [value for part, _, _, value in moments.said() if part == "head"] == [error, None, good(LEFT)]


def test_cached_error_expires_with_its_tick(moments: Moments) -> None:
    moments.bench.base.heading_at = _unknown  # type: ignore[method-assign] # a driver that cannot say
    for _ in range(2):
        moments.begin()
        for _ in range(2):
            with pytest.raises(BadRequest):
                moments.robot.base.heading_at(1.0)
        assert [value.args for *_, value in moments.said() if isinstance(value, BadRequest)] == [("no such time",)]


def _unknown(stamp: float) -> float | None:
    del stamp
    raise BadRequest("no such time")


def test_failed_command_is_recorded_with_its_error(moments: Moments) -> None:
    moments.bench.base.trouble = error = DeviceFault("blocked")
    moments.begin()
    with pytest.raises(DeviceFault, match="blocked"):
        moments.robot.base.drive(FORWARD)
    assert moments.said() == [("base", "drive", (FORWARD, Source.MISSION), error)]


def test_commands_without_a_permit_are_refused(moments: Moments) -> None:
    robot, bench = moments.robot, moments.bench
    moments.refusal = DeviceFault("kept still")
    moves: list[Callable[[], object]] = [
        lambda: robot.base.drive(FORWARD),
        lambda: robot.head.look(LEFT),
        lambda: robot.arm.move({"elbow": 0.5}),
        lambda: robot.arm.follow([Coupling("elbow", "wrist")]),
        robot.arm.recover,
    ]
    moments.begin()
    for move in moves:
        with pytest.raises(DeviceFault, match="kept still"):
            move()
    assert [value for *_, value in moments.said()] == [moments.refusal] * 5
    assert (bench.base.commands, bench.head.commands, bench.arm.commands) == ([], [], [])


def test_stop_and_hold_commands_need_no_permit(moments: Moments) -> None:
    moments.refusal = DeviceFault("kept still")
    moments.robot.base.stop()
    moments.robot.head.stop()
    moments.robot.arm.hold()
    moments.robot.arm.relax()
    moments.robot.arm.follow(())
    assert len(moments.bench.arm.commands) == 3


# --- what nobody asks -------------------------------------------------------------------------------------------------


def test_sample_adds_missing_queries_and_reads_constants_once(moments: Moments) -> None:
    moments.begin()
    moments.robot.head.pose()
    moments.answers.sample()
    questions = [(part, what) for part, what, _, _ in moments.said()]
    assert len(questions) == len({*questions})
    assert questions[0] == ("head", "pose")
    assert {("base", "limits"), ("base", "steering"), ("arm", "states"), ("ranger", "scan")} < {*questions}
    moments.begin()
    moments.answers.sample()
    assert not {"limits", "place"} & {what for _, what, _, _ in moments.said()}


def test_failing_part_does_not_prevent_the_sampling_of_others(
    moments: Moments, caplog: pytest.LogCaptureFixture
) -> None:
    error = NotConnected("the cable is out")

    def gone() -> Reading[HeadPose]:
        raise error

    def broken() -> Reading[HeadPose]:
        raise KeyError("pan")

    for pose in (gone, broken):
        moments.pose = pose
        moments.begin()
        with caplog.at_level(logging.ERROR, "missiontree"):
            moments.answers.sample()
        assert ("sight", "looked", (), 100.0) in moments.said()
    assert caplog.messages == ["the state of the robot could not be read"]


# --- enough to decide over again --------------------------------------------------------------------------------------


@dataclass
class Replayed:
    """A head that gives the answers that were kept, in their order."""

    left: list[Answer] = field(default_factory=list)
    name = "head"

    def answer(self, what: str) -> object:
        kept = self.left.pop(0)
        assert kept[:2] == ("head", what)
        return kept[3]


@given(st.lists(st.sampled_from(["pose", "pose", "look", "turn", "end"]), max_size=30))
def test_recorded_answers_can_be_replayed(doings: list[str]) -> None:
    moments = Moments()
    told: list[object] = []
    kept: list[Answer] = []
    moments.begin()
    for number, doing in enumerate(doings):
        match doing:
            case "pose":
                told.append(moments.robot.head.pose())
            case "look":
                told.append(moments.robot.head.look(LEFT))
            case "turn":  # by itself, while nobody looks
                moments.bench.head.reading = good(HeadPose(0.1 * number, 0.0))
            case "end":
                kept += moments.said()
                moments.begin()
    again = Replayed(kept + moments.said())
    assert _again(again, doings) == told
    assert again.left == []


def _again(head: Replayed, doings: list[str]) -> list[object]:
    """Do all again with a head that only knows what was kept."""
    moments = Moments()
    moments.pose = lambda: head.answer("pose")  # type: ignore[assignment,return-value] # of any type
    told: list[object] = []
    moments.begin()
    for doing in doings:
        match doing:
            case "pose":
                told.append(moments.robot.head.pose())
            case "look":
                moments.robot.head.look(LEFT)
                told.append(head.answer("look"))
            case "end":
                moments.said()
                moments.begin()
    return told
