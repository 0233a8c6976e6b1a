"""An SVG document that is being drawn, in whole pixels: rectangles, lines and texts of a class each."""

from xml.etree import ElementTree as ET

from missions.views.pictures.style import STYLE


class Canvas:
    """A document, or a group within one, to which shapes are added; what is added later lies on top."""

    def __init__(self, element: ET.Element) -> None:
        self._element = element

    @classmethod
    def blank(cls, name: str, wide: int, high: int) -> "Canvas":
        """Return an empty page; ``name`` is what a program reads out, or shows in its title."""
        size = {"viewBox": f"0 0 {wide} {high}", "width": str(wide), "height": str(high)}
        canvas = cls(ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", "role": "img", **size}))
        canvas.tooltip(name)
        canvas._add("style").text = STYLE
        canvas._add("rect", width=str(wide), height=str(high)).set("class", "page")
        return canvas

    def document(self) -> str:
        """Return all of it."""
        ET.indent(self._element)
        return ET.tostring(self._element, encoding="unicode") + "\n"

    def group(self, kind: str, x: int = 0, y: int = 0) -> "Canvas":
        """Return a group whose places count from ``x``, ``y``."""
        group = self._add("g")
        if kind:
            group.set("class", kind)
        if x or y:
            group.set("transform", f"translate({x} {y})")
        return Canvas(group)

    def tooltip(self, text: str) -> None:
        """Say what this is, to those who point at it."""
        self._add("title").text = _clean(text)

    def text(self, kind: str, text: str, x: int, y: int) -> None:
        """Write ``text`` from ``x`` on, its base line at ``y``; nothing where there is none."""
        if text:
            written = self._add("text", x=str(x), y=str(y))
            written.set("class", kind)
            written.text = _clean(text)

    def rect(self, kind: str, x: int, y: int, wide: int, high: int, *, turn: int = 8) -> None:
        """Draw a rectangle with corners of the radius ``turn``."""
        size = {"width": str(wide), "height": str(high), "rx": str(turn)}
        self._add("rect", x=str(x), y=str(y), **size).set("class", kind)

    def way(self, kind: str, path: str) -> None:
        """Draw a path, in the words of SVG."""
        self._add("path", d=path).set("class", kind)

    def dot(self, kind: str, x: int, y: int, radius: int) -> None:
        """Draw a disc."""
        self._add("circle", cx=str(x), cy=str(y), r=str(radius)).set("class", kind)

    def _add(self, tag: str, **attributes: str) -> ET.Element:
        return ET.SubElement(self._element, tag, attributes)


def _clean(text: str) -> str:
    """Return ``text`` without what XML cannot hold."""
    return "".join(letter if letter in "\t\n" or letter.isprintable() else "\ufffd" for letter in text)
