"""Expression of a face at a time: mood, mouth, blinking and eye movement. Also the layout of text below it."""

import textwrap
import unicodedata
from dataclasses import replace
from math import pi, radians, sin

from drivers.api import Mood, ScreenContent
from drivers.api.fast_dataclass import dataclass

# Text below a face: as large as fits, broken at spaces into lines.

TEXT_TOP, TEXT_HEIGHT, TEXT_WIDTH = 164.0, 70.0, 308.0
"""Top, height and width of the text area below the small face, on the sheet of 320 x 240."""

MAX_LINES = 5
"""Maximum number of lines of text below a face; more would make the letters too small to read from afar."""

LETTER_WIDTH = 0.63
"""Average width of a bold letter as a share of its size; Chinese, Japanese and Korean letters are square."""

LINE_SPACING = 1.15
"""Distance between lines as a share of the letter size."""

MAX_LETTER_SIZE = 44.0

MAX_TEXT_LENGTH = 240
"""Maximum number of letters that are processed, slightly more than ever fit."""

NON_LETTER_CATEGORIES = ("Cc", "Cs", "Cn", "Co")
"""Unicode categories of characters that are replaced by spaces: controls, surrogates, unassigned and private ones."""


@dataclass(frozen=True, slots=True)
class TextLayout:
    """Lines of text, the size of their letters, and the baseline of each line from the top."""

    lines: tuple[str, ...]
    size: float
    baselines: tuple[float, ...]


def clean_text(text: str) -> str:
    """Return ``text`` in one line, with spaces for control characters, surrogates and unassigned characters.

    Text longer than ``MAX_TEXT_LENGTH`` ends there in an ellipsis.
    """
    text = " ".join(text.split())
    if len(text) > MAX_TEXT_LENGTH:
        text = text[:MAX_TEXT_LENGTH] + "…"
    return "".join(" " if unicodedata.category(letter) in NON_LETTER_CATEGORIES else letter for letter in text)


def layout_text(text: str) -> TextLayout:
    """Return ``text`` in lines; text that does not fit ends in an ellipsis."""
    text = clean_text(text)
    square = any(unicodedata.east_asian_width(letter) in "WF" for letter in text)
    for count in range(1, MAX_LINES + 1):
        size = min(MAX_LETTER_SIZE, TEXT_HEIGHT / (count * LINE_SPACING))
        columns = int(TEXT_WIDTH / (size * (1.0 if square else LETTER_WIDTH)))
        lines = tuple(textwrap.wrap(text, columns, max_lines=count, placeholder="…"))
        if "".join(text.split()) == "".join("".join(lines).split()):
            break
    return TextLayout(
        lines, size, tuple(TEXT_TOP + LINE_SPACING * size * (number + 0.78) for number in range(len(lines)))
    )


BLINK_INTERVAL, BLINK_TIME = 4.0, 0.24
"""Seconds from blink to blink on average, and duration of a blink; people blink slightly more often."""

GLANCE_TIME = 2.6
"""Seconds for which the eyes look in one direction."""

BREATH_PERIOD = 4.0
"""Period in seconds of repeating motions: breath of a sleeper, tear, sound waves."""

BREATH_STEPS = 60
"""Number of steps in a period of the repeating motions; a page interpolates between them."""

GOLDEN = 0.6180339887
"""Golden ratio conjugate, for pseudo-random numbers: its multiples modulo 1 are evenly distributed."""


@dataclass(frozen=True, slots=True)
class FaceExpression:
    """Numeric parameters of a face's expression. 0 is none and 1 full, unless noted. The face is symmetric."""

    upper: float = 1.0  # the edge of the upper lid above the middle of the eye; below 0 past it
    lower: float = 1.0  # the edge of the lower lid below it; below 0 past it
    slant: float = 0.0  # droop of the outer corners of the eyes
    pupil: float = 1.0  # its size
    gaze: float = 0.0  # gaze: -1 to the left of the picture, 1 to the right
    brow_height: float = 0.5
    brow_tilt: float = 0.0  # radians; the inner ends up
    curve: float = 0.0  # of the mouth: 1 laughs, -1 weeps
    width: float = 0.8  # of the mouth
    opening: float = 0.0  # of the mouth
    cheeks: float = 0.45  # redness
    tilt: float = 0.0  # radians; the head to its left shoulder
    breath: float = 0.0  # phase of the tear, the waves or the sleep, 0..1
    tear: float = 0.0
    waves: float = 0.0  # of sound at the ears
    sleep: float = 0.0  # the letters "z" of sleep


