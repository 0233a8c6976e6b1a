"""When a run tells those who watch it how it is."""

from types import SimpleNamespace
from typing import Any

import pytest

from drivers.clock import ManualClock
from missions.control.clients import IDLE_STATE_INTERVAL, MOVING_STATE_INTERVAL, Broadcaster
from tests.cases import each


@each(
    ("news", "pause"),
    [
        ({"pose": [0.1, 0.0, 0.0]}, MOVING_STATE_INTERVAL),
        ({"joints": {"elbow": [0.5, 0.0, 30.0]}}, MOVING_STATE_INTERVAL),
        ({"scan": [[1.0, 0.0]]}, MOVING_STATE_INTERVAL),
        ({"tick": 7}, IDLE_STATE_INTERVAL),
        ({"driver": "Ada"}, MOVING_STATE_INTERVAL),
    ],
)
def test_state_is_sent_sooner_while_the_robot_moves_or_is_driven(news: dict[str, object], pause: float) -> None:
    clock = ManualClock()
    outlet: Any = SimpleNamespace(
        take_changes=lambda more: {**more, **news}, is_watched=True, has_event_listeners=False
    )
    others: Any = SimpleNamespace(status=dict, is_watched=False)
    audience = Broadcaster("1", others, outlet, others, others, clock, {})
    clock.advance(1.0)
    audience.send_state()
    assert audience.due == pytest.approx(1.0 + pause)
