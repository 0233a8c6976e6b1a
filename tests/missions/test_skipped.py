"""A node that ``if`` has skipped is told from one that has succeeded: in events, records, pictures and the studio."""

import json
from pathlib import Path

import pytest

from behaviours.catalogue import LEAVES
from config.diagnostics import SourceText
from missions.executive.events import SKIPPED, Event, NodeChanged
from missions.language.document import check_plan
from tests.conformance.harness import Play
from tests.missions.command import command

MISSION = """\
mission: m
params: {polite: false}
tree:
  sequence:
    - log: Hello
      if: ${polite}
      timeout: 3 s
    - log: there
      if: not polite
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    """A folder with the events and the record of a run that has skipped a node."""
    (tmp_path / "m.yaml").write_text(MISSION, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    done = command(capsys, "run", "m.yaml", "--simulate", "fast", "--events", "e.jsonl", "--record", "r.mcap")
    assert done.code == 0, done
    return tmp_path


def test_events_and_records_show_skipped_nodes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = [json.loads(line) for line in (folder / "e.jsonl").read_text(encoding="utf-8").splitlines()]
    ends = [(e["line"], e["kind"], e["status"], e["reason"]) for e in lines if e["event"] == "node_changed"]
    assert [(line, kind) for line, kind, status, why in ends if status == "skipped" and why] == [
        (6, "if"),
        (7, "timeout"),
    ]
    assert (9, "if", "success", "there") in ends
    assert [status for _, kind, status, _ in ends if kind == "sequence"] == ["success"]
    assert "»" in command(capsys, "show", "r.mcap", "--at", "0s").out
    assert command(capsys, "record", "replay", "r.mcap").code == 0


@pytest.mark.parametrize(
    ("node", "told"),
    [
        ("{log: a, if: false}", SKIPPED),
        ("{log: a, if: true}", "success"),
        ("{log: a, if: false, timeout: 3 s, retry: 2}", SKIPPED),
        ("{log: a, if: false, on_success: fail}", SKIPPED),
        ("{log: a, if: false, invert: true}", SKIPPED),
        ("{log: a, if: false, once: true}", SKIPPED),
        ("{pretend: [failure, success], if: true, retry: 2}", "success"),
        ("{log: a, if: battery.percent < 50, repeat: 2}", SKIPPED),
        ("{sequence: [{log: a, if: false}]}", SKIPPED),
        ("{sequence: [{log: a, if: false}, {log: b}]}", "success"),
        ("{log: a, until: true}", "success"),
    ],
)
def test_a_parent_of_skipped_nodes_alone_is_skipped(node: str, told: str) -> None:
    text = f"mission: m\nparams: {{yes_: true}}\ntree: {node}\n"
    play = Play(check_plan(SourceText("m.yaml", text), LEAVES, {}), {"battery": {"percent": 20}})
    heard: list[Event] = []
    play.executive.stream.listeners.append(heard.append)
    play.line("", 0.0)
    play.line("with battery.percent = 80", 0.1)
    ends = [event.status for event in heard if isinstance(event, NodeChanged) and event.node == play.root.key]
    assert ends[-1] == told
