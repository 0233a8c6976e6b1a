"""Opens the studio's page in this user's browser, by a private file that redirects to the link with a token.

The link itself is not on the browser's command line, since other users of the computer could read it there.
"""

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
"""Seconds after which a hint is printed if the browser has not opened the page.

Sandboxed browsers (snap, flatpak) cannot read the file that redirects to the page.
"""

POLL_INTERVAL = 0.1
"""Seconds between two checks whether the browser has opened the page."""

HINT = (
    "the browser has not opened the page; a snap or flatpak browser cannot read {path}\n"
    "  try: open the first link above yourself"
)

DOCUMENT = (
    '<!doctype html><meta charset="utf-8"><meta name="referrer" content="no-referrer">'
    '<meta http-equiv="refresh" content="0; url={link}"><title>MissionTree studio</title>'
    '<p><a href="{link}">Open the studio</a></p>\n'
)


class PageOpener:
    """Opens the studio's page in a browser with a one-time token, by a file that redirects to the page.

    The file is removed when the token is used or expired. ``link`` returns the link of a token; ``report`` shows a text
    to the user.
    """

    def __init__(self, access: StudioAccess, link: Callable[[str], str], report: Callable[[str], object]) -> None:
        self._access, self._link, self._report = access, link, report
        self._ended = Event()
        self._waiting: Thread | None = None

    def open(self) -> None:
        """Write the file that redirects to the page, and open it in the browser; returns at once.

        If the file cannot be written, print a hint to open the link by hand.
        """
        try:
            path = _write_redirect(self._link(self._access.make_once_token()))
        except OSError as error:
            self._report(f"the browser cannot be opened: {error}\n  try: open the first link above yourself")
            return
        self._waiting = Thread(target=self._wait, args=(path,), name="page opener", daemon=True)
        self._waiting.start()
        # In a thread: starting a text-mode browser blocks until it ends.
        Thread(target=self._start, args=(path,), name="browser", daemon=True).start()

    def close(self) -> None:
        """Remove the file that redirects to the page."""
        self._ended.set()
        if self._waiting is not None:
            self._waiting.join()

    def _start(self, path: Path) -> None:
        with suppress(webbrowser.Error, OSError):
            if webbrowser.open(path.as_uri()):
                return
        self._report("no browser found\n  try: open the first link above yourself")

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
    """Provide a page opener inside the context; its file is removed at the end."""
    opener = PageOpener(access, link, report)
    try:
        yield opener
    finally:
        opener.close()


def _write_redirect(link: str) -> Path:
    """Write the file that redirects to a link, for this user alone; remove files left by killed studios."""
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
