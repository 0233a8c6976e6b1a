"""The studio's page in a browser, used as a person does: by role and name, with the mouse and the keyboard."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from missions.plugins.studio.studio import PAGE_FOLDER
from tests.browser import Browser, Element, Tab
from tests.missions.studio.serving import Served
from tests.waiting import wait_until

PHONE, DESKTOP = (360, 740), (1280, 800)

VIEWS = tuple(re.findall(r'<a href="#\w+">(\w+)</a>', (PAGE_FOLDER / "index.html").read_text(encoding="utf-8")))
"""The names of all views, as the head of the page has them."""


class Page:
    """The page in a tab, signed in by the link of a token."""

    def __init__(
        self, browser: Browser, served: Served, token: str = "", *, size: tuple[int, int] = DESKTOP, view: str = ""
    ) -> None:
        self.tab: Tab = browser.open(f"http://{served.host}/?token={token or served.operator}{view}", size=size)
        wait_until(lambda: "operator" in self.link or "viewer" in self.link)

    @property
    def link(self) -> str:
        """What the page says of its link."""
        return str(self.tab.evaluate("document.getElementById('link')?.textContent ?? ''"))

    def go(self, view: str) -> None:
        self.tab.find("link", view).click()
        wait_until(lambda: self.tab.evaluate(f"location.hash === '#{view.lower()}'"))

    def click(self, role: str, name: str) -> None:
        """Press the mouse on something, away from the head and from STOP, which lie above the page."""
        found = self.tab.find(role, name)
        node = self.tab.ask("DOM.resolveNode", backendNodeId=found.node)["object"]["objectId"]
        middle = "function () { this.scrollIntoView({block: 'center'}) }"
        self.tab.ask("Runtime.callFunctionOn", objectId=node, functionDeclaration=middle)
        found.click()

    def press(self, name: str) -> None:
        """Press a button by its name, once it may be pressed."""
        wait_until(lambda: self.enabled(name))
        self.click("button", name)

    def enabled(self, name: str) -> bool:
        return any(name in each.name and not each.properties.get("disabled") for each in self.tab.all("button"))

    def says(self, *words: str) -> bool:
        text = self.tab.text()
        return all(word in text for word in words)

    def wait_for(self, *words: str) -> None:
        wait_until(lambda: self.says(*words))

    @property
    def stop(self) -> Element:
        return self.tab.find("button", "STOP")

    def mouse(self, kind: str, x: float, y: float) -> None:
        self.tab.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1, buttons=1)

    def middle(self, selector: str) -> tuple[float, float]:
        """Return the middle of an element in the window."""
        box = self.tab.evaluate(
            f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView({{block: 'center'}});"
            "const b = e.getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2] })()"
        )
        return float(box[0]), float(box[1])

    @contextmanager
    def held(self, selector: str, right: float = 0.0, up: float = 0.0) -> Iterator[None]:
        """Hold the mouse on an element, drawn away from its middle by so many pixels."""
        x, y = self.middle(selector)
        self.mouse("mousePressed", x, y)
        if right or up:
            self.mouse("mouseMoved", x + right, y - up)
        yield
        self.mouse("mouseReleased", x + right, y - up)

    def release(self) -> None:
        """Hold the button that releases a stop until it has done so."""
        wait_until(lambda: self.enabled("Hold to release"))
        with self.held(".release"):
            wait_until(lambda: self.says("Released"))
