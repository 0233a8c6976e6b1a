"""Every way in which a run ends: ``finally`` runs, and moves nothing, even if its leaf claims nothing and tries all."""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest
from py_trees.common import Status

from behaviours.basics import Log
from behaviours.catalogue import LEAVES as LEAVES_OF_OURS
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.robot import Robot, hold_still
from behaviours.run import RunState
from config.diagnostics import SourceText
from drivers.api import HeadPose, Health, Lamp, Velocity, ignore
from drivers.clock import ManualClock
from drivers.errors import DeviceFault
from missions.api import load
from missions.executive.build import build
from missions.executive.events import CommandSent, Event, Logged, NodeChanged
from missions.executive.executive import HALT_TIMEOUT, Executive
from missions.executive.guard import BaseGuard
from missions.executive.proxied_robot import StaleCommandGuard, robot_for, with_proxies
from missions.executive.stream import EventStream
from missions.executive.tick_cache import TickCache
from missions.language.document import check_plan
from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS, CaseRunner
from missions.plugins.testing.recorders.bench import LeafTestBench
from missions.plugins.testing.recorders.senses import HOLD, STOP
from missions.request import RunRequest
from missions.runner import Runner
from tests.missions.testing.playing import cases

LEAVES = '''
import time
from contextlib import suppress
from threading import Thread

from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Status

from behaviours.leaf import Leaf, log
from drivers.api import HeadPose, Velocity
from drivers.errors import DriverError


class Liar(Leaf):
    """Claim nothing, and move all that the robot has: at the start, at each tick, and at the end."""

    tag = "liar"

    def initialise(self):
        self.move()

    def update(self):
        self.move()
        return Status.RUNNING

    def terminate(self, new_status):
        self.move()

    def move(self):
        robot = self.robot
        for attempt in (
            lambda: robot.base.drive(Velocity(0.3, 0.5)),
            lambda: robot.base.enable(),
            lambda: robot.head.look(HeadPose(0.5, 0.1)),
            lambda: robot.arm.move({"elbow": 1.5}),
            lambda: robot.arm.relax(),
            lambda: robot.arm.recover(),
        ):
            try:
                attempt()
                log.warning("moved")
            except DriverError as error:
                log.warning("refused: %s", error)


class Crasher(Leaf):
    """Drive, then raise."""

    tag = "crasher"
    needs = drives = frozenset({"base"})

    def update(self):
        self.robot.base.drive(Velocity(0.3, 0.0))
        if self.elapsed > 1.0:
            raise RuntimeError("out of luck")
        return Status.RUNNING


class Blocker(Leaf):
    """Drive, then block the tick, as the watchdog notes it."""

    tag = "blocker"
    needs = drives = frozenset({"base"})

    def update(self):
        self.robot.base.drive(Velocity(0.3, 0.0))
        if self.elapsed > 1.0:
            self.run.overrun = self, self.run.tick, self.run.wall.now() - 3.0
        return Status.RUNNING


class Lender(Leaf):
    """Drive, and leave the robot on the blackboard."""

    tag = "lender"
    needs = drives = frozenset({"base"})

    def update(self):
        Blackboard.set("robot", self.robot)
        self.robot.base.drive(Velocity(0.3, 0.0))
        return Status.RUNNING


class Borrower(Behaviour):
    """A behaviour of py_trees alone, which moves the robot that it finds on the blackboard."""

    def update(self):
        try:
            Blackboard.get("robot").base.drive(Velocity(0.3, 0.0))
            log.warning("moved")
        except DriverError as error:
            log.warning("refused: %s", error)
        return Status.RUNNING


class Threader(Leaf):
    """Drive from a thread, for ever."""

    tag = "threader"
    needs = drives = frozenset({"base"})
    thread = None

    def initialise(self):
        if self.thread is None:
            self.thread = Thread(target=self.move, daemon=True)
            self.thread.start()

    def move(self):
        while True:
            with suppress(DriverError):
                self.robot.base.drive(Velocity(0.3, 0.0))
            time.sleep(0.02)


class Plain(Behaviour):
    """A behaviour of py_trees alone."""

    def update(self):
        log.info("plain")
        return Status.SUCCESS
'''

CLEANUP = (
    "{sequence: [{log: begin}, {liar: , name: liar, timeout: 150 ms, on_failure: succeed}, {plain: }, "
    "{mission: sub.yaml}, {say: Done}, {log: cleaned}]}"
)
LIMBS = "{sweep_head: {amplitude: 30 deg}}, {sweep: {joints: [elbow], between: [20 deg, 80 deg], period: 3 s}}"


