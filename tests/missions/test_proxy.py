"""What a generated proxy does with a command, a question and a property, and that it has all that its protocol has."""

import inspect
import sys
import traceback
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import pytest

from behaviours.leaf import Leaf
from behaviours.robot import Robot
from behaviours.voice import Say
from drivers.api import Coupling, Device, HeadPose, Lamp, Mood, Source, Tune, Velocity
from drivers.api.kinds import KINDS
from drivers.api.marks import command, fixed, members
from drivers.clock import ManualClock
from drivers.errors import BadRequest, DeviceFault
from missions.executive.proxied_robot import PART_FIELDS, command_names, resolve_protocol, robot_for, with_proxies
from missions.executive.proxy import CommandReport, Permit, for_leaf, make_proxy, permit_all
from missions.executive.tick_cache import TickCache
from missions.plugins.records.replay.recorded_answers import RecordedAnswers
from missions.plugins.records.replay.rerun import recorded_robot
from missions.plugins.testing.recorders.bench import LeafTestBench


class Winch(Device, Protocol):
    """A part that no robot of ours has."""

    @property
    @fixed
    def rope(self) -> float: ...

    @property
    def jammed(self) -> bool: ...

    @command(
        "after",
        moves=lambda length, hooks: length > 0.0,  # noqa: ARG005 - with whatever hooks
        converters={"hooks": tuple},
    )
    def lift(self, length: float, *, hooks: tuple[str, ...] | None = None) -> float: ...

    @command("before", leaf_converters={"who": lambda _: "leaf"})
    def drop(self, who: str = "") -> None: ...

    def load(self) -> float: ...

    def load_at(self, stamp: float) -> float: ...


class Deck:
    """A winch, and all that happens to it, to those who permit it, and to those who are told, in one row."""

    name = "winch"
    rope = 12.0
    jammed = False

    def __init__(self) -> None:
        self.row: list[object] = []
        self.trouble: Exception | None = None

    def open(self) -> None:
        self.row.append("open")

    def close(self) -> None:
        self.row.append("close")

    def rest(self) -> None:
        self.row.append("rest")

    def health(self) -> Any:
        return "well"

    def lift(self, length: float, *, hooks: tuple[str, ...] | None = None) -> float:
        self.row.append(("lift", length, hooks))
        if self.trouble is not None:
            raise self.trouble
        return min(length, self.rope)

    def drop(self, who: str = "") -> None:
        self.row.append(("drop", who))

    def load(self) -> float:
        self.row.append("load")
        return 3.0

    def load_at(self, stamp: float) -> float:
        self.row.append(("load_at", stamp))
        return stamp

    def permit(self, device: Device, leaf: Leaf | None) -> None:
        assert (device, leaf) == (self, None)
        self.row.append("permit")

    def tell(self, to: str, source: str, values: Mapping[str, object]) -> None:
        assert (to, source) == ("winch", "hoist")
        self.row.append(values)


@pytest.fixture
def deck() -> Deck:
    return Deck()


@pytest.fixture
def answers() -> TickCache:
    answers = TickCache()
    answers.is_recording = answers.is_open = True
    return answers


def winches(deck: Deck, answers: TickCache) -> tuple[Winch, Winch]:
    """Return the winch of the executive, and that of a leaf."""
    winch: Winch = make_proxy("winch", Winch, deck, answers, deck.permit)
    return winch, for_leaf(winch, "hoist", deck.tell)


def test_command_is_permitted_then_executed_then_reported(deck: Deck, answers: TickCache) -> None:
    _, leafs = winches(deck, answers)
    assert leafs.lift(20.0, hooks=["left"]) == 12.0  # type: ignore[arg-type] # a list is kept as a tuple
    told = {"lift": 20.0, "hooks": ["left"]}
    assert deck.row == ["permit", ("lift", 20.0, ("left",)), told]
    assert answers.take_answers() == [("winch", "lift", (20.0, ("left",)), 12.0)]


def test_stop_command_is_reported_first_and_needs_no_permit(deck: Deck, answers: TickCache) -> None:
    _, leafs = winches(deck, answers)
    leafs.rest()
    assert deck.row == [{"rest": True}, "rest"]


def test_command_without_motion_needs_no_permit(deck: Deck, answers: TickCache) -> None:
    winch, _ = winches(deck, answers)
    winch.drop("crew")
    winch.lift(0.0)
    assert deck.row == [("drop", "crew"), ("lift", 0.0, None)]


def test_refused_command_is_recorded_but_not_reported(deck: Deck, answers: TickCache) -> None:
    _, leafs = winches(deck, answers)
    deck.trouble = fault = DeviceFault("the rope is torn")
    with pytest.raises(DeviceFault, match="torn"):
        leafs.lift(1.0)
    assert deck.row == ["permit", ("lift", 1.0, None)]
    assert answers.take_answers() == [("winch", "lift", (1.0, None), fault)]


def test_proxy_replaces_reserved_arguments_only_for_leaves(deck: Deck, answers: TickCache) -> None:
    winch, leafs = winches(deck, answers)
    winch.drop("crew")
    leafs.drop("crew")
    assert deck.row == [("drop", "crew"), {"drop": "leaf"}, ("drop", "leaf")]


