"""A base that measures nothing: what is done on it says so, and no condition rests on where it believes to be."""

from pathlib import Path

import pytest

import missions
from missions.executive.events import Event, Logged, NodeChanged
from missions.request import RunRequest
from missions.runner import Runner

DRIVE = """\
mission: m
tree:
  sequence:
    - drive: {distance: 50 cm}
    - log: "${base.reckoned} ${round(base.x / 1 m, 1)}"
"""


def events_of(tree: str, folder: Path) -> tuple[str, str, list[Event]]:
    mission = folder / "m.yaml"
    mission.write_text(tree, encoding="utf-8")
    events: list[Event] = []
    order = RunRequest(str(mission), robot="wave_rover", simulate="fast", eyes="truth")
    outcome = Runner(order, listeners=[events.append]).run()
    return outcome.result, outcome.reason, events


def test_drive_by_dead_reckoning_is_reported(tmp_path: Path) -> None:
    result, end, events = events_of(DRIVE, tmp_path)
    assert (result, end) == ("success", "by dead reckoning: nothing measured how far the base went")
    assert [event.text for event in events if isinstance(event, Logged) and event.level == "info"] == ["yes 0.5"]
    reasons = [event.reason for event in events if isinstance(event, NodeChanged) and event.reason]
    assert any("(dead reckoning)" in reason for reason in reasons)
    assert [event.reason for event in events if isinstance(event, NodeChanged) and event.reason == end]


@pytest.mark.parametrize("condition", ["until: base.x > 30 cm", "while: base.heading < 1 rad", "if: base.y > 0 m"])
def test_condition_on_a_dead_reckoning_pose_fails(condition: str, tmp_path: Path) -> None:
    tree = f"mission: m\ntree:\n  sequence:\n    - drive: {{distance: 50 cm}}\n      {condition}\n"
    result, reason, _ = events_of(tree, tmp_path)
    assert result == "failure"
    assert "is dead reckoning, which no condition may use" in reason


def test_square_is_driven_by_dead_reckoning() -> None:
    ran = missions.run("square_3m", robot="wave_rover", simulate="fast", params={"side": "50 cm"}, eyes="truth")
    assert ran.result == "success"


def test_base_without_a_battery_sensor_reports_100_percent_and_0_volts(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(
        'mission: m\ntree:\n  log: "${battery.percent} ${battery.voltage / 1 V}"\n', encoding="utf-8"
    )
    events: list[Event] = []
    order = RunRequest(str(tmp_path / "m.yaml"), robot="pi_car", simulate="fast", eyes="truth")
    assert Runner(order, listeners=[events.append]).run().result == "success"
    assert [event.text for event in events if isinstance(event, Logged) and event.level == "info"] == ["100 0"]