@dataclass
class Ending:
    """Events of a run, split at the first start of its cleanup."""

    before: Sequence[Event]
    after: Sequence[Event]
    violations: Sequence[str]
    seconds: float

    @property
    def lines(self) -> set[str]:
        """Lines that the cleanup has logged."""
        return {event.text for event in self.after if isinstance(event, Logged)}

    @property
    def motions(self) -> list[CommandSent]:
        """Commands during and after the cleanup that could move something: all but stops of the halted leaves."""
        sent = [event for event in self.after if isinstance(event, CommandSent) and event.to in ("base", "head", "arm")]
        return [event for event in sent if any(event.values.values()) and not {"stop", "hold"} & event.values.keys()]


def write_files(folder: Path) -> None:
    """Write the behaviours, and a mission for the cleanup."""
    (folder / "behaviours").mkdir()
    (folder / "behaviours" / "liars.py").write_text(LEAVES, encoding="utf-8")
    (folder / "sub.yaml").write_text("mission: sub\ntree: {log: from sub}\n", encoding="utf-8")


def ending(folder: Path, node: str, body: str, cleanup: str = CLEANUP, beside: str = "") -> Ending:
    """Run a node with a cleanup on a robot with base, head and arm, to the end that the ``body`` of a case gives."""
    write_files(folder)
    mission = f"mission: m\ntree: {{race: [{{{node}}}, {LIMBS}], finally: {cleanup}{beside}}}\n"
    (case,) = cases(folder, mission, f"robot: turtlebot2_arm, {body}")
    stage = CaseRunner(case, IN_PROCESS_LIMITS)
    stage.run()
    events = stage.history.events
    places = [
        place for place, event in enumerate(events) if isinstance(event, NodeChanged) and event.node.startswith("1.2")
    ]
    start = places[0] if places else len(events)
    result = stage.history.result
    assert result is not None
    return Ending(events[:start], events[start:], stage.violations, result.seconds)


ENDINGS = {
    "success": ("drive: 30 cm", "expect: {result: success}"),
    "failure": ("drive: 20 m, timeout: 2 s", "expect: {result: failure}"),
    "crash": ("crasher: ", "expect: {result: failure}"),
    "overrun": ("blocker: ", "expect: {result: failure}"),
    "interrupted": ("drive: 20 m", "timeout: 2 s, expect: {result: running}"),
    "cliff": ("drive: 20 m", "given: [base cliff at 2 s for 3 s], expect: {result: failure}"),
    "battery": ("drive: 20 m", "given: [base battery at 2 % from 1 s], expect: {result: failure}"),
    "unplugged": ("drive: 20 m, timeout: 4 s", "given: [base unplugged at 2 s], expect: {result: failure}"),
    "stop": ("drive: 20 m", "given: [run stopped from 2 s to 4 s], timeout: 6 s, expect: {result: running}"),
    "end while stopped": (
        "drive: 20 m",
        "given: [run stopped from 2 s to 9 s], timeout: 4 s, expect: {result: running}",
    ),
    "end while paused": ("drive: 20 m", "given: [run paused from 2 s to 9 s], timeout: 4 s, expect: {result: running}"),
}


@pytest.mark.parametrize("way", ENDINGS)
def test_finally_runs_and_moves_nothing_at_each_way_to_end(way: str, tmp_path: Path) -> None:
    ended = ending(tmp_path, *ENDINGS[way])
    assert any(isinstance(event, CommandSent) and event.to == "base" for event in ended.before)
    assert {"plain", "from sub", "cleaned"} <= ended.lines
    assert any(line.startswith("refused") for line in ended.lines)
    assert "moved" not in ended.lines
    assert ended.motions == []
    assert ended.violations == []


def test_unclaimed_leaf_moves_the_robot_during_the_mission(tmp_path: Path) -> None:
    ended = ending(tmp_path, "sequence: [{liar: , timeout: 1 s}], on_failure: succeed", ENDINGS["success"][1])
    lines = {event.text for event in ended.before if isinstance(event, Logged)}
    assert "moved" in lines
    assert not any(line.startswith("refused: kept still") for line in lines)