def test_leaf_drives_and_stops_only_as_the_mission() -> None:
    bench = LeafTestBench()
    stops: list[Source | None] = []
    bench.base.stop = lambda *, source=None: stops.append(source)  # type: ignore[method-assign]
    robot = with_proxies(bench.robot, TickCache())
    leafs = robot_for(bench.put(Say("say")), robot, lambda *_: None)
    with pytest.raises(BadRequest, match="a mission's behaviour cannot drive as 'teleop'"):
        leafs.base.drive(Velocity(0.1, 0.0), source=Source.TELEOP)
    assert bench.base.commands == []
    leafs.base.stop()
    leafs.base.stop(source=Source.TELEOP)
    robot.base.stop()
    assert stops == [Source.MISSION, Source.MISSION, None]


def leafs_robot(bench: LeafTestBench, report: CommandReport = lambda *_: None, permit: Permit = permit_all) -> Robot:
    """Return the robot of a leaf that is ticked now."""
    leaf = bench.run.active_leaf = bench.put(Say("say"))
    return robot_for(leaf, with_proxies(bench.robot, TickCache(), permit), report)


def test_leaf_cannot_enable_a_part_stopped_by_a_person() -> None:
    def stopped(*_: object) -> None:
        raise DeviceFault("stopped by Ann")

    bench = LeafTestBench()
    leafs = leafs_robot(bench, permit=stopped)
    bench.base.latch("it has fallen")
    with pytest.raises(DeviceFault, match="Ann"):
        leafs.base.enable()
    assert bench.base.latched == "it has fallen"


def test_commands_are_reported_in_terms_of_missions() -> None:
    bench, told = LeafTestBench(), list[Mapping[str, object]]()
    leafs = leafs_robot(bench, lambda *each: told.append(each[2]))
    leafs.base.drive(Velocity(0.12345, 0.0))
    bench.base.drive = lambda *_, **__: Velocity(0.1, 0.0)  # type: ignore[method-assign]
    leafs.base.drive(Velocity(0.2, 0.0))
    leafs.base.stop()
    leafs.base.latch("enough")
    leafs.base.enable()
    leafs.base.sounds.play(Tune.ON)  # type: ignore[union-attr]
    leafs.base.sounds.tone(440.0, 0.1)  # type: ignore[union-attr]
    leafs.base.lights.light(1, Lamp.RED)  # type: ignore[union-attr]
    leafs.head.look(HeadPose(2.0, 0.12345))
    leafs.head.stop()
    leafs.arm.follow([Coupling("elbow", "wrist")])
    leafs.screen.mood(Mood.HAPPY)
    leafs.screen.show("Hello")
    leafs.screen.mouth(0.5)
    assert told == [
        {"linear": 0.1235, "angular": 0.0},
        {"linear": 0.1, "angular": 0.0, "requested_linear": 0.2, "requested_angular": 0.0},
        {"linear": 0.0, "angular": 0.0},
        {"latch": "enough"},
        {"enable": True},
        {"tune": "on"},
        {"tone": 440.0, "seconds": 0.1},
        {"light": 1, "colour": "red"},
        {"pan": 1.4, "tilt": 0.1235},
        {"stop": True},
        {"follow": {"wrist": "elbow"}},
        {"mood": "happy"},
        {"show": "Hello"},
    ]


