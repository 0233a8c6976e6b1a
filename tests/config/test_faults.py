"""Mistakes, as they are shown."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.diagnostics import (
    MAX_DIAGNOSTICS,
    Diagnostic,
    InvalidFileError,
    Mark,
    SourceText,
    add_diagnostic,
    closest,
    did_you_mean,
    mark_at,
    suggest_from,
)

SOURCE = SourceText("greet.yaml", "mission: greet\ntree:\n  - face_sen: 3\n")


def test_diagnostic_shows_its_line_with_carets() -> None:
    fault = Diagnostic(SOURCE, Mark(3, 5, 8), "unknown behaviour 'face_sen'", "did you mean 'face_seen'?")
    assert str(fault) == (
        "greet.yaml:3:5: unknown behaviour 'face_sen'\n"
        "     3 |   - face_sen: 3\n"
        "       |     ^^^^^^^^\n"
        "  did you mean 'face_seen'?"
    )


def test_a_fault_in_an_empty_line_or_past_the_end_shows_no_line() -> None:
    assert str(Diagnostic(SOURCE, Mark(9, 1), "the file ends too early")) == "greet.yaml:9:1: the file ends too early"
    assert str(Diagnostic(SourceText("m", "a\n\n"), Mark(2, 1), "empty")) == "m:2:1: empty"


def carets(text: str, mark: Mark) -> tuple[str, str]:
    _, shown, under = str(Diagnostic(SourceText("m", text), mark, "wrong")).splitlines()
    return shown, under


def test_tab_counts_as_one_space_for_carets() -> None:
    assert carets("\ta: b", Mark(1, 5, 1)) == ("     1 |  a: b", "       |     ^")


def test_control_codes_do_not_reach_the_terminal() -> None:
    shown, _ = carets("say: \x1b[31m\x07", Mark(1, 6))
    assert shown == "     1 | say: \ufffd[31m\ufffd"


def test_carets_account_for_wide_characters() -> None:
    assert carets("say: こん ${x}", Mark(1, 9, 4)) == ("     1 | say: こん ${x}", "       |           ^^^^")
    assert carets("say: cafe\u0301 x", Mark(1, 12, 1))[1] == "       |           ^"


def test_a_long_line_is_shown_around_the_mistake() -> None:
    shown, under = carets("x" * 500 + "WRONG" + "y" * 500, Mark(1, 501, 5))
    assert len(shown) < 200
    assert shown[under.index("^") : under.rindex("^") + 1] == "WRONG"


@given(st.text(max_size=300), st.integers(1, 9), st.integers(1, 400), st.integers(1, 400))
def test_every_fault_can_be_shown(text: str, line: int, column: int, length: int) -> None:
    lines = str(Diagnostic(SourceText("m", text), Mark(line, column, length), "wrong")).split("\n")
    assert lines[0] == f"m:{line}:{column}: wrong"
    assert len(lines) in {1, 3}
    assert all(len(shown) < 200 for shown in lines[1:])


@given(st.text("ab\n\r\u2028é", min_size=1), st.data())
def test_mark_at_points_to_its_character(text: str, data: st.DataObject) -> None:
    position = data.draw(st.integers(0, len(text) - 1).filter(lambda at: text[at] not in "\n\r\u2028"))
    mark = mark_at(text, position)
    assert SourceText("m", text).line(mark.line)[mark.column - 1] == text[position]


def test_faults_come_in_the_order_of_the_file_and_each_once() -> None:
    late, early = Diagnostic(SOURCE, Mark(3, 5), "late"), Diagnostic(SOURCE, Mark(1, 1), "early")
    error = InvalidFileError([late, early, late])
    assert error.diagnostics == (early, late)
    assert str(error) == f"{early}\n{late}"


def test_add_diagnostic_raises_at_the_maximum() -> None:
    faults: list[Diagnostic] = []
    for line in range(1, MAX_DIAGNOSTICS):
        add_diagnostic(faults, Diagnostic(SOURCE, Mark(line), "wrong"))
    with pytest.raises(InvalidFileError) as caught:
        add_diagnostic(faults, Diagnostic(SOURCE, Mark(MAX_DIAGNOSTICS), "wrong"))
    assert len(caught.value.diagnostics) == MAX_DIAGNOSTICS


def test_closest_word_is_suggested_case_insensitively() -> None:
    assert did_you_mean("trak_face", ["say", "track_face"]) == "did you mean 'track_face'?"
    assert did_you_mean("SAY", ["say"]) == "did you mean 'say'?"
    assert did_you_mean("ax-12a", ["AX-12A"]) == "did you mean 'AX-12A'?"
    assert did_you_mean("xyz", ["say"]) == ""


@pytest.mark.parametrize("word", ["sya", "sai", "sy", "ssay", "say", "ay"])
def test_one_slip_in_a_short_word_is_seen(word: str) -> None:
    assert closest(word, ["drive", "say"]) == "say"


@pytest.mark.parametrize(("word", "other"), [("dance", "race"), ("home", "house"), ("dance", "drive")])
def test_short_anagram_is_not_suggested(word: str, other: str) -> None:
    assert did_you_mean(word, [other]) == ""


@given(st.text("abc", min_size=2, max_size=5), st.data())
def test_any_letter_may_be_missing_from_a_short_word(word: str, data: st.DataObject) -> None:
    at = data.draw(st.integers(0, len(word) - 1))
    assert closest(word[:at] + word[at + 1 :], [word]) == word


def test_where_nothing_is_close_all_words_are_listed_once() -> None:
    assert suggest_from("xyz", ["say", "drive", "say"]) == "known are: drive, say"
    assert suggest_from("xyz", []) == ""


@pytest.mark.parametrize(
    ("word", "known"),
    [
        ("undocked", "docked"),
        ("discharging", "charging"),
        ("face.unseen", "face.seen"),
        ("face_not_seen", "face_seen"),
        ("no_face_seen", "face_seen"),
        ("wave_left", "wave_right"),
        ("arm_up", "arm_down"),
        ("min_speed", "max_speed"),
        ("on_failure", "on_success"),
        ("back_off", "back_on"),
        ("joint_unloaded", "joint_loaded"),
        ("anticlockwise", "clockwise"),
        ("head_forward", "head_backward"),
    ],
)
def test_opposite_word_is_not_suggested(word: str, known: str) -> None:
    assert closest(word, [known]) == closest(known, [word]) == ""
    assert closest(word, [known, "something_else", "docking", "charged"]) == ""


@pytest.mark.parametrize(
    ("slip", "known"),
    [
        ("turn_lef", "turn_left"),
        ("max_sped", "max_speed"),
        ("baterry", "battery"),
        ("knob", "knobs"),
        ("inedx", "index"),
    ],
)
def test_typo_in_a_word_with_an_opposite_is_corrected(slip: str, known: str) -> None:
    assert closest(slip, [known]) == known