MOODS = {
    Mood.NEUTRAL: FaceExpression(curve=0.35),
    Mood.HAPPY: FaceExpression(
        upper=0.95, lower=-0.3, pupil=0.0, brow_height=0.9, curve=0.9, width=1.0, opening=0.55, cheeks=1.0
    ),
    Mood.SAD: FaceExpression(
        upper=0.6, lower=0.95, slant=0.8, brow_height=0.3, brow_tilt=0.4, curve=-0.9, width=0.65, cheeks=0.0, tear=1.0
    ),
    Mood.SURPRISED: FaceExpression(
        upper=1.15, lower=1.15, pupil=0.6, brow_height=1.25, width=0.46, opening=0.7, cheeks=0.4
    ),
    Mood.ASLEEP: FaceExpression(
        upper=-0.3, lower=0.4, pupil=0.0, brow_height=-0.4, curve=0.1, width=0.3, opening=0.3, cheeks=0.7, sleep=1.0
    ),
    Mood.LISTENING: FaceExpression(
        upper=1.08, lower=1.08, pupil=1.1, brow_height=1.0, curve=0.3, width=0.5, tilt=radians(8), waves=1.0
    ),
    Mood.SPEAKING: FaceExpression(brow_height=0.75, curve=0.45, width=0.75, opening=0.3),
}
"""Expression of each mood without blinking, with the mouth at rest."""

SHUT_EYES = MOODS[Mood.ASLEEP]


def face_expression(shown: ScreenContent, time: float) -> FaceExpression:
    """Return the expression of the face for the content ``shown`` of a screen at ``time`` in seconds.

    In any mood, the mouth opens as far as ``shown`` says. In the mood SPEAKING it also moves if ``shown`` has no mouth
    opening.
    """
    face = MOODS[shown.mood]
    opening = face.opening + shown.mouth * (1 - face.opening)
    if shown.mood is Mood.SPEAKING:
        opening = shown.mouth or _syllable_opening(time)
    elif shown.mood is Mood.NEUTRAL:
        face = replace(face, gaze=_gaze_at(time))
    lids = _lid_closure(time) if face.pupil else 0.0
    return replace(
        face,
        upper=face.upper + lids * (SHUT_EYES.upper - face.upper),
        lower=face.lower + lids * (SHUT_EYES.lower - face.lower),
        opening=opening,
        breath=time * BREATH_STEPS // BREATH_PERIOD % BREATH_STEPS / BREATH_STEPS
        if face.tear or face.waves or face.sleep
        else 0.0,
    )


def _pseudo_random(number: float) -> float:
    return number * GOLDEN % 1.0


def _lid_closure(time: float) -> float:
    """Return how far the eyelids are shut at ``time`` (s), 0..1. There is a blink in each ``BLINK_INTERVAL``."""
    turn, within = divmod(time, BLINK_INTERVAL)
    begun = within - _pseudo_random(turn) * (BLINK_INTERVAL - BLINK_TIME)
    return sin(pi * begun / BLINK_TIME) if 0.0 <= begun <= BLINK_TIME else 0.0


def _gaze_at(time: float) -> float:
    """Return the direction of the eyes at ``time`` (s): usually 0 (straight ahead), at times to a side, -1..1."""
    place = _pseudo_random(time // GLANCE_TIME)
    return 0.0 if place < 0.6 else 5.0 * place - 4.0


def _syllable_opening(time: float) -> float:
    """Return a mouth opening (0..1) that looks like speech, if the words are unknown."""
    return 0.1 + 0.6 * abs(sin(2 * pi * 2.1 * time) * sin(2 * pi * 0.77 * time))
