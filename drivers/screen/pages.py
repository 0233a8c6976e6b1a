"""Web page with the robot's face, for its display. A server within the run serves the page.

The page contains the face as SVG. It animates the shapes of the SVG towards the newest numbers from the server.
"""

import hashlib
import json
from functools import cache, lru_cache
from html import escape
from pathlib import Path
from string import Template
from threading import Event, Thread

from drivers.api import DeviceStatus, Health, Mood, ScreenContent, StatusCallback, ignore
from drivers.clock import Clock
from drivers.screen.base_screen import BaseScreen
from drivers.screen.drawing import CREAM, HEIGHT, NIGHT, WIDTH, FaceShape, draw_face
from drivers.screen.expression import FaceExpression, TextLayout, clean_text, face_expression
from drivers.screen.server import Document, PageServer
from drivers.transport.loop import guard_callback


def svg(face: FaceExpression, text: str, size: tuple[int, int] | None = None, *, label: str = "") -> str:
    """Return the face as SVG with ``text`` below it; ``size`` is width and height in pixels, by default the whole area.

    ``label`` describes the face for screen readers.
    """
    drawing = draw_face(face, text)
    extent = "" if size is None else f' width="{size[0]}" height="{size[1]}"'
    return "".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {HEIGHT:g}"{extent} id="face"',
            f' role="img" aria-label="{escape(label or clean_text(text))}">',
            # Larger than the sheet: it also fills the margins of a screen that is wider or taller.
            f'<rect x="-2000" y="-2000" width="4320" height="4240" fill="{NIGHT}"/>',
            *(_path(shape) for shape in drawing.shapes),
            f'<g id="words" fill="{CREAM}" font-family="DejaVu Sans, Verdana, sans-serif" font-weight="bold"',
            f' text-anchor="middle">{_words(drawing.text)}</g></svg>\n',
        )
    )


def shape_numbers(shape: FaceShape) -> list[float]:
    """Return the numbers of a shape that a page animates: opacity, line width, and x and y of each point."""
    places = (place for point in shape.points for place in point)
    return [round(shape.opacity, 2), round(shape.width, 1), *(round(place, 1) for place in places)]


def _path(shape: FaceShape) -> str:
    opacity, width, x, y, *others = shape_numbers(shape)
    line = f' stroke="{shape.line}" stroke-linecap="round" stroke-linejoin="round"' if shape.line else ""
    return (
        f'<path fill="{shape.fill or "none"}"{line} stroke-width="{width:g}" opacity="{opacity:g}"'
        f' d="M{x:g} {y:g}C{" ".join(f"{place:g}" for place in others)}"/>'
    )


def _words(words: TextLayout) -> str:
    lines = zip(words.lines, words.baselines, strict=True)
    return "".join(
        f'<text x="{WIDTH / 2:g}" y="{foot:.1f}" font-size="{words.size:.1f}">{escape(line)}</text>'
        for line, foot in lines
    )


ASSET_FOLDER = Path(__file__).parent
"""Folder of ``page.html``, ``page.js`` and ``page.css``."""


@cache
def asset(name: str) -> str:
    """Return the text of a file in ``ASSET_FOLDER``."""
    return (ASSET_FOLDER / name).read_text(encoding="utf-8")


@cache
def page_version() -> str:
    """Return the version of the page's files and shapes. An outdated page in a browser reloads itself."""
    shapes = [
        (shape.fill, shape.line, len(shape.points)) for shape in draw_face(face_expression(ScreenContent(), 0.0)).shapes
    ]
    parts = (asset("page.html"), asset("page.js"), asset("page.css"), repr(shapes))
    return hashlib.sha256("".join(parts).encode()).hexdigest()[:12]


def page(shown: ScreenContent, time: float) -> str:
    """Return the whole page, with the face at ``time`` (seconds), so that it is visible at once."""
    asleep = state_line(ScreenContent(Mood.ASLEEP), 1.0)
    return Template(asset("page.html")).substitute(face=picture(shown, time), edition=page_version(), asleep=asleep)


def picture(shown: ScreenContent, time: float, size: tuple[int, int] | None = None) -> str:
    """Return the face at ``time`` as SVG; ``size`` as for ``svg``."""
    return svg(face_expression(shown, time), shown.text, size, label=label(shown))