def test_cleanup_of_a_preempted_node_ends_before_the_next_one_drives(tmp_path: Path) -> None:
    node = "reactive_selector: [{turn: 30 deg, if: base.x > 30 cm}, {drive: 20 m, finally: {liar: }}]"
    ended = ending(tmp_path, node, "timeout: 9 s, expect: {result: success}", "{log: cleaned}")
    events = [*ended.before, *ended.after]
    liar = [event.t for event in events if isinstance(event, NodeChanged) and event.kind == "liar"]
    turn = [event.t for event in events if isinstance(event, NodeChanged) and event.kind == "turn" and not event.reason]
    sent = [event for event in events if isinstance(event, CommandSent) and event.to == "base"]
    assert liar[-1] - liar[0] == pytest.approx(1.0, abs=0.11)
    assert turn[0] >= liar[-1]
    assert not [event for event in sent if liar[0] < event.t < liar[-1] and any(event.values.values())]


def test_final_halt_ends_a_slow_cleanup_after_the_halt_timeout(tmp_path: Path) -> None:
    body = "timeout: 2 s, expect: {result: running}"
    ended = ending(tmp_path, "drive: 20 m", body, "{sequence: [{log: begin}, {liar: }]}", ", halt_limit: 10 s")
    assert ended.seconds == pytest.approx(2.0 + HALT_TIMEOUT, abs=0.3)
    assert (ended.motions, ended.violations) == ([], [])


def test_final_halt_gives_each_pending_cleanup_a_tick_and_names_those_cut_off(tmp_path: Path) -> None:
    slow = "{drive: 20 m, finally: {wait: 5 s, finally: {log: nested}}, halt_limit: 10 s}"
    node, outer = f"sequence: [{slow}], finally: {{log: middle}}", "{sequence: [{log: outer}, {wait: 5 s}]}"
    ended = ending(tmp_path, node, "timeout: 2 s, expect: {result: running}", outer)
    assert [event.text for event in (*ended.before, *ended.after) if isinstance(event, Logged)] == [
        "nested",
        "the 'finally' of drive (line 2) was cut off",
        "middle",
        "outer",
        "the 'finally' of race (line 2) was cut off",
    ]
    assert ended.seconds == pytest.approx(2.0 + HALT_TIMEOUT, abs=0.3)
    assert (ended.motions, ended.violations) == ([], [])


def test_mocks_in_a_cleanup_run_as_leaves_do(tmp_path: Path) -> None:
    body = "timeout: 2 s, given: [{say: fails}, {liar: 'runs for 200 ms, then succeeds'}], expect: {result: running}"
    ended = ending(
        tmp_path,
        "drive: 20 m",
        body,
        "{sequence: [{log: begin}, {liar: }, {say: a, on_failure: succeed}, {log: cleaned}]}",
    )
    assert "cleaned" in ended.lines
    assert (ended.motions, ended.violations) == ([], [])


def test_device_failure_in_a_cleanup_does_not_prevent_the_end(tmp_path: Path) -> None:
    body = "given: [voice unplugged at 1 s], timeout: 2 s, expect: {result: running}"
    ended = ending(tmp_path, "drive: 20 m", body, "{selector: [{say: Done, timeout: 200 ms}, {log: cleaned}]}")
    assert "cleaned" in ended.lines
    assert ended.violations == []


def test_error_of_the_executive_starts_no_cleanup_and_stops_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_files(tmp_path)
    (tmp_path / "m.yaml").write_text("mission: m\ntree: {drive: 20 m, finally: {liar: }}\n", encoding="utf-8")
    events: list[Event] = []
    runner = Runner(
        RunRequest(str(tmp_path / "m.yaml"), robot="turtlebot2", simulate="fast"), listeners=[events.append]
    )
    twins = runner.twins
    assert twins is not None
    assert twins.base is not None

    def fail() -> str:
        raise ZeroDivisionError("a bug")

    twins.timeline.call_at(2.0, lambda: monkeypatch.setattr(BaseGuard, "check", lambda _: fail()))
    with pytest.raises(ZeroDivisionError):
        runner.run()
    twins.timeline.run_until(twins.timeline.clock.now() + 1.0)
    assert twins.base.body.velocity == Velocity(0.0, 0.0)
    assert [event for event in events if isinstance(event, NodeChanged) and event.kind == "liar"] == []


def test_cleanup_that_claims_an_actuator_is_not_run() -> None:
    class Quiet(Leaf):
        """Claim the base, as a replaced leaf could."""

        tag = "quiet"
        drives = frozenset({"base"})
        ticks = 0

        def update(self) -> Status:
            type(self).ticks += 1
            return SUCCESS

    text = "mission: m\ntree: {pretend: [running, success], finally: {log: a}}\n"
    plan = check_plan(SourceText("m.yaml", text), LEAVES_OF_OURS, {})
    run = RunState(ManualClock())
    root = build(plan, run, lambda _: Robot(), substitute=lambda step, leaf: Quiet("q") if step.kind == "log" else leaf)
    statuses = [root.execute_tick() for run.tick in (1, 2)]
    assert (statuses, Quiet.ticks) == ([RUNNING, SUCCESS], 0)