def test_proxy_adds_one_call_between_leaf_and_driver() -> None:
    bench, depths = LeafTestBench(), list[int]()

    def drive(velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        del source
        depths.append(len(inspect.stack(0)))
        return velocity

    bench.base.drive = drive  # type: ignore[method-assign]
    leafs = leafs_robot(bench)
    drive(Velocity(0.1, 0.0))
    leafs.base.drive(Velocity(0.1, 0.0))
    assert depths[1] - depths[0] == 1


def test_readings_are_looked_up_and_properties_too(deck: Deck, answers: TickCache) -> None:
    winch, leafs = winches(deck, answers)
    calls: list[str] = []
    assert (winch.load(), leafs.load(), winch.load_at(1.5), leafs.load_at(1.5)) == (3.0, 3.0, 1.5, 1.5)
    assert deck.row == ["load", ("load_at", 1.5)]
    sys.setprofile(lambda frame, event, _: calls.append(frame.f_code.co_name) if event == "call" else None)
    try:
        leafs.load()
    finally:
        sys.setprofile(None)
    assert calls == []  # a second look within the moment costs no call of ours
    assert (leafs.rope, leafs.jammed, leafs.name) == (12.0, False, "winch")


def test_sample_reads_sampled_queries_and_constants_once(deck: Deck, answers: TickCache) -> None:
    winches(deck, answers)
    for expected in (["rope", "load"], ["load"]):
        answers.is_open = True
        answers.sample()
        assert [what for _, what, _, _ in answers.take_answers()] == expected


def test_opening_and_closing_are_the_devices_own_and_not_for_leaves(deck: Deck, answers: TickCache) -> None:
    winch, leafs = winches(deck, answers)
    winch.open()
    winch.close()
    for call in (leafs.open, leafs.close):
        with pytest.raises(BadRequest, match=r"winch: a behaviour cannot (open|close) a part of its robot"):
            call()
    assert (deck.row, answers.take_answers()) == (["open", "close"], [])


def test_a_leafs_robot_is_made_of_proxies_alone() -> None:
    bench = LeafTestBench()
    with pytest.raises(TypeError, match="is not a proxy"):
        robot_for(bench.put(Say("say")), Robot(base_part=bench.base), lambda *_: None)


def test_a_traceback_shows_the_source_of_a_proxy(deck: Deck, answers: TickCache) -> None:
    winch, _ = winches(deck, answers)
    deck.trouble = DeviceFault("the rope is torn")
    with pytest.raises(DeviceFault) as caught:
        winch.lift(1.0)
    assert "self._device.lift(length, hooks=hooks)" in "".join(traceback.format_exception(caught.value))


# --- all parts --------------------------------------------------------------------------------------------------------


def replayed() -> Robot:
    memory = RecordedAnswers(on_unanswered=lambda _: None, on_different_command=lambda *_: None)
    return recorded_robot(frozenset(KINDS), memory, ManualClock().now, eye=(0.0, 0.0, 1.0), groups={})


@pytest.mark.parametrize(
    "make", [lambda: with_proxies(LeafTestBench().robot, TickCache()), replayed], ids=["proxy", "replay"]
)
def test_each_part_has_the_methods_of_its_protocol(make: Callable[[], Robot]) -> None:
    robot = make()
    for part in PART_FIELDS:
        device = getattr(robot, f"{part}_part")
        for name, member in members(resolve_protocol(part)).items():
            if member.protocol is not None:
                assert set(members(member.protocol)) <= set(dir(getattr(device, name))), f"{part}.{name}"
            elif "property" not in member.kind:
                assert callable(getattr(device, name)), f"{part}.{name}"


def test_proxies_take_the_arguments_of_their_protocols() -> None:
    robot = with_proxies(LeafTestBench().robot, TickCache())
    for part in PART_FIELDS:
        for name, member in members(resolve_protocol(part)).items():
            if member.kind in {"command", "question"}:
                taken = inspect.signature(getattr(getattr(robot, f"{part}_part"), name)).parameters.values()
                wanted = [(each.name, each.kind, each.default) for each in member.parameters]
                assert [(each.name, each.kind, each.default) for each in taken] == wanted, f"{part}.{name}"


RECORDED: Mapping[str, set[str]] = {
    "base": {"drive", "stop", "latch", "enable", "play", "tone", "light", "rest"},
    "head": {"look", "stop", "rest"},
    "arm": {"move", "hold", "relax", "follow", "recover", "rest"},
    "ranger": {"rest"},
    "voice": {"say", "play", "cancel", "rest"},
    "sight": set(),
    "hearing": set(),
    "screen": {"mood", "show", "mouth", "rest"},
}
"""The commands that records hold."""

ANSWERED = {
    "base": {"limits", "latched", "state", "steering", "heading_at", "health"},
    "head": {"limits", "pose", "pose_at", "health"},
    "arm": {"limits", "states", "health"},
    "ranger": {"place", "scan", "health"},
    "voice": {"speaking", "health"},
    "sight": {"faces", "things", "markers", "looked", "scene"},
    "hearing": {"listened", "words", "refused", "level"},
    "screen": {"content", "health"},
}
"""The questions whose answers records hold."""


def test_recorded_names_are_still_commands_or_queries() -> None:
    """Records of every version are read by this; what is new since then, they do not hold."""
    for part, recorded in RECORDED.items():
        assert recorded <= command_names(part), part
        assert not ANSWERED[part] & command_names(part), part
        assert ANSWERED[part] <= members(resolve_protocol(part)).keys(), part


# --- replay -----------------------------------------------------------------------------------------------------------


def test_a_changed_command_is_answered_within_the_limits_of_then() -> None:
    bench = LeafTestBench()
    changed: list[str] = []
    memory = RecordedAnswers(
        on_unanswered=changed.append, on_different_command=lambda _, __, now: changed.append(str(now))
    )
    robot = recorded_robot({"base", "head", "arm"}, memory, ManualClock().now, eye=(0.0, 0.0, 1.0), groups={})
    memory.begin_tick(
        [(part, "limits", (), getattr(bench.robot, f"{part}_part").limits) for part in ("base", "head", "arm")]
    )
    assert robot.base.drive(Velocity(2.0, -9.0), source=Source.MISSION) == Velocity(0.5, -bench.base.limits.turn)
    assert robot.head.look(HeadPose(2.0, 0.1)) == HeadPose(1.4, 0.1)
    assert robot.arm.move({"elbow": 3.0, "shoulder": 0.5}, speeds=None) == {"elbow": 2.2, "shoulder": 0.5}
    assert robot.arm.recover() == ()
    assert (robot.head.stop(), robot.base.latch("enough")) == (None, None)
    assert len(changed) == 6
