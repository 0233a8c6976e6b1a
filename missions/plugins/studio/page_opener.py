"""Opening the page in this user's browser. Others see command lines, so the link is in a private file that leads on."""

import os
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from html import escape
from pathlib import Path
from threading import Event, Thread

from missions.control.run_folders import RunFolder
from missions.control.sockets import process_exists
from missions.library.folders import runtime_folder
from missions.plugins.studio.access import ONCE_TOKEN_LIFETIME, StudioAccess

HINT_DELAY = 8.0
"""Seconds after which a browser that has not come may be one that does not read the file."""

POLL_INTERVAL = 0.1
"""Seconds from one look whether the browser has come to the next."""

HINT = (
    "the browser has not come: one that is a snap or a flatpak may not read {path}\n"
    "  try: open the first link above yourself"
)

DOCUMENT = (
    '<!doctype html><meta charset="utf-8"><meta name="referrer" content="no-referrer">'
    '<meta http-equiv="refresh" content="0; url={link}"><title>MissionTree studio</title>'
    '<p><a href="{link}">Open the studio</a></p>\n'
)


class PageOpener:
    """Opens the page by a token that lets in once; its file is removed once that is used, or too old.

    ``link`` makes the link of a token, ``report`` tells the user something.
    """

    def __init__(self, access: StudioAccess, link: Callable[[str], str], report: Callable[[str], object]) -> None:
        self._access, self._link, self._report = access, link, report
        self._ended = Event()
        self._waiting: Thread | None = None

    def open(self) -> None:
        """Write the file, and start the browser; returns at once. Without a place for the file, tell the user."""
        try:
            path = _write_redirect(self._link(self._access.make_once_token()))
        except OSError as error:
            self._report(f"the browser cannot be opened: {error}\n  try: open the first link above yourself")
            return
        self._waiting = Thread(target=self._wait, args=(path,), name="page opener", daemon=True)
        self._waiting.start()
        # Another thread: a browser on a terminal is waited for until it ends.
        Thread(target=self._start, args=(path,), name="browser", daemon=True).start()

    def close(self) -> None:
        """Remove the file."""
        self._ended.set()
        if self._waiting is not None:
            self._waiting.join()

    def _start(self, path: Path) -> None:
        with suppress(webbrowser.Error, OSError):
            if webbrowser.open(path.as_uri()):
                return
        self._report("there is no browser here\n  try: open the first link above yourself")

    def _wait(self, path: Path) -> None:
        hint_after, looks = int(HINT_DELAY / POLL_INTERVAL), int(ONCE_TOKEN_LIFETIME / POLL_INTERVAL)
        for look in range(looks):
            if not self._access.is_once_open or self._ended.wait(POLL_INTERVAL):
                break
            if look == hint_after:
                self._report(HINT.format(path=path))
        with suppress(OSError):
            path.unlink(missing_ok=True)


@contextmanager
def page_opener(
    access: StudioAccess, link: Callable[[str], str], report: Callable[[str], object]
) -> Iterator[PageOpener]:
    """Give one while this is entered; its file is gone then."""
    opener = PageOpener(access, link, report)
    try:
        yield opener
    finally:
        opener.close()


def _write_redirect(link: str) -> Path:
    """Write the file that leads to a link, for this user alone; remove those of studios that were killed."""
    folder = RunFolder(runtime_folder() / "open").prepare()
    for left in folder.glob("*.html"):
        with suppress(ValueError, OSError):
            if not process_exists(int(left.stem)):
                left.unlink()
    path = folder / f"{os.getpid()}.html"
    path.unlink(missing_ok=True)
    number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
    with open(number, "w", encoding="utf-8") as file:  # noqa: PTH123 - of a descriptor
        file.write(DOCUMENT.format(link=escape(link)))
    return path