@pytest.mark.parametrize("way", ["failure", "interrupted", "stop", "end while paused"])
def test_cleanup_cannot_move_by_the_robot_of_another_leaf(way: str, tmp_path: Path) -> None:
    node = "lender: , timeout: 2 s" if way == "failure" else "lender: "
    ended = ending(tmp_path, node, ENDINGS[way][1], "{borrower: }")
    assert "refused: kept still: lender (line 2) is not ticked now" in ended.lines
    assert "moved" not in ended.lines
    assert (ended.motions, ended.violations) == ([], [])


class Goer(Leaf):
    """Claim nothing, and move the arm at each call that is listed in ``moves_at``."""

    tag = "goer"
    moves_at: Collection[str] = ()
    ends_with = RUNNING

    def go(self, call: str) -> None:
        if call in self.moves_at:
            self.robot.arm.move({"elbow": 1.0})

    def initialise(self) -> None:
        self.go("initialise")

    def update(self) -> Status:
        self.go("update")
        return self.ends_with


class StowingGoer(Goer):
    """As its base class, with a terminate of its own, and a second tick to stop."""

    tag = "stowing_goer"

    def terminate(self, new_status: Status) -> None:
        del new_status
        self.go("terminate")

    def halting(self) -> bool:
        self.go("halting")
        return self._halt_tick == self.run.tick - 1


@pytest.fixture
def bench() -> LeafTestBench:
    return LeafTestBench()


def put(bench: LeafTestBench, leaf: Leaf) -> None:
    """Give ``leaf`` a robot of proxies, as a mission would, and stop its parts in the run's ``safe_stop``."""
    bench.put(leaf)
    leaf.robot = robot_for(leaf, with_proxies(bench.robot, TickCache()), lambda *_: None)
    bench.run.safe_stop = partial(hold_still, bench.robot)


@pytest.mark.parametrize("kind", [Goer, StowingGoer])
@pytest.mark.parametrize("call", ["initialise", "update", "terminate", "halting"])
@pytest.mark.parametrize("ends_with", [RUNNING, FAILURE, SUCCESS])
def test_what_a_leaf_has_moved_without_a_claim_is_stopped_unless_it_succeeded_or_stops_it_itself(
    kind: type[Goer], call: str, ends_with: Status, bench: LeafTestBench
) -> None:
    leaf = kind("goer")
    put(bench, leaf)
    leaf.moves_at, leaf.ends_with = {call}, ends_with
    bench.tick(leaf)
    while not bench.halt(leaf):
        pass
    moved, late = bool(bench.arm.commands), call in ("terminate", "halting")
    stopped = moved and ends_with is not SUCCESS and (late or kind is Goer)
    assert (bench.arm.commands[-1:] == [HOLD]) is stopped


def test_pause_holds_what_a_leaf_has_moved_without_a_claim(bench: LeafTestBench) -> None:
    leaf = Goer("goer")
    put(bench, leaf)
    leaf.moves_at = {"initialise"}
    executive = Executive(leaf, bench.run, EventStream())
    executive.tick()
    executive.keep_still()
    executive.keep_still()
    assert bench.arm.commands == [{"elbow": 1.0}, HOLD]


def test_leaf_moves_from_elsewhere_only_while_it_is_ticked(bench: LeafTestBench) -> None:
    leaf = Goer("goer")
    put(bench, leaf)

    def is_refused() -> bool:
        sent = len(bench.arm.commands)
        with suppress(DeviceFault):
            leaf.robot.arm.move({"elbow": 1.0})
        return len(bench.arm.commands) == sent

    assert is_refused()
    bench.tick(leaf)
    assert not is_refused()
    bench.run.is_held = True
    assert is_refused()
    bench.run.is_held = False
    bench.run.tick += 2  # in which it was not ticked
    assert is_refused()
    bench.tick(leaf)
    assert not is_refused()
    bench.halt(leaf)
    assert is_refused()


