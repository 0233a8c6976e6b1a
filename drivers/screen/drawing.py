"""The face as shapes, from its expression: the one drawing that pages, pictures and films show."""

from collections.abc import Iterator
from math import cos, sin

from drivers.api.quick import dataclass
from drivers.screen.expression import Expression
from drivers.screen.shape import Point, Shape, chain, oval, part, ring
from drivers.screen.words import Words, arranged

WIDTH, HEIGHT = 320.0, 240.0
"""The sheet that the face is drawn on; screens of other sizes show it as large as fits."""

NIGHT, CREAM, TEAL, INK, CORAL, WINE, ROSE, SKY = (
    "#101826", "#fff4dc", "#17a398", "#10202e", "#ff6b73", "#7c1f35", "#f2788a", "#7cc8ff",
)  # fmt: skip
"""Dark behind, bright before: a face that is seen across a room, and does not light it at night."""

MIDDLE = WIDTH / 2
SIDES = (-1.0, 1.0)
EYE, EYE_Y, ACROSS, DOWN = 66.0, 104.0, 42.0, 47.0  # from the middle, from the top, half-axes
MOUTH_Y = 184.0
SMALL = 0.68
"""How large the face is above words."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """Shapes from back to front, always as many with as many points each, and the words below them."""

    shapes: tuple[Shape, ...]
    words: Words


def draw(face: Expression, text: str = "") -> Drawing:
    """Return the drawing of a face with words below it."""
    words = arranged(text)
    scale = SMALL if words.lines else 1.0
    middle = (MIDDLE, HEIGHT / 2)
    shapes = (
        shape.placed(scale=scale, angle=face.tilt, centre=middle, to=(MIDDLE, scale * middle[1]))
        for shape in _face(face)
    )
    return Drawing(tuple(shapes), words)


def _face(face: Expression) -> Iterator[Shape]:
    for side in SIDES:
        yield Shape(oval((MIDDLE + side * 112, 164), 22, 13), fill=CORAL, opacity=0.85 * face.cheeks)
    for side in SIDES:
        yield from _eye(face, side)
        yield _brow(face, side)
    yield from _mouth(face)
    yield _tear(face)
    yield from _waves(face)
    yield from _letters(face)


def _eye(face: Expression, side: float) -> Iterator[Shape]:
    x, y = MIDDLE + side * EYE, EYE_Y
    top, bottom = y - face.upper * DOWN, y + face.lower * DOWN
    inner, outer = x - side * ACROSS, x + side * ACROSS
    corner = y + 0.5 * face.slant * DOWN
    peak = (x - side * face.slant * 0.5 * ACROSS, top)
    outline = ring((inner, y), peak, (outer, corner), (x, bottom))
    yield Shape(outline, fill=CREAM, line=CREAM, width=12)
    room = (bottom - top) / 2 - 1
    seen = face.pupil > 0 and room > 5
    size = max(face.pupil, 0.1)
    flat = min(max(room, 0.5) / (27 * size), 1.0)
    at = (x + 12 * face.gaze, (top + bottom) / 2 + 3 * face.slant)
    for colour, radius, (aside, above) in (
        (TEAL, 27.0, (0.0, 0.0)),
        (INK, 17.0, (0.0, 0.0)),
        (CREAM, 7.5, (-8.0, -9.0)),
        (CREAM, 3.5, (8.0, 9.0)),
    ):
        centre = (at[0] + aside * size, at[1] + above * size * flat)
        yield Shape(oval(centre, radius * size, radius * size * flat), fill=colour, opacity=float(seen))


def _brow(face: Expression, side: float) -> Shape:
    x, y = MIDDLE + side * (EYE + 4), 44 - 20 * (face.brow_height - 0.5)
    reach, angle = 30.0, side * face.brow_tilt

    def at(along: float, up: float) -> Point:
        return x + along * cos(angle) + up * sin(angle), y + along * sin(angle) - up * cos(angle)

    return Shape((at(-reach, 0), at(-reach / 3, 9), at(reach / 3, 9), at(reach, 0)), line=TEAL, width=10)


def _mouth(face: Expression) -> Iterator[Shape]:
    half = 58 * face.width * (1 - 0.12 * face.opening)
    corner = MOUTH_Y - 12 * face.curve + 11 * face.opening * (1 - max(face.curve, 0.0))
    rest = MOUTH_Y + 12 * face.curve
    reach = half * (0.5 + 0.75 * face.opening)
    upper = rest - 22 * face.opening * (1 - 0.7 * max(face.curve, 0.0))
    lower = rest + 40 * face.opening

    left, right = (MIDDLE - half, corner), (MIDDLE + half, corner)
    lip = (right, (MIDDLE + reach, lower), (MIDDLE - reach, lower), left)
    outline = (left, (MIDDLE - reach, upper), (MIDDLE + reach, upper), *lip)
    begin, leave, arrive, end = part(lip, 0.25, 0.75)
    bulge = 0.45 * (lower - upper)
    tongue = (begin, leave, arrive, end, (end[0] + 4, end[1] - bulge), (begin[0] - 4, begin[1] - bulge), begin)
    yield Shape(outline, fill=WINE)
    yield Shape(tongue, fill=ROSE, opacity=min(max(4 * face.opening - 0.8, 0.0), 1.0))
    yield Shape(outline, line=CREAM, width=9)


def _tear(face: Expression) -> Shape:
    x, y = MIDDLE + EYE + 20, 162 + 40 * face.breath
    drop = ((x, y - 16), (x + 3, y - 7), (x + 10, y - 2), (x + 10, y + 4), (x + 10, y + 15), (x - 10, y + 15),
            (x - 10, y + 4), (x - 10, y - 2), (x - 3, y - 7), (x, y - 16))  # fmt: skip
    return Shape(drop, fill=SKY, opacity=face.tear * _faded(face.breath))


def _waves(face: Expression) -> Iterator[Shape]:
    """Arcs of sound that come nearer on both sides, one after the other."""
    for side in SIDES:
        for number in (0, 1):
            near = (2 * face.breath + number / 2) % 1.0
            x, tall = MIDDLE + side * (142 - 18 * near), 34 - 20 * near
            arc = ((x, 118 - tall), (x + side * tall / 3, 118 - tall / 3), (x + side * tall / 3, 118 + tall / 3),
                   (x, 118 + tall))  # fmt: skip
            yield Shape(arc, line=SKY, width=7, opacity=face.waves * _faded(near))


def _letters(face: Expression) -> Iterator[Shape]:
    """The letters Z that a sleeper sends up, one after the other."""
    for number in (0, 1):
        risen = (face.breath + number / 2) % 1.0
        x, y, size = 270 + 30 * risen, 78 - 58 * risen, 6 + 8 * risen
        letter = chain((x - size, y - size), (x + size, y - size), (x - size, y + size), (x + size, y + size))
        yield Shape(letter, line=SKY, width=6, opacity=face.sleep * _faded(risen))


def _faded(share: float) -> float:
    """Return how plain something is that comes and goes: unseen at 0 and 1, wholly there in between."""
    return min(1.0, 6 * share, 3 * (1 - share))
