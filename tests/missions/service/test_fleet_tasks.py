"""Tasks of a fleet, cranked by hand: who has one, what becomes of it when robots are lost, that none begins late."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from drivers.clock import ManualClock
from missions.codec import decode
from missions.plugins.fleet.fleet_robot import Telemetry
from missions.plugins.fleet.messages import (
    MAX_ANSWER_BYTES,
    RULES,
    AcceptTask,
    Address,
    DecideTask,
    FleetAnswer,
    FleetRequest,
    FleetTaskInfo,
    FleetTimeouts,
    KeepTask,
    ListFleetTasks,
    RobotState,
    TaskReport,
    decode_message,
    encode_message,
    zenoh_key,
)
from missions.plugins.fleet.task_allocator import (
    DOUBT_REASON,
    LATE_PREFIX,
    LOST_REASON,
    FleetTask,
    TaskAllocator,
    TaskStore,
    matches_condition,
)
from missions.plugins.fleet.task_executor import AssignmentQueue, TaskExecutor
from missions.plugins.fleet.zenoh_transport import Roster
from missions.plugins.tasks.queue_database import open_db, queue_file
from missions.plugins.tasks.task import AttemptOutcome, Claim
from tests.missions.service.fleets import CountingBody

TIMES = FleetTimeouts(heartbeat=2.0, retry_interval=1.0, lease=30.0, reassign_after=50.0, refusal_pause=2.0)
DESK = Address("desk", "00000001")
TASK = f"{DESK}/0123456789ab"


class Robot:
    """A robot that does tasks when it is told to, and whose wire can be cut, or delay what is sent."""

    def __init__(self, fleet: "Fleet", name: str, number: str, folder: Path) -> None:
        self.address, self.fleet, self.folder = Address(name, number), fleet, folder
        self.cut, self.late = False, list[Callable[[], None]]()
        self.stopped = self.holds_back = False
        self.body = CountingBody()
        self.claimed: Claim | None = None
        self.switch_on()

    def switch_on(self) -> None:
        self.queue = AssignmentQueue(
            self.fleet.closed.enter_context(closing(open_db(queue_file(self.folder)))), lambda _: ()
        )
        self.queue.recover(self.fleet.now())
        self.errands = TaskExecutor(
            self.address, self.queue, self.body, partial_ask(self.fleet, self), self.fleet.now, self.fleet.now,
            is_stopped=lambda: self.stopped, timeouts=TIMES, has_mission=lambda name: name != "unknown",
        )  # fmt: skip
        self.claimed, self.body.telemetry = None, Telemetry()

    def begin(self) -> bool:
        """Begin what is due; say whether there was something."""
        self.claimed = self.queue.claim(self.fleet.now())
        self.body.telemetry = Telemetry(runs=self.claimed is not None)
        return self.claimed is not None

    def end(self, how: str = "success") -> None:
        assert self.claimed is not None
        self.queue.finish(self.claimed, AttemptOutcome(how), self.fleet.now())  # type: ignore[arg-type]
        self.claimed, self.body.telemetry = None, Telemetry()


def partial_ask(
    fleet: "Fleet", robot: Robot | None
) -> Callable[[FleetRequest, Address, Callable[[FleetAnswer | None], None]], None]:
    def ask(ask: FleetRequest, where: Address, on_answer: Callable[[FleetAnswer | None], None]) -> None:
        fleet.carry(robot, ask, where, on_answer)

    return ask


@dataclass
class Fleet:
    """A desk that keeps tasks, and robots, with a wire and a clock that are turned by hand."""

    folder: Path
    closed: ExitStack
    clock: ManualClock = field(default_factory=lambda: ManualClock(1000.0))
    robots: dict[Address, Robot] = field(default_factory=dict)
    number: int = 0
    ahead: float = 0.0
    """Seconds by which the desk's wall clock is ahead."""

    def __post_init__(self) -> None:
        self.roster = Roster(self.clock)
        self.start_desk()

    def start_desk(self) -> None:
        self.kept = TaskStore(self.closed.enter_context(closing(open_db(queue_file(self.folder / "desk")))))
        self.keeper = TaskAllocator(DESK, self.kept, self.roster, partial_ask(self, None), self.now, self.wall, TIMES)

    def wall(self) -> float:
        return self.now() + self.ahead

    def now(self) -> float:
        return self.clock.now()

    def robot(self, name: str, number: str) -> Robot:
        found = Robot(self, name, number, self.folder / name)
        self.robots[found.address] = found
        self.seen(found)
        return found

    def seen(self, robot: Robot, **more: object) -> None:
        """Let the desk hear how a robot is, unless its wire is cut: then its token goes."""
        where = str(robot.address)
        self.roster.on_token(zenoh_key("f", "here", where), alive=not robot.cut)
        if not robot.cut:
            self.number += 1
            state = RobotState(session="1", number=self.number, robot="note", free=robot.errands.activity().free)
            self.roster.on_state(zenoh_key("f", "state", where), encode_message(replace(state, **more)))  # type: ignore[arg-type]

    def carry(
        self, asks: Robot | None, ask: FleetRequest, where: Address, on_answer: Callable[[FleetAnswer | None], None]
    ) -> None:
        """Carry a question to who answers it, and the answer back; or to nobody."""
        robot = asks or self.robots[where]
        if robot.cut:
            on_answer(None)
        elif robot.holds_back:
            robot.late.append(lambda: self.answered(ask, where, on_answer))
        else:
            self.answered(ask, where, on_answer)

    def answered(self, ask: FleetRequest, where: Address, on_answer: Callable[[FleetAnswer | None], None]) -> None:
        worker = self.keeper if where == DESK else self.robots[where].errands
        on_answer(worker.answer(ask))

    def keep(self, **more: object) -> FleetAnswer:
        answer = self.keeper.answer(KeepTask(task=TASK, mission="greet", **more))  # type: ignore[arg-type]
        assert answer is not None
        return answer

    def turn(self, seconds: float = 1.0) -> None:
        for _ in range(max(1, round(seconds / 0.5))):
            self.clock.advance(0.5)
            for robot in self.robots.values():
                self.seen(robot)
            self.keeper.step(self.now())
            for robot in self.robots.values():
                robot.errands.step(self.now())

    @property
    def task(self) -> FleetTask:
        found = self.kept.get(TASK)
        assert found is not None
        return found


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    with ExitStack() as closed:
        yield Fleet(tmp_path, closed)


