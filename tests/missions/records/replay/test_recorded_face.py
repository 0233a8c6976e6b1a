"""The robot's face beside the pictures of films, live and out of a record."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.api import Mood, ScreenContent
from drivers.screen.drawing import face_image
from drivers.screen.expression import face_expression
from missions.cli.root import mission, run_guarded
from missions.plugins.records.recording.run_record import RunRecord, open_record
from missions.plugins.records.replay.frames import RecordedFace, annotate_frames

MOODS = """
mission: moods
tree:
  sequence:
    - face_seen:
      on_failure: succeed
    - face: happy
    - wait: 1 s
    - show: Hello Anna!
    - wait: 1 s
    - {face: sad}
    - wait: 1 s
"""
SMALL = (160, 240)


def run(folder: Path, text: str, *more: str) -> RunRecord:
    """Run a mission in simulated time, and return its record."""
    (folder / "moods.yaml").write_text(text, encoding="utf-8")
    words = ("run", "moods.yaml", "--simulate", "fast", "--record", "moods.mcap", *more)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run_guarded(lambda: mission.main(list(words), standalone_mode=False)) == 0
    return open_record(folder / "moods.mcap")


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """A record of a run with a face, and ``film.avi`` beside it."""
    return run(tmp_path_factory.mktemp("moods"), MOODS, "--film", "film.avi")


@pytest.mark.parametrize(
    ("time", "shown"),
    [
        (0.6, ScreenContent(Mood.HAPPY)),
        (1.6, ScreenContent(Mood.HAPPY, "Hello Anna!")),
        (2.6, ScreenContent(Mood.SAD, "Hello Anna!")),
    ],
)
def test_recorded_face_is_drawn_for_any_time(kept: RunRecord, time: float, shown: ScreenContent) -> None:
    face = RecordedFace(kept)
    assert face
    assert np.array_equal(face.at(time, SMALL), face_image(face_expression(shown, time), shown.text, SMALL))


def test_frames_show_the_robots_face_beside_the_picture(kept: RunRecord) -> None:
    pictures = list(annotate_frames(kept))
    assert pictures
    for stamp, picture in pictures:
        assert np.array_equal(picture[:480, 640:], RecordedFace(kept).at(stamp, (320, 480)))


def test_frames_without_a_robot_face_keep_their_width(tmp_path: Path) -> None:
    plain = run(tmp_path, "mission: plain\ntree: {sequence: [{face_seen: {}, on_failure: succeed}, wait: 1 s]}")
    assert not RecordedFace(plain)
    assert {picture.shape[1] for _, picture in annotate_frames(plain)} == {640}


def test_a_film_of_a_run_has_the_face_too(kept: RunRecord) -> None:
    film = cv2.VideoCapture(str(Path(kept.path).with_name("film.avi")))
    assert (film.get(cv2.CAP_PROP_FRAME_WIDTH), film.get(cv2.CAP_PROP_FRAME_HEIGHT)) == (1600, 480)
    film.set(cv2.CAP_PROP_POS_FRAMES, 36)  # at 2.9 s or so
    _, picture = film.read()
    film.release()
    sad = face_image(face_expression(ScreenContent(Mood.SAD, "Hello Anna!"), 2.88), "Hello Anna!", (320, 480))
    assert np.abs(picture[:, -320:].astype(int) - sad).mean() < 3.0
