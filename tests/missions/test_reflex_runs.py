"""Whole runs in simulated time: what a base does by itself, what its battery ends, and what a range finder tells."""

from collections.abc import Callable
from functools import partial
from io import StringIO
from pathlib import Path

import pytest

from drivers.api import Sides
from drivers.base.twin import BaseTwin
from missions.cli.live import REFLEX_TEXTS as SHOWN
from missions.cli.live import RunDisplay
from missions.executive.events import CommandSent, Event, Logged, ReflexFired
from missions.executive.executive import Result
from missions.executive.guard import REFLEXES
from missions.request import RunRequest
from missions.runner import Runner

FAR = "drive: {distance: 3 m, speed: 0.2 m/s}"


class Ran:
    """One run of a tree on a TurtleBot in an empty room; ``events`` is what was told."""

    def __init__(self, folder: Path, tree: str, hands: dict[float, Callable[[BaseTwin], None]] | None = None) -> None:
        mission = folder / "m.yaml"
        mission.write_text(f"mission: m\ntree: {{{tree}}}\n", encoding="utf-8")
        self.events: list[Event] = []
        order = RunRequest(str(mission), robot="turtlebot2", simulate="fast", world="empty", eyes="truth")
        runner = Runner(order, listeners=[self.events.append])
        assert runner.twins is not None
        base = runner.twins.base
        assert base is not None
        for time, hand in (hands or {}).items():
            runner.twins.timeline.call_at(time, partial(hand, base))
        self.result: Result = runner.run()
        self.twins = runner.twins

    def reflexes(self) -> list[tuple[str, str, bool]]:
        return [(each.condition, each.where, each.on) for each in self.events if isinstance(each, ReflexFired)]

    def commands(self, source: str) -> list[CommandSent]:
        return [each for each in self.events if isinstance(each, CommandSent) and each.source == source]


def bump(base: BaseTwin) -> None:
    base.press(Sides(left=True))


def let_go(base: BaseTwin) -> None:
    base.press()


def drain(percent: float) -> Callable[[BaseTwin], None]:
    return lambda base: base.drain(percent)


def press(*numbers: int) -> Callable[[BaseTwin], None]:
    return lambda base: base.press(buttons=frozenset(numbers))


@pytest.mark.parametrize(
    ("where", "who"),
    [("stopped by viewer 1", "viewer 1"), ("stopped by mission stop (process 5)", "`mission stop`")],
)
def test_display_of_a_stop_names_the_command_to_go_on(where: str, who: str) -> None:
    out = StringIO()
    display = RunDisplay(out)
    display(ReflexFired(1.0, 20, "latched", where, on=True))
    assert f"base: stopped by {who}; to go on: mission stop --release --resume" in out.getvalue()


def test_a_critical_battery_ends_a_mission_with_the_base_at_rest(tmp_path: Path) -> None:
    ran = Ran(tmp_path, FAR, {1.0: drain(9.0)})
    assert (ran.result.result, ran.result.reason) == ("failure", "battery critical: 9 %")
    assert 3.0 <= ran.result.seconds <= 3.2
    assert ran.reflexes() == [("battery_low", "9 %", True), ("battery_critical", "9 %", True)]
    twins = ran.twins
    twins.timeline.run_until(twins.timeline.clock.now() + 1.0)
    before = twins.pose()
    twins.timeline.run_until(twins.timeline.clock.now() + 0.1)
    assert twins.pose() == before


def test_a_dip_of_the_battery_ends_nothing(tmp_path: Path) -> None:
    ran = Ran(tmp_path, "drive: 40 cm", {1.0: drain(9.0), 2.5: drain(60.0)})
    assert ran.result.result == "success"
    assert ran.reflexes() == []


def test_a_low_battery_is_for_the_mission_to_see(tmp_path: Path) -> None:
    tree = f"race: [{{{FAR}}}, {{wait: 1 min, until: battery.low}}]"
    ran = Ran(tmp_path, tree, {1.0: drain(20.0)})
    assert ran.result.result == "success"
    assert ran.result.seconds == pytest.approx(3.1, abs=0.15)
    assert ran.reflexes() == [("battery_low", "20 %", True)]


def test_a_bump_in_the_middle_of_a_mission_shows_safety_as_the_source_of_commands(tmp_path: Path) -> None:
    ran = Ran(tmp_path, f"selector: [{{{FAR}}}, {{wait: 3 s}}]", {1.0: bump, 1.3: let_go})
    begun, ended = ran.commands("safety")
    assert 1.0 <= begun.t <= 1.1
    assert begun.values == {"linear": -0.1, "angular": -0.4, "reason": "backing off: bumper left"}
    assert ended.values == {"linear": 0.0, "angular": 0.0}
    assert ran.reflexes() == [("bumper", "left", True), ("bumper", "left", False)]


def test_bump_fails_the_driving_leaf(tmp_path: Path) -> None:
    ran = Ran(tmp_path, FAR, {1.0: bump})
    assert (ran.result.result, ran.result.reason) == ("failure", "bumped into something")


def test_button_latches_the_base_until_the_enable_button(tmp_path: Path) -> None:
    tree = f"selector: [{{{FAR}}}, {{sequence: [{{wait: 1 min, until: not base.stopped}}, {{drive: 20 cm}}]}}]"
    ran = Ran(tmp_path, tree, {1.0: press(0), 1.2: press(), 3.0: press(2), 3.2: press()})
    assert ran.result.result == "success"
    reason = "button 0 was pressed"
    assert ran.reflexes() == [
        ("latched", reason, True),
        ("button", "0", True),
        ("button", "0", False),
        ("latched", reason, False),
        ("button", "2", True),
        ("button", "2", False),
    ]
    (stopped,) = ran.commands("safety")
    assert stopped.values["reason"] == reason
    assert ran.result.seconds > 4.0


def test_a_range_finder_is_read_by_expressions(tmp_path: Path) -> None:
    read = "{log: '${range.ahead / 1 m} ${range.nearest / 1 m} ${base.driver}'}"
    tree = f"sequence: [{{wait: 1 s}}, {read}, {{wait: 10 s, until: range.ahead < 1 m}}]"
    ran = Ran(tmp_path, f"race: [{{{FAR}}}, {{{tree}}}]")
    (line,) = [each.text for each in ran.events if isinstance(each, Logged) and each.level == "info"]
    ahead, nearest, driver = line.split()
    assert driver == "mission"
    assert 0.2 < float(nearest) <= float(ahead) < 12.0
    assert "range" in ran.twins.parts


def test_driving_mission_opens_the_range_finder(tmp_path: Path) -> None:
    assert "range" in Ran(tmp_path, "drive: 10 cm").twins.parts


def test_run_display_shows_latch_and_low_battery() -> None:
    out = StringIO()
    show = RunDisplay(out)
    show(ReflexFired(1.0, 20, "latched", "button 0 was pressed", on=True))
    show(ReflexFired(2.0, 40, "latched", "button 0 was pressed", on=False))
    show(ReflexFired(3.0, 60, "charging", "", on=True))
    show(ReflexFired(4.0, 80, "battery_low", "20 %", on=True))
    assert [line.strip() for line in out.getvalue().splitlines()] == [
        "1.0 s  ! base: stopped until it is enabled: button 0 was pressed",
        "4.0 s  ! base: its battery is low: 20 %",
    ]
    assert SHOWN.keys() < set(REFLEXES)
