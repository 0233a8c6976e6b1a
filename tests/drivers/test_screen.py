"""The robot's face: its moods from afar, blinks and words, drawn as SVG and as images alike."""

import unicodedata
from itertools import combinations
from xml.etree import ElementTree as ET

import cv2
import numpy as np
import pytest
import resvg_py
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import Image, Mood, Screen, ScreenContent
from drivers.clock import ManualClock
from drivers.screen.drawing import HEIGHT, WIDTH, draw_face, face_image
from drivers.screen.expression import (
    BLINK_INTERVAL,
    BLINK_TIME,
    MAX_LINES,
    MAX_TEXT_LENGTH,
    face_expression,
    layout_text,
)
from drivers.screen.make import PrintedScreen
from drivers.screen.pages import picture, shape_numbers, state_line, svg
from drivers.screen.twin import ScreenTwin
from missions.plugins.testing.recorders.bench import RecordedScreen

CALM = 2.3
"""A time at which nobody blinks."""

SHOWN = st.builds(ScreenContent, st.sampled_from(Mood), st.text(max_size=60), st.floats(0, 1) | st.just(1.0))
TIMES = st.floats(0, 1e6)


def photograph(shown: ScreenContent, size: tuple[int, int]) -> Image:
    return face_image(face_expression(shown, CALM), shown.text, size)


def unlike(one: Image, other: Image) -> float:
    """Return by how much two pictures differ, in grey levels on average."""
    return float(np.abs(one.astype(int) - other).mean())


@pytest.mark.parametrize(("one", "other"), list(combinations(Mood, 2)))
def test_moods_are_distinguishable_from_three_metres(one: Mood, other: Mood) -> None:
    # A display 15 cm wide, seen from 3 m, in 48 pixels: each 3.6 minutes of arc, where a good eye resolves 1.
    far = photograph(ScreenContent(one), (48, 36)), photograph(ScreenContent(other), (48, 36))
    assert unlike(*far) > 5.0


@pytest.mark.parametrize("mood", Mood)
def test_films_show_the_face_of_the_page(mood: Mood) -> None:
    face = face_expression(ScreenContent(mood, mouth=0.4), CALM)
    page = resvg_py.svg_to_bytes(svg_string=svg(face, "", (400, 300)))
    seen = cv2.imdecode(np.frombuffer(bytes(page), np.uint8), cv2.IMREAD_COLOR)
    assert seen is not None
    apart = {
        other: unlike(seen.astype(np.uint8), photograph(ScreenContent(other, mouth=0.4), (400, 300))) for other in Mood
    }
    assert apart.pop(mood) < 1.6  # where edges are soft
    assert min(apart.values()) > 2.5


@pytest.mark.parametrize("size", [(320, 240), (800, 480), (100, 400), (16, 12)])
def test_film_has_its_size_and_a_centred_face(size: tuple[int, int]) -> None:
    image = photograph(ScreenContent(Mood.SURPRISED), size)
    assert image.shape == (size[1], size[0], 3)
    assert image.dtype == np.uint8
    grey = image.mean(axis=2)
    columns = np.average(np.arange(size[0]), weights=(grey > 128).sum(axis=0))
    assert columns == pytest.approx((size[0] - 1) / 2, abs=0.02 * size[0])


@given(SHOWN, TIMES)
def test_all_faces_have_the_same_shapes(shown: ScreenContent, time: float) -> None:
    usual, face = draw_face(face_expression(ScreenContent(), 0.0)), draw_face(face_expression(shown, time), shown.text)
    assert [len(shape.points) for shape in face.shapes] == [len(shape.points) for shape in usual.shapes]
    assert [(shape.fill, shape.line) for shape in face.shapes] == [(shape.fill, shape.line) for shape in usual.shapes]
    told = np.array([number for shape in face.shapes for number in shape_numbers(shape)])
    assert np.isfinite(told).all()
    assert all(0 <= shape.opacity <= 1 for shape in face.shapes)


@given(SHOWN, TIMES)
def test_visible_parts_of_a_face_are_within_the_drawing(shown: ScreenContent, time: float) -> None:
    face = draw_face(face_expression(shown, time), shown.text)
    edges = [(shape.points, shape.width / 2) for shape in face.shapes if shape.opacity > 0.5]
    assert all(half <= x <= WIDTH - half and half <= y <= HEIGHT - half for points, half in edges for x, y in points)


def lids(mood: Mood, time: float) -> float:
    return face_expression(ScreenContent(mood), time).upper


@pytest.mark.parametrize("mood", [Mood.NEUTRAL, Mood.SAD, Mood.SURPRISED, Mood.LISTENING, Mood.SPEAKING])
def test_face_blinks_every_four_seconds_at_varying_moments(mood: Mood) -> None:
    times = np.arange(0, 100 * BLINK_INTERVAL, 0.02)
    shut = np.array([lids(mood, float(time)) < lids(mood, CALM) / 2 for time in times])
    begins = times[1:][shut[1:] & ~shut[:-1]]
    assert len(begins) == 100
    assert shut.mean() < BLINK_TIME / BLINK_INTERVAL
    assert len(np.unique(np.round(begins % BLINK_INTERVAL, 1))) > 20


@pytest.mark.parametrize("mood", [Mood.HAPPY, Mood.ASLEEP])
def test_closed_eyes_do_not_blink(mood: Mood) -> None:
    assert len({lids(mood, time / 50) for time in range(400)}) == 1


