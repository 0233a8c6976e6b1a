"""Chromium without a window, for tests of pages: read by role and name, clicked and typed into as a person does."""

import base64
import fcntl
import os
import shutil
import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Self

import pytest

from tests.browser_pipe import REPLY_TIMEOUT, Pipe
from tests.waiting import wait_until

NAMES = ("chromium", "chromium-browser", "google-chrome")

FLAGS = (
    "--headless",
    "--remote-debugging-pipe",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-dev-shm-usage",
    # No process is kept ready for a further site, and nothing is left of a page that one has gone from.
    "--disable-features=SpareRendererForSitePerProcess,BackForwardCache",
    # Not even a name is looked up: what a page asks of another host fails, and is seen to have been asked.
    # A server of the test itself may be asked by its number.
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)

KEYS = {
    "Enter": (13, "\r"),
    "Escape": (27, ""),
    " ": (32, " "),
    "End": (35, ""),
    "Home": (36, ""),
    "ArrowLeft": (37, ""),
    "ArrowUp": (38, ""),
    "ArrowRight": (39, ""),
    "ArrowDown": (40, ""),
    "Tab": (9, ""),
}
"""Named keys: the virtual key code of each, and the text that it types."""


def chromium() -> str:
    """Return where Chromium is; skip the test where there is none."""
    found = next((path for name in NAMES if (path := shutil.which(name))), None)
    return found or pytest.skip("no Chromium here: apt-get install chromium, or .ci/run, which installs it")


class Browser:
    """A browser of its own, with an empty profile; it ends with the ``with`` block. ``more`` are further flags."""

    def __init__(self, path: str, *more: str) -> None:
        self._path, self._more = path, more
        self._target = self._session = ""
        self._profile = TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True)

    def __enter__(self) -> Self:
        told, tell = os.pipe()
        hear, said = os.pipe()
        # Above 9, so that neither is closed by the other's becoming 3 or 4.
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in (told, said)]
        sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []
        self._process = os.posix_spawn(
            self._path,
            [self._path, *FLAGS, *self._more, *sandbox, f"--user-data-dir={self._profile.name}", "about:blank"],
            os.environ,
            file_actions=[
                (os.POSIX_SPAWN_DUP2, ends[0], 3),
                (os.POSIX_SPAWN_DUP2, ends[1], 4),
                (os.POSIX_SPAWN_OPEN, 2, os.devnull, os.O_WRONLY, 0),
            ],
        )
        for end in (told, said, *ends):
            os.close(end)
        self._pipe = Pipe(tell, hear)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with suppress(EOFError, OSError, TimeoutError):
            self._pipe.ask("Browser.close", None)
        self._pipe.close()
        try:
            wait_until(lambda: os.waitpid(self._process, os.WNOHANG)[0], REPLY_TIMEOUT)
        except AssertionError:
            os.kill(self._process, signal.SIGKILL)
            os.waitpid(self._process, 0)
            raise
        finally:
            self._profile.cleanup()

    def open(
        self, page: Path | str, *, size: tuple[int, int] = (1280, 800), dark: bool = False, script: bool = True
    ) -> "Tab":
        """Open a page in place of the last one, ``size`` pixels wide and high, and wait until it has loaded.

        ``page`` is a file, or an address on 127.0.0.1. The tab stays, for a process of its own costs more than most
        tests do; whatever was set in it goes.
        """
        if self._target:
            Tab(self._pipe, self._session).go("about:blank")
            self._pipe.ask("Target.detachFromTarget", None, sessionId=self._session)
            self._pipe.unasked.clear()
        else:
            self._target = self._pipe.ask("Target.createTarget", None, url="about:blank")["targetId"]
        attached = self._pipe.ask("Target.attachToTarget", None, targetId=self._target, flatten=True)
        self._session = attached["sessionId"]
        tab = Tab(self._pipe, self._session)
        for domain in ("Page", "Network", "Runtime", "Log", "DOM"):
            tab.ask(f"{domain}.enable")
        width, height = size
        tab.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        tab.ask("Emulation.setEmulatedMedia", features=[scheme])
        tab.ask("Emulation.setScriptExecutionDisabled", value=not script)
        tab.ask("Page.setLifecycleEventsEnabled", enabled=True)
        tab.go(page.resolve().as_uri() if isinstance(page, Path) else page)
        return tab

    def close_tab(self) -> None:
        """Close the tab as a person does; the next page is opened in a new one."""
        self._pipe.ask("Target.closeTarget", None, targetId=self._target)
        self._pipe.unasked.clear()
        self._target = ""


