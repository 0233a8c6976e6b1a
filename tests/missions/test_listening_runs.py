"""Missions that listen, in real time: to people whose words are spoken and understood, and to a recording."""

from pathlib import Path

import pytest

import missions
from missions.assembly import simulated_hearing
from missions.executive.events import Event, FaultRaised, Logged, NodeChanged
from missions.library.shipped import load_mission
from missions.plugins.records.replay.rerun import rerun
from missions.request import RunRequest
from tests.missions.records.replay.past import past_of
from tests.missions.spoken import record

ASKS = """mission: ask
tree:
  sequence:
    - say: Coffee?
    - listen: {for: [yes please, "no", hello robot], timeout: 8 s}
      as: answer
    - say: You said ${answer}.
"""
ANNA = "world: w\npeople:\n  - {name: Anna, at: [1.5 m, 0 m], acts: [{hears: coffee, say: Yes please!}]}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "ask.yaml").write_text(ASKS, encoding="utf-8")
    (tmp_path / "w.yaml").write_text(ANNA, encoding="utf-8")
    return tmp_path


def said(events: list[Event]) -> list[str]:
    return [event.text for event in events if isinstance(event, Logged) and event.level == "voice"]


def reasons(events: list[Event]) -> list[str]:
    return [event.reason for event in events if isinstance(event, NodeChanged) and event.kind == "listen"]


@pytest.mark.real_time
def test_simulated_people_are_recognised_from_sound(folder: Path) -> None:
    pytest.importorskip("pocketsphinx")
    pytest.importorskip("espeakng_loader")
    events: list[Event] = []
    result = missions.run(folder / "ask.yaml", simulate="wire", world=str(folder / "w.yaml"), listeners=[events.append])
    assert result.result == "success", reasons(events)
    assert said(events) == ["Coffee?", "You said yes please."]
    assert not [event for event in events if isinstance(event, FaultRaised) and event.status == "fault"]


@pytest.mark.real_time
def test_simulated_speech_arrives_as_text_without_the_extras(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulated_hearing, "NEEDED_MODULES", ("nobody_has_this",))
    events: list[Event] = []
    result = missions.run(folder / "ask.yaml", simulate="wire", world=str(folder / "w.yaml"), listeners=[events.append])
    assert result.result == "success", reasons(events)
    assert said(events) == ["Coffee?", "You said yes please."]
    (fault,) = (event for event in events if isinstance(event, FaultRaised) and event.status == "fault")
    assert (fault.part, "arrives as text" in fault.detail) == ("microphone", True)


@pytest.mark.real_time
def test_a_robot_file_may_name_a_recording(folder: Path) -> None:
    pytest.importorskip("pocketsphinx")
    pytest.importorskip("espeakng_loader")
    wav = record(folder / "a.wav", 14.0, (4.0, "yes please"), (7.0, "yes please"), (10.0, "yes please"))
    robot = folder / "robot.yaml"
    robot.write_text(f"robot: r\nvoice: {{driver: print}}\nmicrophone: {{driver: file, source: {wav}}}\n", "utf-8")
    events: list[Event] = []
    result = missions.run(folder / "ask.yaml", robot=str(robot), listeners=[events.append])
    assert result.result == "success", reasons(events)
    assert said(events) == ["Coffee?", "You said yes please."]


def test_a_record_is_enough_to_decide_again(folder: Path) -> None:
    past = past_of(RunRequest(str(folder / "ask.yaml"), simulate="fast", world=str(folder / "w.yaml"), eyes="truth"))
    found = rerun(past, load_mission(str(folder / "ask.yaml"), complete=True), past.runner.config)
    assert found.is_identical
    assert found.ticks > 40
