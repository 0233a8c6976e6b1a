"""What a run tells on the terminal, line by line."""

from io import StringIO
from pathlib import Path

import pytest

from missions.cli.live import RunDisplay
from missions.executive.events import CommandSent, Event, FaultRaised, Logged, Notified, Started, Ticked
from tests.missions.command import command


@pytest.mark.parametrize(
    ("event", "line"),
    [
        (CommandSent(1.0, 20, "screen", "face (1.1)", {"mood": "happy"}), "  face: happy"),
        (CommandSent(1.0, 20, "screen", "show (1.2)", {"show": "Hello Anna!"}), "  shows: Hello Anna!"),
        (CommandSent(1.0, 20, "screen", "show (1.2)", {"show": ""}), ""),
        (FaultRaised(0.0, "screen", "online", "screen: the robot's face (screen): http://127.0.0.1:8391/"),
         "  the robot's face (screen): http://127.0.0.1:8391/"),
        (FaultRaised(0.0, "base", "online", "base: reports"), ""),
        (FaultRaised(2.0, "base", "offline", "base: no report for 0.5 s", "look at its cable"),
         "   2.0 s  ! base: no report for 0.5 s\n            try: look at its cable"),
        (Logged(1.0, "voice", "Hello"), "  robot: Hello"),
        (Logged(1.0, "person", "Anna: Good day: sunny"), "  Anna: Good day: sunny"),
        (Notified(1.0, 20, "Anna was met"), "  notice: Anna was met"),
    ],
)  # fmt: skip
def test_run_display_prints_a_line_for_each_relevant_event(event: Event, line: str) -> None:
    out = StringIO()
    with RunDisplay(out) as watcher:
        watcher(event)
    assert out.getvalue() == (f"{line}\n" if line else "")


def test_run_display_reports_only_reconnected_parts() -> None:
    out, address = StringIO(), "http://192.168.4.1:81/stream"
    with RunDisplay(out) as watcher:
        watcher(FaultRaised(0.1, "camera", "online", f"{address} gives pictures"))
        watcher(FaultRaised(2.0, "camera", "offline", f"camera: {address}: no picture for 2.0 s"))
        watcher(FaultRaised(2.0, "base", "fault", "base: a wheel has dropped"))
        watcher(FaultRaised(4.5, "camera", "online", f"{address} gives pictures again"))
        watcher(FaultRaised(5.0, "camera", "online", f"{address} gives pictures again"))
    assert out.getvalue().splitlines() == [
        f"   2.0 s  ! camera: {address}: no picture for 2.0 s",
        "   2.0 s  ! base: a wheel has dropped",
        f"   4.5 s  \u2713 camera: back: {address} gives pictures again",
    ]


class Terminal(StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("first", "line"), [(7.1, "   7.1 s  ready\n"), (0.03, "")])
def test_run_display_reports_a_slow_start(first: float, line: str) -> None:
    out = StringIO()
    with RunDisplay(out) as watcher:
        for t in (first, first + 0.05, first + 2.0):
            watcher(Ticked(t, 1, "running", None))
    assert out.getvalue() == line


def test_run_display_shows_ready_parts_until_the_first_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    out = Terminal()
    with RunDisplay(out) as watcher:
        watcher(Started(0.0, "ask", "m.yaml", "turtlebot2", {}))
        watcher(FaultRaised(0.1, "base", "online", ""))
        watcher(FaultRaised(0.2, "head", "online", ""))
        watcher(Ticked(3.0, 1, "running", None))
        told = out.getvalue()
        watcher(FaultRaised(4.0, "arm", "online", ""))
        assert "getting ready: base, head" in told
        assert "getting ready" not in out.getvalue()[len(told) :]


@pytest.mark.parametrize(
    ("tree", "note"), [("{wait: 5 s, timeout: 1 s}", "timed out"), ("{race: [{wait: 1 s}, {wait: 5 s}]}", "halted")]
)
def test_run_display_shows_whether_a_timeout_halted_a_leaf(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], tree: str, note: str
) -> None:
    mission = tmp_path / "nap.yaml"
    mission.write_text(f"mission: nap\ntree: {tree}\n", encoding="utf-8")
    assert f"- wait  (1.0 s, {note})\n" in command(capsys, "run", str(mission), "--simulate", "fast").out
