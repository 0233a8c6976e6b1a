"""How far joints were off: the figures of what was measured, each reading once."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.joint_motion import JointError, JointSample, TrackingErrors


def test_tracking_errors_have_rms_worst_and_time_per_joint() -> None:
    tracking = TrackingErrors()
    tracking.add([JointSample(0.1, "elbow", 0.0, 0.3), JointSample(0.1, "wrist", 1.0, 1.0)])
    tracking.add([JointSample(0.2, "elbow", 1.0, 0.6)])
    errors = tracking.errors()
    assert list(errors) == ["elbow", "wrist"]
    assert errors["elbow"].rms == pytest.approx(0.125**0.5)
    assert errors["elbow"].worst == pytest.approx(0.4)
    assert (errors["elbow"].at, errors["elbow"].readings) == (0.2, 2)
    assert errors["wrist"] == JointError(0.0, 0.0, 0.1, 1)


def test_repeated_reading_is_counted_once() -> None:
    tracking = TrackingErrors()
    for _ in range(3):
        tracking.add([JointSample(0.1, "elbow", 0.0, 0.3)])
    assert len(tracking.samples) == 1


def test_tracking_errors_are_empty_without_readings() -> None:
    assert TrackingErrors().errors() == {}


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=50))
def test_the_root_of_the_mean_square_is_never_above_the_worst(errors: list[float]) -> None:
    tracking = TrackingErrors()
    tracking.add(JointSample(float(n), "elbow", 0.0, error) for n, error in enumerate(errors))
    found = tracking.errors()["elbow"]
    assert 0.0 <= found.rms <= found.worst * (1 + 1e-9)
    assert found.worst == max(map(abs, errors))
    assert found.readings == len(errors)