def test_leaf_moves_a_reconnected_part_from_elsewhere_only_after_a_new_start(bench: LeafTestBench) -> None:
    leaf = bench.put(Goer("goer"))
    leaf.robot = robot_for(leaf, with_proxies(bench.robot, TickCache(), StaleCommandGuard(ignore)), ignore)
    bench.tick(leaf)
    assert bench.run.active_leaf is None  # as for a thread, or while another leaf uses the robot
    bench.arm.health = lambda: Health(True, reconnected_at=bench.run.now() + 1.0)  # type: ignore[method-assign]
    with pytest.raises(DeviceFault, match="goer began before it was back"):
        leaf.robot.arm.move({"elbow": 1.0})
    bench.halt(leaf)
    bench.clock.advance(2.0)
    bench.arm.health = lambda: Health(True, reconnected_at=bench.run.now() - 1.0)  # type: ignore[method-assign]
    bench.tick(leaf)
    leaf.robot.arm.move({"elbow": 1.0})
    assert bench.arm.commands[-1] == {"elbow": 1.0}


@pytest.mark.parametrize("drops", [lambda executive: executive.hold(held=True), Executive.resume])
def test_hold_and_resume_drop_the_steps_that_are_not_made_yet(
    drops: Callable[[Executive], None], bench: LeafTestBench
) -> None:
    leaf = Goer("goer")
    put(bench, leaf)
    executive = Executive(leaf, bench.run, EventStream())

    def wait(seconds: float) -> None:
        del seconds
        executive.step()
        executive.step()
        drops(executive)
        executive.hold(held=False)
        executive.pause()
        executive.idle = lambda _: executive.stop("enough")

    executive.pause()
    executive.idle = wait
    assert executive.loop().ticks == 0


def test_motion_that_begins_while_its_leaf_is_halted_is_stopped(bench: LeafTestBench) -> None:
    leaf, move = Goer("goer"), bench.arm.move
    put(bench, leaf)
    bench.tick(leaf)

    def halt_first(goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        bench.halt(leaf)
        return move(goals, speeds=speeds)

    bench.arm.move = halt_first  # type: ignore[method-assign]
    with pytest.raises(DeviceFault, match="kept still: goer is not ticked now"):
        leaf.robot.arm.move({"elbow": 1.0})
    assert bench.arm.commands[-1] == HOLD


def test_motion_is_stopped_by_a_halt_between_its_check_and_its_end(bench: LeafTestBench) -> None:
    checks = []

    class HaltedGoer(Goer):
        @property
        def may_move(self) -> bool:
            permitted = super().may_move
            checks.append(permitted)
            if len(checks) == 2:  # after the command, the first check is before it
                bench.halt(self)  # as the thread of the ticks may do meanwhile
            return permitted

    leaf = HaltedGoer("goer")
    put(bench, leaf)
    bench.tick(leaf)
    leaf.robot.arm.move({"elbow": 1.0})
    assert checks == [True, True]
    assert bench.arm.commands == [{"elbow": 1.0}, HOLD]


def test_cleanup_of_a_mission_on_a_robot_of_the_caller_moves_nothing(tmp_path: Path, bench: LeafTestBench) -> None:
    write_files(tmp_path)
    path = tmp_path / "m.yaml"
    path.write_text("mission: m\ntree: {drive: 1 m, finally: {liar: }, halt_limit: 100 ms}\n", encoding="utf-8")
    with load(path, robot=bench.robot) as mission:
        mission.tick()
        mission.halt()
    sent = bench.base.commands
    assert sent.index(STOP) > 0
    assert not [command for command in sent[sent.index(STOP) :] if command != STOP]
    assert (bench.head.commands, bench.arm.commands) == ([], [])


def test_robot_of_a_cleanup_refuses_every_command_but_stops_lights_and_voice(bench: LeafTestBench) -> None:
    leaf = bench.put(Log("log"))
    leaf.in_finally = True
    robot = robot_for(leaf, with_proxies(bench.robot, TickCache()), lambda *_: None)
    refused: list[Callable[[], object]] = [
        lambda: robot.base.drive(Velocity(0.1, 0.0)),
        robot.base.enable,
        lambda: robot.legs.perform("sit"),
        lambda: robot.head.look(HeadPose(0.1, 0.0)),
        lambda: robot.arm.move({"elbow": 0.1}),
        robot.arm.relax,
        robot.arm.rest,
        robot.arm.recover,
        lambda: robot.ros2.publish("/cmd_vel", "geometry_msgs/msg/Twist", "{}"),
        lambda: robot.ros2.call("/move", "std_srvs/srv/Trigger", "{}"),
    ]
    for command in refused:
        with pytest.raises(DeviceFault, match="kept still"):
            command()
    for part in (bench.base, bench.head, bench.arm, bench.ros2):
        assert part.commands == []
    robot.base.stop()
    robot.lights.light(1, Lamp.GREEN)
    robot.arm.hold()
    robot.voice.say("Done")
    assert bench.base.commands[-1] == (1, Lamp.GREEN)
