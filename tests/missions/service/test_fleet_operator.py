"""Somebody at a fleet whose robots never keep still, or say what they please; nothing is sent, and no time passes."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace

import pytest

from config.fleet import FleetKeys
from drivers.clock import ManualClock
from missions.plugins.fleet.messages import (
    Address,
    FleetAnswer,
    FleetRequest,
    FleetTaskInfo,
    ListFleetTasks,
    RobotState,
    encode_message,
    zenoh_key,
)
from missions.plugins.fleet.operator import MAX_ENDED_PAGES, MAX_WAIT, Operator
from missions.plugins.fleet.zenoh_transport import OnAnswer, Roster, ZenohTransport

ANNA, ANNA_TOO, BOB = (Address(name, f"0000000{each}") for name, each in (("anna", "a"), ("anna", "c"), ("bob", "b")))
STATE = RobotState(session="1", number=0, robot="note", stops=1)


class Busy(ManualClock):
    """A clock that goes on whenever it is looked at, and lets something happen meanwhile."""

    def __init__(self, happens: Callable[[], None]) -> None:
        super().__init__(100.0)
        self.happens = happens

    def now(self) -> float:
        self.advance(0.05)
        self.happens()
        return super().now()


class Fleet(ZenohTransport):
    """Robots that answer at once with what is told here; it is the line to them, too."""

    def __init__(self) -> None:
        self.clock = Busy(lambda: None)
        self.roster = Roster(ManualClock())
        self.operator = Operator(FleetKeys(fleet="f"), self, self.roster, self.clock, "me")
        self.answers: Mapping[str, FleetAnswer] = {}
        self.answering: Callable[[FleetRequest], FleetAnswer] = lambda ask: self.answers.get(ask.word, FleetAnswer())
        self.deaf: set[Address] = set()
        self.asked: list[tuple[FleetRequest, str, float]] = []
        self.number = 0

    def seen(self, *those: Address) -> None:
        for each in those:
            self.number += 1
            self.roster.on_state(zenoh_key("f", "state", str(each)), encode_message(replace(STATE, number=self.number)))

    def send_request(self, request: FleetRequest, where: str, on_answer: OnAnswer, timeout: float) -> None:
        self.asked.append((request, where, timeout))
        for address in self.roster.members():
            if where in (str(address), "*/*") and address not in self.deaf:
                on_answer(address, self.answering(request))
        on_answer(None, None)


def test_stop_ends_while_robots_keep_publishing() -> None:
    fleet = Fleet()
    fleet.seen(ANNA, BOB)
    fleet.clock.happens = lambda: fleet.seen(ANNA, BOB)
    begun = fleet.clock.now()
    answers, silent = fleet.operator.stop()
    assert (set(answers), silent) == ({ANNA, BOB}, [])
    assert fleet.clock.now() - begun < 1.5, "what they tell of themselves makes them nobody new"


def test_a_stop_ends_though_robots_come_without_end() -> None:
    fleet = Fleet()
    fleet.clock.happens = lambda: fleet.seen(Address("new", f"{fleet.number:08x}"))
    begun = fleet.clock.now()
    answers, _ = fleet.operator.stop()
    assert len(answers) > 50
    assert MAX_WAIT < fleet.clock.now() - begun < 2 * MAX_WAIT + 1.0


@pytest.mark.parametrize(
    "told", [{"connection": []}, {}, {"robot": "\x1b[2J", "connection": "OFFLINE"}, {"robot": 1, "connection": "GONE"}]
)
def test_invalid_peer_entries_are_ignored(told: dict[str, object]) -> None:
    fleet = Fleet()
    fleet.seen(ANNA)
    fleet.answers = {"met": FleetAnswer(data=(told, {"robot": str(BOB), "connection": "CONNECTIONBROKEN"}))}
    answers, silent = fleet.operator.stop()
    assert (list(answers), silent) == ([ANNA], [str(BOB)])


@pytest.mark.parametrize(
    "wrong", [{"id": "x"}, {"id": []}, {"reason": "\x1b[2J"}, {"state": "DREAMING"}, {"attempt": "1"}, {"more": 1}]
)
def test_invalid_task_entries_are_ignored(wrong: dict[str, object]) -> None:
    fleet = Fleet()
    fleet.seen(ANNA)
    task = FleetTaskInfo(
        id=f"{ANNA}/0123456789ab", mission="greet", params={}, on="any", where="", if_interrupted="retry",
        state="RUNNING", robot=str(ANNA), attempt=1, reason="", by="me",
    )  # fmt: skip
    fleet.answers = {"tasks": FleetAnswer(data=({}, asdict(task) | wrong, asdict(task)))}
    assert fleet.operator.tasks(ended=False).tasks == [task]


def test_tasks_are_listed_in_pages_and_incomplete_robots_named() -> None:
    fleet = Fleet()
    fleet.seen(ANNA, BOB)
    task = FleetTaskInfo(
        id="", mission="greet", params={}, on="any", where="", if_interrupted="retry",
        state="FINISHED", robot=str(ANNA), attempt=1, reason="", by="me",
    )  # fmt: skip

    def pages(ask: FleetRequest) -> FleetAnswer:
        if not isinstance(ask, ListFleetTasks):
            return FleetAnswer()
        last = int(ask.before[-12:] or "fffff", 16)
        if not ask.ended and last < 0xFFFF0:
            return FleetAnswer()
        numbers = range(last - 1, last - 11, -1)
        return FleetAnswer(data=tuple(asdict(replace(task, id=f"{ANNA}/{number:012x}")) for number in numbers))

    fleet.answering = pages
    fleet.deaf = {BOB}
    told = fleet.operator.tasks(ended=True)
    assert len({each.id for each in told.tasks}) == len(told.tasks) == 10 * MAX_ENDED_PAGES
    assert (told.more, told.silent) == (frozenset({str(ANNA)}), frozenset({str(BOB)}))
    assert fleet.operator.tasks(ended=False).more == frozenset()


@pytest.mark.parametrize(
    ("names", "released"), [([], {ANNA, ANNA_TOO, BOB}), (["anna"], {ANNA, ANNA_TOO}), ([str(ANNA_TOO)], {ANNA_TOO})]
)
def test_robots_of_one_name_are_released_by_number(names: list[str], released: set[Address]) -> None:
    fleet = Fleet()
    fleet.seen(ANNA, ANNA_TOO, BOB)
    assert set(fleet.operator.release(names, resume=False)) == released