def test_task_is_accepted_confirmed_done_and_reported(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    assert fleet.keep().ok
    assert fleet.keep().ok, "asked again, it is no other task"
    states = [fleet.task.state]
    fleet.turn()
    assert anna.begin()
    fleet.turn()
    states.append(fleet.task.state)
    anna.body.telemetry = Telemetry(runs=True, paused=True)
    fleet.turn()
    states.append(fleet.task.state)
    anna.end()
    fleet.turn()
    assert [*states, fleet.task.state] == ["WAITING", "RUNNING", "PAUSED", "FINISHED"]
    assert (fleet.task.robot, fleet.task.attempt, anna.queue.unconfirmed()) == (str(anna.address), 1, [])
    fleet.turn(5.0)
    assert not anna.begin(), "it is done once"


def test_task_does_not_begin_before_the_keeper_confirms(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    anna.errands.answer(AcceptTask(task=TASK, attempt=1, mission="greet", repeatable=True))
    assert not anna.begin()
    fleet.turn()
    assert anna.queue.tasks()[0].state == "cancelled", "the desk keeps no such task"
    assert not anna.begin()


def test_delayed_order_does_not_begin_a_task(fleet: Fleet) -> None:
    anna, bob = fleet.robot("anna", "0000000a"), fleet.robot("bob", "0000000b")
    anna.holds_back = True
    fleet.keep(on="anna")
    fleet.turn()
    assert fleet.task.robot == str(anna.address)
    anna.cut = True
    fleet.turn(3.0)
    assert fleet.task.robot == "", "what was not confirmed cannot have begun"
    fleet.kept.change(TASK, {"on": "any"})
    fleet.turn()
    assert bob.begin()
    anna.cut = anna.holds_back = False
    for deliver in anna.late:
        deliver()
    fleet.turn()
    assert not anna.begin()
    bob.end()
    fleet.turn()
    assert (fleet.task.state, fleet.task.robot) == ("FINISHED", str(bob.address))


def test_repeatable_task_is_reassigned_after_its_lease(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep()
    fleet.turn()
    assert anna.begin()
    anna.cut, bob = True, fleet.robot("bob", "0000000b")
    fleet.turn(TIMES.lease - 2.0)
    assert not anna.queue.is_cancelling(anna.claimed), "a short absence ends nothing"  # type: ignore[arg-type]
    fleet.turn(5.0)
    assert anna.queue.is_cancelling(anna.claimed)  # type: ignore[arg-type]
    assert fleet.task.robot == str(anna.address), "a run may take its time to stop"
    anna.end("interrupted")
    fleet.turn(TIMES.reassign_after - TIMES.lease)
    assert bob.begin()
    anna.cut = False
    fleet.turn()
    bob.end()
    fleet.turn()
    assert (fleet.task.state, fleet.task.robot, fleet.task.attempt) == ("FINISHED", str(bob.address), 2)
    assert anna.queue.unconfirmed() == []


@pytest.mark.parametrize("how", ["interrupted", "cancelled"])
def test_task_that_a_person_has_ended_goes_to_no_robot(how: str, fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep(retries=1)
    fleet.turn()
    assert anna.begin()
    bob = fleet.robot("bob", "0000000b")
    anna.end(how)
    fleet.turn(90.0)
    assert (bob.begin() or anna.begin()) is (how == "interrupted")


def test_unrepeatable_task_stays_with_its_robot(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep(if_interrupted="give-up")
    fleet.turn()
    assert anna.begin()
    anna.cut, bob = True, fleet.robot("bob", "0000000b")
    fleet.turn(120.0)
    assert (fleet.task.robot, fleet.task.reason) == (str(anna.address), LOST_REASON)
    assert not bob.begin()
    anna.end()
    anna.cut = False
    fleet.turn()
    assert (fleet.task.state, fleet.task.robot) == ("FINISHED", str(anna.address))


def test_operator_may_reassign_an_unrepeatable_task(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep(if_interrupted="give-up")
    fleet.turn()
    assert anna.begin()
    anna.cut, bob = True, fleet.robot("bob", "0000000b")
    fleet.turn(60.0)
    answer = fleet.keeper.answer(DecideTask(task=TASK, decision="reassign", by="me"))
    assert answer is not None
    assert answer.ok
    fleet.turn()
    assert bob.begin()
    bob.end()
    anna.end()
    fleet.turn()
    anna.cut = False
    fleet.turn(3.0)
    assert fleet.task.state == "FINISHED"
    assert f"{LATE_PREFIX} {anna.address}" in fleet.task.reason
    assert anna.queue.unconfirmed() == []


def test_late_result_of_a_lost_robot_is_reported(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep()
    fleet.turn()
    assert anna.begin()
    anna.end()
    anna.cut, bob = True, fleet.robot("bob", "0000000b")
    fleet.turn(TIMES.reassign_after + 2.0)
    assert bob.begin()
    fleet.turn(3.0)
    anna.cut = False
    fleet.turn(3.0)
    assert f"{LATE_PREFIX} {anna.address}" in fleet.task.reason
    bob.body.telemetry = Telemetry(runs=True, paused=True)
    fleet.turn(3.0)
    bob.end()
    fleet.turn(3.0)
    assert (fleet.task.state, fleet.task.reason) == ("FINISHED", f"{LATE_PREFIX} {anna.address}")


def test_killed_robot_reports_the_interruption_and_the_policy_decides(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep(if_interrupted="give-up")
    fleet.turn()
    assert anna.begin()
    anna.switch_on()
    fleet.turn()
    assert (fleet.task.state, DOUBT_REASON in fleet.task.reason) == ("FAILED", True)


def test_confirmed_task_needs_a_new_confirmation_after_a_restart(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep()
    fleet.turn()
    assert fleet.task.confirmed
    anna.cut, bob = True, fleet.robot("bob", "0000000b")
    fleet.turn(TIMES.reassign_after + 2.0)
    assert bob.begin()
    anna.switch_on()
    assert not anna.begin(), "another has it by now"
    anna.cut = False
    fleet.turn()
    assert not anna.begin()


def test_task_that_kills_three_robots_fails(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep()
    for _ in range(3):
        assert fleet.task.state == "WAITING"
        fleet.turn(3.0)
        assert anna.begin()
        anna.switch_on()
        fleet.turn()
    assert (fleet.task.state, fleet.task.interruptions) == ("FAILED", 3)


def test_a_failure_is_tried_again_as_often_as_was_wished(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep(retries=1)
    for _ in range(2):
        fleet.turn(8.0)
        assert anna.begin()
        anna.end("failure")
        fleet.turn()
    assert (fleet.task.state, fleet.task.failures) == ("FAILED", 2)


def test_keeper_clock_set_back_does_not_delay_a_retry(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep(retries=1)
    fleet.ahead = 7200.0
    fleet.turn()
    assert anna.begin()
    anna.end("failure")
    fleet.turn()
    fleet.ahead = 0.0
    fleet.turn(8.0)
    assert anna.begin()


def test_id_of_another_task_is_refused(fleet: Fleet) -> None:
    fleet.keep(by="me", params={"text": "hello"})
    assert fleet.keep(by="me again", params={"text": "hello"}).ok
    for other in ({}, {"params": {"text": "bye"}}, {"params": {"text": "hello"}, "on": "bob"}):
        answer = fleet.keep(**other)
        assert not answer.ok
        assert f"{TASK} is another task: greet" in answer.reason
    assert fleet.task.params == {"text": "hello"}


def test_keeper_with_a_duplicate_number_keeps_and_assigns_nothing(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep()
    fleet.keeper.is_duplicate = lambda: True
    fleet.turn(3.0)
    assert not anna.queue.tasks()
    answer = fleet.keeper.answer(KeepTask(task=f"{DESK}/00000000000c", mission="greet"))
    assert answer is not None
    assert "another robot has the same number" in answer.reason
    fleet.keeper.is_duplicate = lambda: False
    fleet.turn(3.0)
    assert anna.begin()


def test_killed_keeper_continues_with_its_stored_tasks(fleet: Fleet) -> None:
    anna = fleet.robot("anna", "0000000a")
    fleet.keep()
    fleet.turn()
    assert anna.begin()
    fleet.start_desk()
    anna.end()
    fleet.turn(3.0)
    assert fleet.task.state == "FINISHED"


def test_stopped_busy_or_unable_robot_gets_no_task(fleet: Fleet) -> None:
    anna, bob = fleet.robot("anna", "0000000a"), fleet.robot("bob", "0000000b")
    anna.stopped = True
    fleet.keep()
    fleet.turn(4.0)
    assert not anna.begin()
    assert bob.begin()
    refused = bob.errands.answer(AcceptTask(task=f"{DESK}/00000000000c", attempt=1, mission="greet", repeatable=True))
    unknown = anna.errands.answer(
        AcceptTask(task=f"{DESK}/00000000000d", attempt=1, mission="unknown", repeatable=True)
    )
    assert refused == FleetAnswer(ok=False, reason="busy")
    assert unknown is not None
    assert "no mission 'unknown'" in unknown.reason


def test_condition_selects_robots_and_unknown_values_do_not_match() -> None:
    known = RobotState(session="1", number=1, robot="kobuki", battery=0.5, x=2.0, parts=("base", "voice"))
    anna = Address("anna", "0000000a")
    for where in ("", "battery > 40 %", "x < 3 m and battery >= 50 %", "name == 'anna'", "'voice' in parts"):
        assert matches_condition(where, anna, known), where
    for where in ("battery > 60 %", "y > 0 m", "x < 3 s", "colour == 'red'", "battery", "1 / 0 > 1"):
        assert not matches_condition(where, anna, known), where
    assert not matches_condition("battery > 40 %", anna, replace(known, battery=None))


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"task": "bob/0000000b/0123456789ab"}, "is not the ID"), ({"task": "../x"}, "is not the ID"),
        ({"mission": "/etc/passwd"}, "not the name of a library mission"),
        ({"mission": "../greet"}, "not the name of a library mission"),
        ({"where": "__import__('os')"}, "cannot be called"),
        ({"where": "battery > random(0, 1)"}, "only in the run"), ({"where": "battery >"}, "is not an expression"),
    ],
)  # fmt: skip
def test_invalid_task_is_refused(fleet: Fleet, wrong: dict[str, Any], why: str) -> None:
    answer = fleet.keeper.answer(replace(KeepTask(task=TASK, mission="greet"), **wrong))
    assert answer is not None
    assert not answer.ok
    assert why in answer.reason
    told = fleet.keeper.answer(ListFleetTasks(ended=True))
    assert told == FleetAnswer()


def test_report_of_another_robot_or_attempt_changes_nothing(fleet: Fleet) -> None:
    fleet.robot("anna", "0000000a")
    fleet.keep()
    fleet.turn()
    before = fleet.task
    for robot, attempt, state in (("bob/0000000b", 1, "FAILED"), (before.robot, 7, "RUNNING"), ("", 1, "FAILED")):
        report = TaskReport(task=TASK, attempt=attempt, robot=robot, state=state, how="failure")  # type: ignore[arg-type]
        answer = fleet.keeper.answer(report)
        assert answer is not None
        assert not answer.ok
    assert fleet.task == before


def test_long_task_lists_are_answered_in_pages(fleet: Fleet) -> None:
    numbers = [f"{DESK}/{each:012x}" for each in range(60)]
    for number in numbers:
        fleet.keeper.answer(KeepTask(task=number, mission="greet", params={"text": "x" * 1000, **_LONG}))
    for number in numbers[:20]:
        fleet.kept.change(number, {"state": "FINISHED", "reason": "x" * 2000})
    for ended, wanted in ((False, numbers[20:]), (True, numbers[:20])):
        pages, before = list[list[str]](), ""
        while True:
            answer = fleet.keeper.answer(ListFleetTasks(ended=ended, before=before))
            assert answer is not None
            told = decode_message(FleetAnswer, encode_message(answer), MAX_ANSWER_BYTES).data
            page = [decode(FleetTaskInfo, each, RULES).id for each in told]
            if not page:
                break
            pages.append(page)
            before = page[-1]
        assert len(pages) > 1
        assert [each for page in pages for each in page] == wanted[::-1]


_LONG = {f"p{number}": "y" * 1000 for number in range(50)}
"""Params as long as a message may be, nearly."""