@pytest.mark.parametrize("mood", Mood)
def test_speaking_mouth_opens_in_any_mood(mood: Mood) -> None:
    opened = [face_expression(ScreenContent(mood, mouth=mouth), CALM).opening for mouth in (0.1, 0.4, 0.7, 1.0)]
    assert opened == sorted(opened)
    assert opened[-1] == 1.0
    assert (
        unlike(
            photograph(ScreenContent(mood, mouth=0.1), (320, 240)),
            photograph(ScreenContent(mood, mouth=1.0), (320, 240)),
        )
        > 0.3
    )


def test_mouth_moves_by_itself_for_unknown_speech() -> None:
    opened = [face_expression(ScreenContent(Mood.SPEAKING), time / 30).opening for time in range(90)]
    assert max(opened) - min(opened) > 0.4
    assert all(0 <= opening <= 1 for opening in opened)


# --- words ------------------------------------------------------------------------------------------------------------


def test_few_words_are_larger_than_many() -> None:
    sizes = [layout_text("many words " * count).size for count in (1, 2, 4, 8)]
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) == 4


def test_too_many_words_end_in_an_ellipsis() -> None:
    words = layout_text("and so on " * 100)
    assert len(words.lines) == MAX_LINES
    assert words.lines[-1].endswith("…")


@pytest.mark.parametrize("text", ["word " * 4000, "x" * 20_000, " " * 20_000 + "word", "\x00" * 20_000, "字" * 20_000])
def test_a_book_costs_no_more_to_show_than_a_page(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    looked_at = 0
    category = unicodedata.category

    def counted(letter: str) -> str:
        nonlocal looked_at
        looked_at += 1
        return category(letter)

    monkeypatch.setattr(unicodedata, "category", counted)
    lines = layout_text(text).lines
    assert looked_at <= MAX_TEXT_LENGTH + 1
    assert lines[-1:] == ("word",) if text.strip() == "word" else "".join(lines).endswith("…") or not "".join(lines)
    assert len(state_line(ScreenContent(text=text), CALM)) < 10_000


@given(st.text(max_size=400))
def test_layout_loses_no_word_without_an_ellipsis(text: str) -> None:
    words = layout_text(text)
    assert len(words.lines) == len(words.baselines) <= MAX_LINES
    assert all(foot < HEIGHT for foot in words.baselines)
    letters = "".join("".join(words.lines).split())
    everything = "".join("".join(letter if letter.isprintable() else " " for letter in text).split())
    shown = "".join(letter for letter in letters if letter.isprintable())
    assert shown == everything or letters.endswith("…")


@given(SHOWN, TIMES)
def test_any_text_gives_a_valid_picture_and_state_line(shown: ScreenContent, time: float) -> None:
    root = ET.fromstring(picture(shown, time))  # noqa: S314 - our own
    texts = [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")]
    assert texts == list(layout_text(shown.text).lines)
    assert str(root.get("aria-label")).startswith(f"{shown.mood} face")
    assert "\n" not in state_line(shown, time).encode().decode()


@pytest.mark.parametrize("text", ["Hello", "Grüße, Zoë…", "你好", "a\x00b\ud800c"])
def test_film_draws_its_text(text: str) -> None:
    size = (320, 240)

    below = photograph(ScreenContent(text=text), size)[170:]
    assert (below.max(axis=2) > 128).mean() > 0.01
    blank = photograph(ScreenContent(text=" "), size)
    assert unlike(blank, photograph(ScreenContent(), size)) == 0


# --- without a display ------------------------------------------------------------------------------------------------


def test_without_a_display_each_new_mood_and_text_is_printed_once() -> None:
    printed: list[str] = []
    screen = PrintedScreen(ManualClock(), printed.append)
    screen.mood(Mood.SAD)
    screen.open()
    for _ in range(2):
        screen.mood(Mood.HAPPY)
        screen.show("hello")
    screen.mouth(0.5)
    screen.show("")
    screen.mood(Mood.NEUTRAL)
    screen.close()
    screen.mood(Mood.HAPPY)
    assert printed == ["face: happy", "show: hello", "face: neutral"]


def test_closed_terminal_is_harmless() -> None:
    def gone(text: str) -> None:
        raise BrokenPipeError(text)

    screen = PrintedScreen(ManualClock(), gone)
    screen.open()
    screen.mood(Mood.HAPPY)
    assert screen.content().mood is Mood.HAPPY


def test_unplugged_screen_twin_keeps_its_content() -> None:
    told: list[str] = []
    screen = ScreenTwin(ManualClock(), report=lambda notice: told.append(notice.kind))
    screen.open()
    screen.plug.unplug()
    screen.mood(Mood.HAPPY)
    screen.mouth(0.5)
    assert not screen.health().online
    assert "unplugged" in screen.health().detail
    screen.plug.plug_in()
    assert (screen.content().mood, screen.health().online) == (Mood.HAPPY, True)
    assert told == ["online", "offline", "online"]


def test_a_recorder_keeps_all_in_order() -> None:
    recorder = RecordedScreen(ManualClock())
    screen: Screen = recorder
    screen.mood(Mood.HAPPY)
    screen.show("hello")
    screen.mouth(0.5)
    assert recorder.commands == [Mood.HAPPY, "hello", 0.5]
    assert screen.content() == ScreenContent(Mood.HAPPY, "hello", 0.5)
