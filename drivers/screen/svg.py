"""The face as SVG: for the first sight of the page, and for whoever asks for a picture of it."""

from html import escape

from drivers.screen.drawing import CREAM, HEIGHT, NIGHT, WIDTH, draw
from drivers.screen.expression import Expression
from drivers.screen.shape import Shape
from drivers.screen.words import Words, plain


def svg(face: Expression, text: str, size: tuple[int, int] | None = None, *, label: str = "") -> str:
    """Return the face with ``text`` below it; ``size`` in pixels, width and height, else whatever room there is.

    ``label`` is what it shows in words, for those who do not see it.
    """
    drawing = draw(face, text)
    extent = "" if size is None else f' width="{size[0]}" height="{size[1]}"'
    return "".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {HEIGHT:g}"{extent} id="face"',
            f' role="img" aria-label="{escape(label or plain(text))}">',
            # Larger than the sheet: it also fills the margins of a screen that is wider or taller.
            f'<rect x="-2000" y="-2000" width="4320" height="4240" fill="{NIGHT}"/>',
            *(_path(shape) for shape in drawing.shapes),
            f'<g id="words" fill="{CREAM}" font-family="DejaVu Sans, Verdana, sans-serif" font-weight="bold"',
            f' text-anchor="middle">{_words(drawing.words)}</g></svg>\n',
        )
    )


def numbers(shape: Shape) -> list[float]:
    """Return what of a shape may move: its opacity, the width of its line, and its points, x before y."""
    places = (place for point in shape.points for place in point)
    return [round(shape.opacity, 2), round(shape.width, 1), *(round(place, 1) for place in places)]


def _path(shape: Shape) -> str:
    opacity, width, x, y, *others = numbers(shape)
    line = f' stroke="{shape.line}" stroke-linecap="round" stroke-linejoin="round"' if shape.line else ""
    return (
        f'<path fill="{shape.fill or "none"}"{line} stroke-width="{width:g}" opacity="{opacity:g}"'
        f' d="M{x:g} {y:g}C{" ".join(f"{place:g}" for place in others)}"/>'
    )


def _words(words: Words) -> str:
    lines = zip(words.lines, words.feet, strict=True)
    return "".join(
        f'<text x="{WIDTH / 2:g}" y="{foot:.1f}" font-size="{words.size:.1f}">{escape(line)}</text>'
        for line, foot in lines
    )
