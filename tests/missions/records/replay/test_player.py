"""Playing a record in the terminal: what each key does, and what is to be seen."""

import re
from io import StringIO

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from missions.executive.events import Logged, Notified
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.replay.player_screen import PlayerScreen, event_lines, event_text
from missions.plugins.records.replay.record_player import JUMP_TIME, RecordPlayer

KEYS = [
    " ",
    "left",
    "right",
    "up",
    "down",
    ".",
    ",",
    "f",
    "F",
    "/",
    "n",
    "N",
    "5",
    "x",
    "enter",
    "escape",
    "\x7f",
    "other",
]


def shown(record: RunRecord, player: RecordPlayer, height: int = 40) -> list[str]:
    """Return the lines on the screen."""
    console = Console(width=100, height=height, color_system=None, file=StringIO())
    with console.capture() as captured:
        console.print(PlayerScreen(record).draw(player, height))
    return captured.get().splitlines()


def test_player_advances_at_its_speed_and_pauses_at_the_end(greeted: RunRecord) -> None:
    player = RecordPlayer(greeted, at=1.0, speed=2.0)
    player.advance(1.5)
    assert player.time == pytest.approx(4.0)
    player.advance(1000.0)
    assert (player.time, player.playing) == (greeted.end_time, False)


def test_space_pauses_resumes_and_restarts_at_the_end(greeted: RunRecord) -> None:
    player = RecordPlayer(greeted, at=1.0)
    player.press(" ")
    player.advance(1.0)
    assert player.time == 1.0
    player.press(" ")
    player.advance(1.0)
    assert player.time == 2.0
    player.advance(1000.0)
    player.press(" ")
    assert (player.time, player.playing) == (0.0, True)


def test_arrows_jump_and_change_the_speed(greeted: RunRecord) -> None:
    player = RecordPlayer(greeted)
    player.press("right")
    assert player.time == JUMP_TIME
    player.press("left")
    assert player.time == 0.0
    player.press("up")
    assert player.speed == 2.0
    player.press("down")
    player.press("down")
    assert player.speed == 0.5


def test_digits_go_to_tenths(greeted: RunRecord) -> None:
    player = RecordPlayer(greeted)
    player.press("3")
    assert player.time == pytest.approx(0.3 * greeted.end_time)


def test_comma_and_point_go_from_tick_to_tick(greeted: RunRecord) -> None:
    player = RecordPlayer(greeted)
    times = [moment.t for moment in greeted.tick_records]
    player.press(".")
    first = player.time
    player.press(".")
    assert [first, player.time] == times[:2]
    player.press(",")
    assert player.time == times[0]
    assert not player.playing


def test_f_goes_from_failure_to_failure(alone: RunRecord) -> None:
    player = RecordPlayer(alone)
    times = sorted({failure.t for failure in alone.failures()})
    assert times
    for time in times:
        player.press("f")
        assert player.time == time
    player.press("f")
    assert player.note == "no failure after this time"
    player.press("F")
    assert player.time < times[-1] or player.note == "no failure before this time"


def test_search_finds_spoken_text(greeted: RunRecord) -> None:
    player = RecordPlayer(greeted)
    for key in ["/", *"hellX", "\x7f", "o", "enter"]:
        player.press(key)
    assert player.time == next(event.t for event in greeted.search("hello") if event.t > 0.0)
    player.press("/")
    for key in [*"no such thing", "enter"]:
        player.press(key)
    assert player.note == "no 'no such thing' after this time"


def test_escape_leaves_a_search(greeted: RunRecord) -> None:
    player = RecordPlayer(greeted)
    player.press("/")
    player.press("q")
    assert player.typing == "q"
    player.press("escape")
    assert player.press("q") is False


@given(st.lists(st.sampled_from(KEYS), max_size=30))
def test_player_stays_within_the_record_for_any_keys(greeted: RunRecord, keys: list[str]) -> None:
    player = RecordPlayer(greeted)
    for key in keys:
        assert player.press(key)
        player.advance(0.1)
        assert 0.0 <= player.time <= greeted.end_time


def test_the_screen_shows_the_tree_with_signs_reasons_and_variables(greeted: RunRecord) -> None:
    time = next(event.t for event in greeted.events if getattr(event, "kind", "") == "gesture")
    rows = shown(greeted, RecordPlayer(greeted, at=time + 0.1))
    text = "\n".join(rows)
    assert rows[0].startswith("greet  ▶")
    assert any("▶ gesture: ${gesture}" in row for row in rows)
    assert any("✓ find_face" in row and "[timeout: ${patience}" in row for row in rows)
    assert any("○" in row for row in shown(greeted, RecordPlayer(greeted)))
    assert "greeting = Hello!" in text
    assert 'robot: "Hello!"' in text
    assert "q quit" in rows[-1]


def test_a_failure_shows_why(alone: RunRecord) -> None:
    player = RecordPlayer(alone)
    player.press("f")
    assert any("✗" in row and "no face found" in row for row in shown(alone, player))


def test_notices_are_shown() -> None:
    assert event_text(Notified(1.0, 20, "Anna was met")) == "notice: Anna was met"


def test_speakers_are_shown_by_name() -> None:
    assert event_text(Logged(1.0, "person", "Anna: yes: please")) == 'Anna: "yes: please"'
    assert event_text(Logged(1.0, "voice", "Is it: you?")) == 'robot: "Is it: you?"'
    assert event_text(Logged(1.0, "warning", "base: slow")) == "warning: base: slow"


def test_percept_is_described_in_words(greeted: RunRecord) -> None:
    told = [line for line in event_lines(greeted, 0.0) if "    person = " in line]
    assert len(told) == 1  # and not again in each picture
    assert re.search(r"person = face 1, \d\.\d m, \d+° (left|right)$", told[0])
    assert any("  person = face 1, " in row for row in shown(greeted, RecordPlayer(greeted, at=greeted.end_time)))


def test_small_terminal_shows_the_running_node(greeted: RunRecord) -> None:
    time = next(event.t for event in greeted.events if getattr(event, "kind", "") == "gesture")
    rows = shown(greeted, RecordPlayer(greeted, at=time + 0.1), height=12)
    assert len(rows) <= 12
    assert any("▶ gesture" in row for row in rows)


def test_replay_without_terminal_prints_a_line_for_each_change(alone: RunRecord) -> None:
    told = list(event_lines(alone, 0.0))
    assert any("▶ running  find_face (line 12)" in line for line in told)
    assert any("✗ failure  timeout 'find_face' (line 13): no face found (timed out after 2 s)" in line for line in told)
    late = list(event_lines(alone, 1.5))
    assert 0 < len(late) < len(told)
    assert told[-len(late) :] == late
