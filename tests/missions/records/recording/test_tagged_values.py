"""Values of drivers and perception survive being written, to the last bit."""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum, IntFlag
from math import isnan, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.units import Quantity
from drivers.api import DockBeam, HeadPose, Image, Lamp, Quality, Ranges, RangeScan, Reading, Source, Velocity
from drivers.errors import DriverError, NoReply
from missions.plugins.records.recording.tagged_values import (
    ERRORS_BY_NAME,
    TYPES_BY_NAME,
    dumps,
    from_json,
    tag_value,
    to_json,
    untag_value,
)
from perception.api import View

FLOATS = st.floats(allow_nan=True, allow_infinity=True)
TEXTS = st.text(max_size=20)
RANGES = st.lists(st.floats(width=32), max_size=30).map(lambda values: np.array(values, np.float32))
SAMPLES = st.lists(st.integers(-(2**15), 2**15 - 1), max_size=30).map(lambda values: np.array(values, np.int16))
IMAGES = st.integers(1, 5).map(lambda size: np.arange(size * size * 3, dtype=np.uint8).reshape(size, size, 3))

VALUES = {
    name: st.builds(kind, value=st.none() | st.builds(HeadPose)) if kind is Reading else st.from_type(kind)
    for name, kind in TYPES_BY_NAME.items()
    if name not in ("RangeScan", "CameraFrame", "Sound")
} | {
    "RangeScan": st.builds(RangeScan, ranges=RANGES),
    "CameraFrame": st.builds(TYPES_BY_NAME["CameraFrame"], image=IMAGES),
    "Sound": st.builds(TYPES_BY_NAME["Sound"], samples=SAMPLES),
}


def same(one: Any, other: Any) -> bool:
    """Say whether two values are alike in all, types included; NaN is like NaN."""
    if isinstance(one, np.ndarray):
        return bool(one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes())
    if isinstance(one, Mapping):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if type(one) is not type(other):
        return False
    if isinstance(one, float):
        return isnan(other) if isnan(one) else one == other and str(one) == str(other)
    if isinstance(one, DriverError):
        return str(one) == str(other) and one.hint == other.hint
    if is_dataclass(one):
        return all(same(getattr(one, field.name), getattr(other, field.name)) for field in fields(one))
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(same(*pair) for pair in zip(one, other, strict=True))
    return bool(one == other)


def through_a_file(data: object) -> object:
    found: object = json.loads(dumps(data))
    return found


@pytest.mark.parametrize("name", TYPES_BY_NAME)
@settings(max_examples=25)
@given(data=st.data())
def test_driver_and_percept_values_round_trip(name: str, data: st.DataObject) -> None:
    value = data.draw(VALUES[name])
    assert same(from_json(through_a_file(to_json(value)), TYPES_BY_NAME[name]), value)
    assert same(untag_value(through_a_file(tag_value(value))), value)


PLAIN = st.none() | st.booleans() | st.integers() | FLOATS | TEXTS | st.sampled_from([*Source, *Lamp, *Quality])
ANYTHING = st.recursive(
    PLAIN | st.builds(Velocity) | st.from_type(View),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(TEXTS | st.integers() | st.just("$"), inner, max_size=3)
        | st.frozensets(st.integers() | TEXTS, max_size=3)
    ),
    max_leaves=8,
)


@given(ANYTHING)
def test_untyped_values_keep_their_type(value: object) -> None:
    assert same(untag_value(through_a_file(tag_value(value))), value)


@pytest.mark.parametrize("kind", ERRORS_BY_NAME.values())
def test_errors_keep_type_message_and_hint(kind: type[DriverError]) -> None:
    error = untag_value(through_a_file(tag_value(kind("arm: servo 3 is silent", hint="mission servo scan"))))
    assert same(error, kind("arm: servo 3 is silent", hint="mission servo scan"))


def test_unknown_error_type_becomes_its_nearest_known_base() -> None:
    class Hot(NoReply):
        """Too hot to speak."""

    assert same(untag_value(tag_value(Hot("arm: hot"))), NoReply("arm: hot"))


def test_value_of_an_unknown_type_becomes_text() -> None:
    class Mood(Enum):
        GOOD = 1

    assert untag_value(through_a_file(tag_value(Mood.GOOD))) == "Mood.GOOD"
    assert untag_value(through_a_file(tag_value(complex(1, 2)))) == "(1+2j)"


def test_numbers_of_numpy_are_numbers() -> None:
    velocity = Velocity(np.float64(0.5), 0.25)
    assert from_json(through_a_file(to_json(velocity)), Velocity) == Velocity(0.5, 0.25)
    assert untag_value(through_a_file(tag_value([np.int64(3), np.float32(nan)]))) == [
        3,
        pytest.approx(nan, nan_ok=True),
    ]


def test_quantity_is_stored_as_a_number() -> None:
    assert untag_value(through_a_file(tag_value(Quantity(0.5, "length", "50 cm")))) == 0.5


def test_arrays_keep_their_form() -> None:
    for array in (np.zeros((2, 3), np.uint8), np.array([1.5], ">f4")):
        found = untag_value(through_a_file(tag_value(array)))
        assert found.shape == array.shape
        assert (found == array).all()
    image: Image = np.zeros((2, 2, 3), np.uint8)
    ranges: Ranges = np.zeros(2, np.float32)
    assert untag_value(tag_value(image)).dtype == np.uint8
    assert untag_value(tag_value(ranges)).dtype == np.float32


@pytest.mark.parametrize("data", [None, 5, "x", [], {"looked": {}}, {"faces": [3]}, {"faces": 1}])
def test_value_of_another_type_is_refused(data: object) -> None:
    with pytest.raises(ValueError, match="View"):
        from_json(data, View)


def test_missing_members_get_defaults_and_unknown_ones_are_refused() -> None:
    assert from_json({"looked": 1.0}, View) == View(looked=1.0)
    with pytest.raises(ValueError, match="'mood' is not a member of View"):
        from_json({"looked": 1.0, "mood": "new"}, View)


def test_flags_are_of_their_own_kind() -> None:
    beams = untag_value(through_a_file(tag_value(DockBeam(5))))
    assert isinstance(beams, IntFlag)
    assert beams is DockBeam(5)