def state_line(shown: ScreenContent, time: float) -> str:
    """Return a line of JSON with everything that the page needs to show the face at ``time``."""
    return _state_json(face_expression(shown, time), shown.text, label(shown))


@lru_cache(maxsize=4)  # a face is still most of the time, and all pages show the same one
def _state_json(face: FaceExpression, text: str, label: str) -> str:
    drawing = draw_face(face, text)
    told = {
        "edition": page_version(),
        "label": label,
        "shapes": [shape_numbers(shape) for shape in drawing.shapes],
        "lines": drawing.text.lines,
        "size": round(drawing.text.size, 1),
        "feet": [round(foot, 1) for foot in drawing.text.baselines],
    }
    return json.dumps(told, separators=(",", ":"))


def label(shown: ScreenContent) -> str:
    """Return a description of the face for screen readers."""
    text = clean_text(shown.text)
    return f"{shown.mood} face: {text}" if text else f"{shown.mood} face"


DEFAULT_PORT, PORT_ATTEMPTS = 8321, 20
"""First port that is tried by default, and the number of ports from there."""

PORT_RETRY_INTERVAL = 1.0
"""Seconds between attempts to get a port that is taken."""


class PageScreen(BaseScreen):
    """Screen on a web page at ``address``, for up to four browsers: a ``drivers.api.Screen``.

    ``host`` is the address at which the page is served: everyone who can reach it sees the face. With ``port`` 0 the
    first free port from 8321 on is used. Any other port is awaited while another program uses it. ``rest`` and
    ``awake`` are the moods after ``rest`` and after ``open``.

    The robot works without its face. Therefore the screen counts as online while it waits for its port, and the
    ``detail`` of its health has the reason.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        rest: Mood = Mood.ASLEEP,
        awake: Mood = Mood.NEUTRAL,
        report: StatusCallback = ignore,
    ) -> None:
        super().__init__(clock, rest=rest, awake=awake)
        self._host = host
        self._ports = (port,) if port else (*range(DEFAULT_PORT, DEFAULT_PORT + PORT_ATTEMPTS), 0)
        self._report = guard_callback(report)
        site = {
            "/": lambda: Document("text/html", page(self.content(), clock.now())),
            "/page.js": lambda: Document("text/javascript", asset("page.js")),
            "/page.css": lambda: Document("text/css", asset("page.css")),
            "/face.svg": lambda: Document("image/svg+xml", picture(self.content(), clock.now())),
        }
        self._server = PageServer(site, lambda: state_line(self.content(), clock.now()))
        self._error = ""
        self._end_requested = Event()
        self._port_thread: Thread | None = None
        self._is_open = False

    @property
    def address(self) -> str:
        """URL of the face; empty while it is not served."""
        return self._server.address

    def open(self) -> None:
        """Wake up, and serve the page; if the port is taken, wait for it on a thread."""
        super().open()
        if self._is_open:
            return
        self._is_open = True
        self._end_requested.clear()
        if not self._try_to_serve():
            self._report(DeviceStatus(self.name, "fault", self._error, self._hint()))
            self._port_thread = Thread(target=self._wait_for_port, name=f"screen {self.name}", daemon=True)
            self._port_thread.start()

    def close(self) -> None:
        """Show the resting face on all open pages, disconnect them, and free the port.

        Safe from any state, more than once.
        """
        self.rest()
        self._is_open = False
        self._end_requested.set()
        if self._port_thread is not None:
            self._port_thread.join()
            self._port_thread = None
        self._server.close()

    def health(self) -> Health:
        """Return whether the screen is open, the reason if its page is not served, and the number of open pages."""
        counters = {"pages": self._server.listeners}
        if self.address:
            return Health(True, counters=counters)
        if not self._is_open:
            return Health(False, f"{self.name}: not opened yet", counters=counters)
        return Health(True, self._error, self._hint(), counters)

    def _try_to_serve(self) -> bool:
        for port in self._ports:
            try:
                self._server.open(self._host, port)
            except OSError as error:
                self._error = f"{self.name}: no page at {self._host} port {port}: {error.strerror or error}"
            else:
                return True
        return False

    def _hint(self) -> str:
        return "`ss -ltnp` lists which program has which port"

    def _wait_for_port(self) -> None:
        while not self._end_requested.wait(PORT_RETRY_INTERVAL):
            if self._try_to_serve():
                self._report(DeviceStatus(self.name, "online", f"the robot's face (screen): {self.address}"))
                return
