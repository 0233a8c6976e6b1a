"""Goals whose end is unknown, and cancels that are lost: turned by hand."""

from types import SimpleNamespace
from typing import Any, cast

from drivers.api.ros2 import GoalState
from drivers.ros2.node import Node
from drivers.ros2.requests import Requests
from drivers.ros2.types import types

NAVIGATE = "nav2_msgs/action/NavigateToPose"
CANCEL = "action_msgs/srv/CancelGoal"


class Network:
    """A clock, and a node that hears what is asked: ``asked`` are the types and who is told the reply."""

    def __init__(self) -> None:
        self.there, self.time = True, 100.0
        self.asked: list[tuple[str, Any]] = []

    def now(self) -> float:
        return self.time

    def kind_of(self, _role: str, name: str, _kinds: Any = ()) -> Any:
        ends = {"send_goal": f"{NAVIGATE}_SendGoal", "get_result": f"{NAVIGATE}_GetResult", "cancel_goal": CANCEL}
        return SimpleNamespace(kind=ends[name.rpartition("/")[2]]) if self.there else None

    def call(self, server: Any, _payload: bytes, replied: Any, *, patience: float) -> None:
        del patience
        self.asked.append((server.kind, replied))

    def subscribe(self, *_: Any) -> None:
        return None

    @property
    def cancels(self) -> list[Any]:
        """Who is told the replies to cancels."""
        return [replied for kind, replied in self.asked if kind == CANCEL]


def begun() -> tuple[Network, Requests, int]:
    network = Network()
    requests = Requests(lambda: cast(Node, network), cast(Any, network), lambda: None)
    number = requests.begin("/navigate_to_pose", NAVIGATE, {})
    network.asked[0][1](types().encode(f"{NAVIGATE}_SendGoal_Response", {"accepted": True}))
    return network, requests, number


def look(network: Network, requests: Requests, seconds: float) -> None:
    network.time += seconds
    requests.look(cast(Node, network))


HEARD = types().encode(f"{CANCEL}_Response", {})


def test_a_goal_whose_end_is_unknown_is_cancelled_until_its_server_has_heard_it() -> None:
    network, requests, number = begun()
    network.there = False
    network.asked[1][1](None)
    assert requests.progress(number).state is GoalState.UNKNOWN
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
    look(network, requests, 2.0)
    requests.cancel_all()
    assert len(network.cancels) == 2


def test_a_cancel_that_was_lost_is_sent_again_by_itself_and_by_who_asks_again() -> None:
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
