"""People followed over time."""

from math import degrees, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.api import Box, Detection, Face, Gaze
from perception.geometry import Pinhole
from perception.tracks import FaceSighting, Tracker

CAMERA = Pinhole(640, 480, radians(60))


def at(bearing: float, drop: float = 0.0, *, width: float = 90.0, found: bool = True) -> FaceSighting:
    """A face whose middle is at these angles in degrees from the optical axis."""
    x, y = CAMERA.angles_to_pixel(radians(bearing), radians(drop))
    return FaceSighting(Detection(Box(x - width / 2, y - width / 2, width, width), 5.0), found)


def see(tracker: Tracker[Face], stamp: float, *sightings: FaceSighting, gaze: Gaze | None = None) -> tuple[Face, ...]:
    return tracker.update(sightings, camera=CAMERA, gaze=gaze, stamp=stamp)


def test_face_is_reported_after_two_detections() -> None:
    tracker = Tracker[Face]()
    assert see(tracker, 0.0, at(5)) == ()
    (face,) = see(tracker, 0.05, at(5))
    assert face.id == 1
    assert face.stamp == 0.05
    assert degrees(face.bearing) == pytest.approx(5)
    assert degrees(face.yaw) == pytest.approx(5, abs=0.01)
    assert face.distance == pytest.approx(CAMERA.face_distance(face.box))


def test_carried_detection_does_not_confirm_a_face() -> None:
    tracker = Tracker[Face]()
    see(tracker, 0.0, at(5))
    assert see(tracker, 0.05, at(5, found=False)) == ()
    assert len(see(tracker, 0.10, at(5))) == 1


def test_flickering_false_faces_are_never_reported() -> None:
    tracker = Tracker[Face]()
    for step in range(20):
        assert see(tracker, step * 0.3, at(-25 if step % 2 else 25)) == ()


def test_two_detections_too_far_apart_in_time_do_not_make_a_face() -> None:
    tracker = Tracker[Face]()
    see(tracker, 0.0, at(0))
    assert see(tracker, 0.6, at(0)) == ()


def test_an_id_survives_a_short_loss() -> None:
    tracker = Tracker[Face]()
    see(tracker, 0.0, at(0))
    (before,) = see(tracker, 0.1, at(0))
    (lost,) = see(tracker, 0.6)
    assert lost == before
    (back,) = see(tracker, 1.05, at(3))
    assert (back.id, back.stamp) == (before.id, 1.05)


def test_face_after_a_long_loss_gets_a_new_id() -> None:
    tracker = Tracker[Face]()
    see(tracker, 0.0, at(0))
    see(tracker, 0.1, at(0))
    assert see(tracker, 1.2) == ()
    see(tracker, 1.3, at(0))
    assert [face.id for face in see(tracker, 1.4, at(0))] == [2]


def test_two_people_keep_their_ids_and_the_largest_comes_first() -> None:
    tracker = Tracker[Face]()
    for step in range(10):
        faces = see(tracker, step / 20, at(-15 + step, width=60), at(15 - step * 0.5, width=100))
    assert [face.box.width for face in faces] == [100, 60]
    assert degrees(faces[0].yaw) == pytest.approx(10.5, abs=0.6)
    assert sorted(face.id for face in faces) == [1, 2]
    later = see(tracker, 0.5, at(10), at(-5, width=120))
    assert [face.id for face in later] == [faces[1].id, faces[0].id]


def test_distant_faces_are_not_confused() -> None:
    tracker = Tracker[Face]()
    for step in range(3):
        see(tracker, step / 20, at(-20))
    see(tracker, 0.2, at(20))
    faces = see(tracker, 0.25, at(20))
    assert [face.id for face in faces if face.bearing < 0] == [1]
    assert [face.id for face in faces if face.bearing > 0] == [2]


@given(st.floats(-6, 6), st.floats(-0.5, 0.5))
def test_turning_head_does_not_move_a_still_face(start: float, pitch: float) -> None:
    tracker = Tracker[Face]()
    for step in range(20):
        gaze = Gaze(start + 0.02 * step, 0.0)
        faces = see(tracker, step / 20, at(degrees(0.2 - 0.02 * step), degrees(pitch) / 2), gaze=gaze)
    (face,) = faces
    assert face.yaw == pytest.approx(start + 0.2, abs=1e-3)
    assert face.yaw_rate == pytest.approx(0, abs=1e-3)
    assert face.pitch == pytest.approx(pitch / 2, abs=1e-3)


def test_an_unknown_gaze_counts_as_straight_on() -> None:
    known, unknown = Tracker[Face](), Tracker[Face]()
    for step in range(5):
        assert see(known, step / 20, at(step, 3), gaze=Gaze(0, 0)) == see(unknown, step / 20, at(step, 3))


def test_someone_walking_is_predicted_a_tenth_of_a_second_on_to_half_a_degree() -> None:
    rng = np.random.default_rng(5)
    tracker, errors, time = Tracker[Face](), [], 0.0
    for step in range(80):
        time += float(rng.uniform(0.03, 0.08))
        noisy = at(-25 + 10 * time + float(rng.normal(0, 0.2)))
        faces = see(tracker, time, noisy)
        if step > 15:
            errors.append(degrees(faces[0].predict(time + 0.1)[0]) - (-25 + 10 * (time + 0.1)))
    assert np.sqrt(np.mean(np.square(errors))) < 0.5


def test_the_same_frame_twice_does_no_harm() -> None:
    tracker = Tracker[Face]()
    see(tracker, 1.0, at(0))
    (face,) = see(tracker, 1.0, at(0))
    (again,) = see(tracker, 0.9, at(0))
    assert again.id == face.id
    assert again.yaw_rate == 0
