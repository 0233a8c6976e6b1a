"""Server of the live camera page, for browsers of this computer that have its link.

Every user of a computer can reach its loopback address, and pictures show people: so the path of the page is secret.
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
"""Number of ports tried from ``FIRST_PORT`` on, before any free one."""

JPEG_QUALITY, MAX_PICTURE_WIDTH = 75, 960
"""Maximum width of a picture in pixels, as ``JPEG_QUALITY`` is in percent."""

CONTENT_TYPES = {"": "text/html", "page.js": "text/javascript", "page.css": "text/css"}
"""Content types of the files of the camera page, by name."""


class CameraPage:
    """Serves the newest camera picture and its caption from ``open`` to ``close``."""

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
        """URL of the camera page; empty while it is closed."""
        return self._server.address.rstrip("/") + self._secret_path if self._server.address else ""

    @property
    def has_viewers(self) -> bool:
        """Whether a browser shows the page; without one, pictures need not be prepared."""
        return self._server.listeners > 0

    def open(self) -> None:
        """Start the server. Raises OSError if no port can be opened."""
        for port in range(FIRST_PORT, FIRST_PORT + PORT_COUNT):
            try:
                self._server.open(HOST, port)
            except OSError:
                continue
            return
        self._server.open(HOST, 0)

    def close(self) -> None:
        """Tell the browsers that the page is closed, and close the port. Idempotent."""
        self._newest_event = json.dumps({"told": "the camera is closed"})
        self._server.close()

    def show(self, image: Image, caption: str) -> None:
        """Show a picture with a caption in the browsers that have the page open."""
        shrunk = min(1.0, MAX_PICTURE_WIDTH / image.shape[1])
        small = image if shrunk == 1.0 else cv2.resize(image, None, fx=shrunk, fy=shrunk, interpolation=cv2.INTER_AREA)
        done, packed = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if done:
            self._newest_event = json.dumps(
                {"jpeg": base64.b64encode(packed.tobytes()).decode("ascii"), "told": caption}
            )


def _document(name: str, kind: str) -> Document:
    return Document(kind, (files(__package__ or "") / name).read_text(encoding="utf-8"))
