"""Gesture files: keyframes in rising order of time."""

import math
from pathlib import Path

import pytest

from config.diagnostics import Diagnostic, InvalidFileError
from config.gesture import GestureConfig, load_gesture


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "gesture.yaml"


def load(file: Path, text: str) -> GestureConfig:
    file.write_text(text, encoding="utf-8")
    return load_gesture(file)


def mistakes(file: Path, text: str) -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        load(file, text)
    return list(caught.value.diagnostics)


def test_a_gesture_is_read_in_seconds_and_radians(file: Path) -> None:
    gesture = load(
        file,
        "gesture: nod\nsummary: Yes.\nkeyframes:\n"
        "  - {at: 500 ms, neck: 30 deg}\n  - {at: 1 s, neck: 0 deg, waist: -90 deg}\n",
    )
    assert (gesture.name, gesture.summary, gesture.joints) == ("nod", "Yes.", frozenset({"neck", "waist"}))
    (first, raised), (second, lowered) = gesture.keyframes
    assert (first, second) == (0.5, 1.0)
    assert raised == {"neck": pytest.approx(math.radians(30))}
    assert lowered == {"neck": 0.0, "waist": pytest.approx(-math.pi / 2)}


def test_all_faults_are_reported_together_with_positions(file: Path) -> None:
    faults = mistakes(
        file,
        "gesture: nod\n"
        "speed: 2\n"
        "keyframes:\n"
        "  - {at: 0 s, neck: 30 deg}\n"
        "  - {at: 2 s, neck: 30}\n"
        "  - {at: 2 s, neck: 1 m}\n"
        "  - {neck: 0 deg}\n"
        "  - {at: -1 s}\n"
        "  - nod\n",
    )
    assert [(fault.mark.line, fault.mark.column, fault.message) for fault in faults] == [
        (2, 1, "a gesture file has no key 'speed'"),
        (4, 10, "'at' must be later than 0 s, as keyframes follow one another"),
        (5, 21, "'neck' needs an angle such as '30 deg': '30' has no unit (units: deg, rad)"),
        (6, 10, "'at' must be later than 2 s, as keyframes follow one another"),
        (6, 21, "'neck' needs an angle such as '30 deg', got a length: '1 m'"),
        (7, 5, "a keyframe needs 'at'"),
        (8, 10, "'at' must be at least 0 s"),
        (9, 5, "a keyframe must be a mapping of keys to values, such as 'name: value'"),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("gesture: nod\n", "a gesture file needs 'keyframes'"),
        ("gesture: nod\nkeyframes: []\n", "'keyframes' needs at least one keyframe"),
        ("gesture: nod\nkeyframes: {at: 1 s}\n", "'keyframes' needs a list"),
        ("keyframes: [{at: 1 s, neck: 1 deg}]\n", "a gesture file needs 'gesture'"),
    ],
)
def test_a_gesture_needs_a_name_and_keyframes(file: Path, text: str, message: str) -> None:
    assert [fault.message for fault in mistakes(file, text)] == [message]


def test_cubic_gesture_may_start_at_zero(file: Path) -> None:
    text = "gesture: nod\ninterpolation: cubic\nkeyframes:\n  - {at: 0 s, neck: 1 deg}\n  - {at: 1 s, neck: 2 deg}\n"
    gesture = load(file, text)
    assert gesture.interpolation == "cubic"
    assert [time for time, _ in gesture.keyframes] == [0.0, 1.0]
    assert load(file, "gesture: nod\nkeyframes: [{at: 1 s, neck: 1 deg}]\n").interpolation == "minimum_jerk"
    (fault,) = mistakes(file, text.replace("at: 1 s", "at: 0 s"))
    assert (fault.mark.line, fault.message) == (
        5,
        "'at' must be later than 0 s, as keyframes follow one another",
    )
    fault, *_ = mistakes(file, text.replace("cubic", "round"))
    assert (fault.mark.line, fault.mark.column, fault.message) == (2, 16, "'interpolation' cannot be 'round'")


def test_a_gesture_can_be_held_to_the_joints_of_a_robot(file: Path) -> None:
    text = "gesture: nod\nkeyframes:\n  - {at: 1 s, nek: 1 deg}\n  - {at: 2 s, neck: 91 deg}\n"
    load(file, text)
    with pytest.raises(InvalidFileError) as caught:
        load_gesture(file, {"neck": (0.0, math.pi / 2)})
    assert [(f.mark.line, f.mark.column, f.message, f.suggestion) for f in caught.value.diagnostics] == [
        (3, 15, "there is no joint 'nek'", "did you mean 'neck'?"),
        (4, 21, "'neck' at 91 deg is outside its limits, 0 deg to 90 deg", ""),
    ]
