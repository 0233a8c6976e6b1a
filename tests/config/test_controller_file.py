"""Controller files: rule bases as plain values."""

import math
from pathlib import Path

import pytest

from config.controller import ControllerConfig, load_controller
from config.faults import Fault, InvalidFileError


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "controller.yaml"


def load(file: Path, text: str) -> ControllerConfig:
    file.write_text(text, encoding="utf-8")
    return load_controller(file)


def mistakes(file: Path, text: str) -> list[Fault]:
    with pytest.raises(InvalidFileError) as caught:
        load(file, text)
    return list(caught.value.faults)


def test_a_controller_is_plain_values_with_its_quantities_in_si(file: Path) -> None:
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


def test_a_table_whose_head_is_no_list_is_told_once(file: Path) -> None:
    (fault,) = mistakes(file, "controller: face\npan:\n  rules:\n    e / r: a\n    left: [a, b]\n")
    assert fault.mark.line == 4


def test_a_controller_needs_a_name(file: Path) -> None:
    (fault,) = mistakes(file, "pan: {}\n")
    assert fault.message == "a controller file needs 'controller'"
