"""Goals whose end is unknown, and cancels that are lost: turned by hand."""

from random import Random
from typing import Any, cast

import pytest

from drivers.api.ros2 import GoalState
from drivers.errors import NotConnected
from drivers.ros2.node import Ros2Node
from drivers.ros2.requests import GoalPhase, RequestTracker
from drivers.ros2.types import types
from drivers.ros2.wire import Entity
from tests.machines import walk

NAVIGATE = "nav2_msgs/action/NavigateToPose"
CANCEL = "action_msgs/srv/CancelGoal"


class Network:
    """A clock, and a node that hears what is asked: ``asked`` are the types and who is told the reply."""

    def __init__(self) -> None:
        self.there, self.time = True, 100.0
        self.servers = ["a"]
        self.asked: list[tuple[str, Any]] = []

    def now(self) -> float:
        return self.time

    def entities(self, role: str, name: str) -> list[Entity]:
        ends = {"send_goal": f"{NAVIGATE}_SendGoal", "get_result": f"{NAVIGATE}_GetResult", "cancel_goal": CANCEL}
        kind = ends[name.rpartition("/")[2]]
        return [Entity(role, 0, zid, "0", "1", "nav2", "", name, kind) for zid in self.servers if self.there]

    def call(self, server: Any, _payload: bytes, on_reply: Any, *, timeout: float) -> None:
        self.timeout = timeout
        self.asked.append((server.kind, on_reply))

    def subscribe(self, *_: Any) -> None:
        return None

    @property
    def cancels(self) -> list[Any]:
        """Who is told the replies to cancels."""
        return [replied for kind, replied in self.asked if kind == CANCEL]


def begun() -> tuple[Network, RequestTracker, int]:
    network = Network()
    requests = RequestTracker(lambda: cast(Ros2Node, network), cast(Any, network), lambda: None)
    number = requests.begin("/navigate_to_pose", NAVIGATE, {})
    network.asked[0][1](types().encode(f"{NAVIGATE}_SendGoal_Response", {"accepted": True}))
    return network, requests, number


def look(network: Network, requests: RequestTracker, seconds: float) -> None:
    network.time += seconds
    requests.check_servers(cast(Ros2Node, network))


HEARD = types().encode(f"{CANCEL}_Response", {})
REJECTED, NOT_KNOWN, TERMINATED = (types().encode(f"{CANCEL}_Response", {"return_code": code}) for code in (1, 2, 3))


def test_goal_with_unknown_end_is_cancelled_until_confirmed() -> None:
    network, requests, number = begun()
    network.there = False
    network.asked[1][1](None)
    assert requests.progress(number).state is GoalState.UNKNOWN
    assert requests.has_goal()
    look(network, requests, 2.0)
    requests.cancel_all()
    assert network.cancels == []
    network.there = True
    look(network, requests, 2.0)
    look(network, requests, 0.5)
    assert len(network.cancels) == 1
    network.cancels[0](None)
    look(network, requests, 1.0)
    assert len(network.cancels) == 2
    network.cancels[1](HEARD)
    assert not requests.has_goal()
    look(network, requests, 2.0)
    requests.cancel_all()
    assert len(network.cancels) == 2


def test_lost_cancel_is_sent_again() -> None:
    network, requests, number = begun()
    requests.cancel(number)
    requests.cancel(number)
    assert len(network.cancels) == 2
    network.cancels[1](None)
    look(network, requests, 1.5)
    assert len(network.cancels) == 3
    network.cancels[2](HEARD)
    look(network, requests, 1.5)
    assert len(network.cancels) == 3


def test_rejected_cancel_is_sent_again() -> None:
    network, requests, number = begun()
    requests.cancel(number)
    for count in (1, 2, 3):
        assert len(network.cancels) == count
        network.cancels[-1](REJECTED)
        assert requests.progress(number).state is GoalState.CANCELLING
        look(network, requests, 1.5)


def test_cancel_of_a_goal_unknown_to_its_server_ends_it() -> None:
    network, requests, number = begun()
    requests.cancel(number)
    network.cancels[0](TERMINATED)
    assert not requests.progress(number).is_final
    requests.cancel(number)
    network.cancels[1](NOT_KNOWN)
    told = requests.progress(number)
    assert (told.state, told.reason) == (
        GoalState.FAILED, "/navigate_to_pose: its server no longer knows this goal"
    )  # fmt: skip
    look(network, requests, 5.0)
    assert len(network.cancels) == 2


def test_restarted_server_makes_its_goal_unknown_and_cancelled() -> None:
    network, requests, number = begun()
    network.servers = ["b"]
    look(network, requests, 0.1)
    look(network, requests, 1.1)
    told = requests.progress(number)
    assert (told.state, "its server is gone" in told.reason) == (GoalState.UNKNOWN, True)
    look(network, requests, 1.1)
    assert len(network.cancels) == 1
    network.cancels[0](NOT_KNOWN)
    look(network, requests, 5.0)
    assert len(network.cancels) == 1


def test_goal_is_refused_with_two_servers_but_can_be_cancelled() -> None:
    network, requests, number = begun()
    network.servers = ["a", "b"]
    with pytest.raises(NotConnected, match="2 servers of /navigate_to_pose"):
        requests.begin("/navigate_to_pose", NAVIGATE, {})
    requests.cancel(number)
    assert len(network.cancels) == 1


def test_goal_may_run_for_days_while_its_server_is_online() -> None:
    network, requests, number = begun()
    for _ in range(100):
        look(network, requests, 3600.0)
    assert requests.progress(number).state is GoalState.RUNNING
    assert network.timeout > 100 * 3600.0


class Goal:
    """A goal that was just sent, and its answers as they come."""

    def __init__(self) -> None:
        self.network = Network()
        self.requests = RequestTracker(lambda: cast(Ros2Node, self.network), cast(Any, self.network), lambda: None)
        self.number = self.requests.begin("/navigate_to_pose", NAVIGATE, {})
        self.answered = 0

    def answer(self, chance: Random) -> None:
        """Answer the oldest question that has had no answer."""
        if self.answered < len(self.network.asked):
            kind, replied = self.network.asked[self.answered]
            self.answered += 1
            accepted = types().encode(f"{NAVIGATE}_SendGoal_Response", {"accepted": chance.random() < 0.8})
            ended = types().encode(f"{NAVIGATE}_GetResult_Response", {"status": chance.choice((4, 5, 6, 2))})
            answers = {CANCEL: chance.choice((HEARD, REJECTED, NOT_KNOWN)), f"{NAVIGATE}_SendGoal": accepted}
            replied(chance.choice((None, *[answers.get(kind, ended)] * 3)))


def test_random_answers_take_every_transition_of_a_goal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def cancel(goal: Goal, _: Random) -> None:
        goal.requests.cancel(goal.number)

    def let_time_pass(goal: Goal, chance: Random) -> None:
        goal.network.there = chance.random() < 0.8
        look(goal.network, goal.requests, chance.choice((0.5, 2.0)))
        asked = len(goal.network.cancels)
        goal.network.there = True
        look(goal.network, goal.requests, 2.0)
        if goal.requests._requests[goal.number].phase is GoalPhase.ORPHANED:
            assert len(goal.network.cancels) == asked + 1

    actions = [cancel, let_time_pass, Goal.answer, Goal.answer]
    table = walk(monkeypatch, "drivers.ros2.requests.TRANSITIONS", Goal, actions, steps=12)
    assert table.visited == set(table)
