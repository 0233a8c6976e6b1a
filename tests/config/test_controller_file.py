"""Controller files: rule bases as plain values."""

import math
from pathlib import Path

import pytest

from config.controller import (
    ControllerConfig,
    load_controller,
    name_changes,
    parse_controller,
    replace_words,
    tunable_numbers,
)
from config.diagnostics import Diagnostic, InvalidFileError, SourceText


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "controller.yaml"


def load(file: Path, text: str) -> ControllerConfig:
    file.write_text(text, encoding="utf-8")
    return load_controller(file)


def mistakes(file: Path, text: str) -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        load(file, text)
    return list(caught.value.diagnostics)


def test_controller_values_are_plain_and_in_si_units(file: Path) -> None:
    controller = load(
        file,
        "controller: face\nsummary: Follow.\npan:\n  inputs: {error: {left: 90 deg, ahead: [-1 rad, 1 rad]}}\n"
        "  rules:\n    - if error is left then turn is fast\n",
    )
    assert (controller.name, controller.summary) == ("face", "Follow.")
    assert controller.values == {
        "pan": {
            "inputs": {"error": {"left": pytest.approx(math.pi / 2), "ahead": [-1.0, 1.0]}},
            "rules": ["if error is left then turn is fast"],
        }
    }


def test_rows_of_a_table_must_be_as_long_as_the_first(file: Path) -> None:
    faults = mistakes(
        file,
        "controller: face\npan:\n  rules:\n    e / r: [a, b]\n    left: [a, b]\n    right: [a]\n    ahead: [a, b, c]\n"
        "tilt:\n  rules:\n    e / r: [a]\n    up: a\n",
    )
    assert [(fault.mark.line, fault.mark.column, fault.message) for fault in faults] == [
        (6, 5, "row 'right' has 1 conclusions for 2 columns"),
        (7, 5, "row 'ahead' has 3 conclusions for 2 columns"),
        (11, 9, "row 'up' needs a list: [one conclusion for each column]"),
    ]


def test_rule_table_with_a_malformed_head_is_reported_once(file: Path) -> None:
    (fault,) = mistakes(file, "controller: face\npan:\n  rules:\n    e / r: a\n    left: [a, b]\n")
    assert fault.mark.line == 4


def test_a_controller_needs_a_name(file: Path) -> None:
    (fault,) = mistakes(file, "pan: {}\n")
    assert fault.message == "a controller file needs 'controller'"


def test_unknown_controller_key_is_reported_with_position(file: Path) -> None:
    faults = mistakes(file, "controller: face\npan: {ruels: [], p: -1}\npredict: no way\nroll: {}\n")
    assert [(fault.mark.line, fault.message, fault.suggestion) for fault in faults] == [
        (2, "'pan' has no key 'ruels'", "did you mean 'rules'?"),
        (2, "'p' must be at least 0.0", ""),
        (3, "'predict' needs true or false", ""),
        (4, "a controller file has no key 'roll'", "known are: base, controller, pan, predict, summary, tilt, turn"),
    ]


# --- the numbers in them ----------------------------------------------------------------------------------------------

TEXT = """\
# A comment.
controller: small    # its name
summary: For 5 tests.
pan: &same
  inputs: {error: {left: [-4 deg, 0 deg], right: 1.5e1 deg}}
  rules: ["if error is left then turn is 7"]
turn: *same
tilt: {p: 4, d: .5, most: 120 deg/s}
"""
SMALL = SourceText("small.yaml", TEXT)


def test_the_numbers_of_the_rule_bases_are_known_with_their_units_each_once() -> None:
    found = [(figure.keys, figure.number, figure.unit) for figure in tunable_numbers(SMALL)]
    assert found == [
        (("pan", "inputs", "error", "left"), -4.0, "deg"),
        (("pan", "inputs", "error", "left"), 0.0, "deg"),
        (("pan", "inputs", "error", "right"), 15.0, "deg"),
        (("tilt", "p"), 4.0, ""),
        (("tilt", "d"), 0.5, ""),
    ]


def test_a_file_is_rewritten_in_place_and_keeps_all_else() -> None:
    first, _, third, *_ = tunable_numbers(SMALL)
    text = replace_words(SMALL, {first.mark: "-12.25 deg", third.mark: "9 deg"})
    assert text == TEXT.replace("-4 deg", "-12.25 deg").replace("1.5e1 deg", "9 deg")
    assert replace_words(SMALL, {}) == TEXT


def test_controller_name_and_summary_are_replaced_in_place() -> None:
    text = replace_words(SMALL, name_changes(SMALL, "new one", 'Says: "no" # twice.'))
    config = parse_controller(SourceText("new.yaml", text))
    assert (config.name, config.summary) == ("new one", 'Says: "no" # twice.')
    assert config.values == parse_controller(SMALL).values
    assert "# A comment." in text
    assert "# its name" in text


def test_multi_line_summary_is_kept() -> None:
    source = SourceText("long.yaml", TEXT.replace("For 5 tests.", "For 5\n  tests."))
    text = replace_words(source, name_changes(source, "new", "Short."))
    assert parse_controller(SourceText("new.yaml", text)).summary == "For 5 tests."