class Tab:
    """An open page."""

    def __init__(self, pipe: Pipe, session: str) -> None:
        self._pipe, self._session = pipe, session

    def ask(self, method: str, **params: object) -> dict[str, Any]:
        """Ask the browser something about this page, in the words of its protocol."""
        return self._pipe.ask(method, self._session, **params)

    def go(self, address: str) -> None:
        """Go to a page, and wait until it has loaded."""
        loader = self.ask("Page.navigate", url=address)["loaderId"]
        self._pipe.wait_for("Page.lifecycleEvent", loaderId=loader, name="load")

    @property
    def requests(self) -> list[str]:
        """All addresses that the page has asked for, itself among them; not what it carries within (``data:``)."""
        asked = (said["request"]["url"] for said in self._said("Network.requestWillBeSent"))
        return [url for url in asked if not url.startswith("data:")]

    @property
    def errors(self) -> list[str]:
        """What went wrong: exceptions of its script, and what the browser refused or did not find."""
        thrown = [
            said["exceptionDetails"]["exception"]["description"] for said in self._said("Runtime.exceptionThrown")
        ]
        logged = (said["entry"] for said in self._said("Log.entryAdded"))
        return thrown + [entry["text"] for entry in logged if entry["level"] == "error"]

    def _said(self, method: str) -> Iterator[dict[str, Any]]:
        self.evaluate("0")  # what was on its way has come by now
        for message in self._pipe.unasked:
            if message.get("sessionId") == self._session and message["method"] == method:
                yield message["params"]

    def evaluate(self, expression: str) -> Any:
        """Return the value of an expression of JavaScript."""
        answer = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{expression}: {answer['exceptionDetails']['exception']['description']}")
        return answer["result"].get("value")

    def all(self, role: str = "") -> list["Element"]:
        """Return what a screen reader finds, in the order of the page: all, or those of one role."""
        nodes = {node["nodeId"]: node for node in self.ask("Accessibility.getFullAXTree")["nodes"]}
        ahead = [next(iter(nodes))]
        found = []
        while ahead:
            node = nodes[ahead.pop()]
            ahead += reversed(node.get("childIds", ()))
            if not node["ignored"] and role in ("", node["role"]["value"]):
                found.append(Element.read(self, node))
        return found

    def find(self, role: str, name: str = "") -> "Element":
        """Return the first of a role whose name has ``name`` in it; LookupError says what there is."""
        there = self.all(role)
        for element in there:
            if name in element.name:
                return element
        names = [element.name for element in there]
        raise LookupError(f"no {role} '{name}', but {names or sorted({element.role for element in self.all()})}")

    def focused(self) -> "Element":
        """Return what has the keyboard."""
        return next(element for element in reversed(self.all()) if element.properties.get("focused"))

    def press(self, *keys: str) -> None:
        """Press and let go one key after another: "ArrowDown", "Enter", " ", "a"."""
        for key in keys:
            code, text = KEYS.get(key, (ord(key.upper()[0]) if key.isalnum() else 0, key))
            event = {"key": key, "windowsVirtualKeyCode": code}
            self.ask("Input.dispatchKeyEvent", type="keyDown", **event, **({"text": text} if text else {}))
            self.ask("Input.dispatchKeyEvent", type="keyUp", **event)
        self._settle()

    def type(self, text: str) -> None:
        """Type into what has the keyboard."""
        self.press(*text)

    def click(self, x: float, y: float) -> None:
        """Press the mouse at a place in the window, in pixels from its upper left corner."""
        for kind in ("mousePressed", "mouseReleased"):
            self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
        self._settle()

    def _settle(self) -> None:
        """Wait until the page is drawn as it is now: only then a screen reader is told."""
        try:
            self.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
        except RuntimeError as error:  # a click on a link leaves the page
            if "navigated or closed" not in str(error):
                raise

    def text(self) -> str:
        """Return all text that is to be seen."""
        return str(self.evaluate("document.body.innerText"))

    def screenshot(self, *, whole: bool = False) -> bytes:
        """Return a PNG of what the window shows, or of the ``whole`` page."""
        return base64.b64decode(self.ask("Page.captureScreenshot", captureBeyondViewport=whole)["data"])


@dataclass(frozen=True)
class Element:
    """Something on a page, as a screen reader has it: its role, its name and its state."""

    tab: Tab
    node: int
    role: str
    name: str
    properties: Mapping[str, object]

    @classmethod
    def read(cls, tab: Tab, node: Mapping[str, Any]) -> Self:
        """Read one of the browser's accessibility nodes."""
        properties = {state["name"]: state["value"].get("value") for state in node.get("properties", ())}
        name = node.get("name", {}).get("value", "")
        return cls(tab, node.get("backendDOMNodeId", 0), node["role"]["value"], name, properties)

    def focus(self) -> None:
        """Give it the keyboard."""
        self.tab.ask("DOM.focus", backendNodeId=self.node)

    def click(self) -> None:
        """Press the mouse on its middle, where a person would."""
        self.tab.ask("DOM.scrollIntoViewIfNeeded", backendNodeId=self.node)
        left, top, right, bottom = self.box
        self.tab.click((left + right) / 2, (top + bottom) / 2)

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Where it is in the window: left, top, right, bottom in pixels."""
        corners: Sequence[float] = self.tab.ask("DOM.getBoxModel", backendNodeId=self.node)["model"]["border"]
        return min(corners[::2]), min(corners[1::2]), max(corners[::2]), max(corners[1::2])
