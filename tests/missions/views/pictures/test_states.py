"""Statuses at a moment, from the events of a run: just what the nodes had then."""

import pytest

from drivers.clock import ManualClock
from missions.executive.events import STATUS_WORDS, Event, NodeChanged, Ticked
from missions.executive.executive import Executive
from missions.executive.stream import EventStream
from missions.trees.drawing import NodeState
from missions.trees.states import NodeStates, state_after, states_at
from tests.missions.views.pictures.drawn import downwards, plan_of, ready

TREE = """\
  sequence:
    - selector:
        - wait: 10 s
          timeout: 300 ms
        - wait: 200 ms
      repeat: 2
    - parallel:
        - set: {a: 1}
          hold: 200 ms
        - wait: 400 ms
      name: both
    - fail: enough
"""


def change(t: float, status: str, reason: str = "") -> NodeChanged:
    return NodeChanged(t, 1, "1", "m", "wait", 3, status, reason)


def test_states_at_every_tick_match_the_nodes() -> None:
    clock, heard, sampled = ManualClock(), list[Event](), dict[float, dict[str, str]]()
    root, run = ready(plan_of(TREE), clock)

    def sample(event: Event) -> None:
        heard.append(event)
        if isinstance(event, Ticked):
            sampled[event.t] = {node.key: STATUS_WORDS[node.status] for node in downwards(root)}

    executive = Executive(root, run, EventStream([sample]))
    statuses = list[str]()
    while len(statuses) < 200 and "failure" not in statuses:
        clock.advance(0.05)
        statuses.append(STATUS_WORDS[executive.tick()])
    assert statuses[-1] == "failure"
    assert len(sampled) == len(statuses) > 20
    keys = [node.key for node in downwards(root)]
    for time, then in sampled.items():
        found = states_at(heard, time)
        assert {key: found[key].status if key in found else "idle" for key in keys} == then
    assert states_at(heard, max(sampled))["1"] == NodeState("failure", "enough", max(sampled))


def test_status_holds_from_its_own_time() -> None:
    events = [change(1.0, "running", "waiting"), Ticked(1.0, 1, "running"), change(2.0, "success")]
    assert states_at(events, 0.99) == {}
    assert states_at(events, 1.0) == states_at(events, 1.99) == {"1": NodeState("running", "waiting", 1.0)}
    assert states_at(events, 2.0) == {"1": NodeState("success", "", 2.0)}


def test_typed_time_matches_an_accumulated_one() -> None:
    t = 13.930000000000064  # of 20 ms, some hundred times
    assert states_at([NodeChanged(t, 9, "1", "wait", "wait", 3, "success", "")], 13.93)["1"].since == t


def test_live_states_equal_states_read_from_events() -> None:
    events = [change(1.0, "running"), change(2.0, "idle")]
    states = NodeStates()
    for event in events:
        states.on_event(event)
    assert states.by_key == states_at(events, 9.0) == {"1": NodeState("idle", "", 2.0)}


def test_unknown_status_is_refused() -> None:
    with pytest.raises(KeyError, match="done"):
        state_after(change(1.0, "done"))
