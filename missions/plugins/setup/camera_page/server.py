"""The page that shows what a camera sees: for browsers of this computer that know its link, and while somebody looks.

Pictures show people, and every user of a computer reaches its loopback address: the page stands behind a secret name.
"""

import base64
import json
import secrets
from functools import partial
from importlib.resources import files

import cv2

from drivers.api import Image
from drivers.screen.server import Document, PageServer

HOST = "127.0.0.1"
FIRST_PORT, PORT_COUNT = 8660, 20
"""Where it is served, and how many ports it tries from there before any that is free."""

JPEG_QUALITY, MAX_PICTURE_WIDTH = 75, 960
"""Of the JPEG, and pixels of a picture's width at most."""

CONTENT_TYPES = {"": "text/html", "page.js": "text/javascript", "page.css": "text/css"}
"""What there is below its name, and of which type."""


class CameraPage:
    """Serves the newest picture, with what is told of it, from ``open`` to ``close``."""

    def __init__(self) -> None:
        self._secret_path = f"/{secrets.token_urlsafe(24)}/"
        self._newest_event = json.dumps({"told": "waiting for the first picture"})
        site = {
            self._secret_path + name: partial(_document, name or "page.html", kind)
            for name, kind in CONTENT_TYPES.items()
        }
        self._server = PageServer(site, lambda: self._newest_event, events=f"{self._secret_path}events")

    @property
    def link(self) -> str:
        """Where a browser finds it; empty while it is closed."""
        return self._server.address.rstrip("/") + self._secret_path if self._server.address else ""

    @property
    def has_viewers(self) -> bool:
        """Whether a page listens: else nothing need be drawn."""
        return self._server.listeners > 0

    def open(self) -> None:
        """Serve it. Raises OSError where this computer lets nobody listen."""
        for port in range(FIRST_PORT, FIRST_PORT + PORT_COUNT):
            try:
                self._server.open(HOST, port)
            except OSError:
                continue
            return
        self._server.open(HOST, 0)

    def close(self) -> None:
        """Say that it is over, and free the port. Safe more than once."""
        self._newest_event = json.dumps({"told": "the camera is closed"})
        self._server.close()

    def show(self, image: Image, caption: str) -> None:
        """Show a picture, and in words what was found in it."""
        shrunk = min(1.0, MAX_PICTURE_WIDTH / image.shape[1])
        small = image if shrunk == 1.0 else cv2.resize(image, None, fx=shrunk, fy=shrunk, interpolation=cv2.INTER_AREA)
        done, packed = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if done:
            self._newest_event = json.dumps(
                {"jpeg": base64.b64encode(packed.tobytes()).decode("ascii"), "told": caption}
            )


def _document(name: str, kind: str) -> Document:
    return Document(kind, (files(__package__ or "") / name).read_text(encoding="utf-8"))
