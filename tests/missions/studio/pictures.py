"""Takes the pictures of the studio that are in its page of the docs, in Chromium, as a visitor sees it.

    python -m tests.missions.studio.pictures [FOLDER]

Look at them afterwards: they show what they show.
"""

import os
import sys
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from tests.browser import Browser, chromium
from tests.missions.studio.page import DESKTOP, PHONE, Page
from tests.missions.studio.serving import Served, studio
from tests.waiting import wait_until

FOLDER = Path(__file__).parents[3] / "docs" / "studio"


def main() -> None:
    """Take them all."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as home:
        for name in ("XDG_STATE_HOME", "XDG_RUNTIME_DIR", "XDG_CONFIG_HOME"):
            os.environ[name] = home
        with studio() as served, Browser(chromium()) as browser:
            take(served, browser, lambda page, name: keep(folder / f"{name}.png", page.tab.screenshot()))


def keep(path: Path, png: bytes) -> None:
    """Write a picture in 256 colours: a third of the bytes."""
    Image.open(BytesIO(png)).convert("RGB").quantize(256).save(path, optimize=True)


def take(served: Served, browser: Browser, keep: Callable[[Page, str], object]) -> None:
    """Greet in the simulated living room, drive, stop, and look back."""
    page = Page(browser, served, size=DESKTOP, view="#run/greet")
    page.wait_for("Run simulated")
    keep(page, "run")
    page.press("Run simulated")
    wait_until(lambda: page.tab.evaluate("document.querySelector('canvas')?.ariaLabel.includes('face')"))
    keep(page, "live")
    wait_until(lambda: page.tab.evaluate("!!document.querySelector('.result.success')"))
    page.go("Records")
    wait_until(lambda: page.tab.evaluate("!!document.querySelector('.record-list .success a')"))
    page.tab.evaluate("document.querySelector('.record-list a').click()")
    wait_until(lambda: any(each.name.startswith("sequence") for each in page.tab.all("treeitem")))
    half = "const e = document.querySelector('input[type=range]'); e.value = e.max / 2;"
    page.tab.evaluate(f"{half} e.dispatchEvent(new Event('input'))")
    painted = "document.querySelector('canvas')?.getContext('2d').getImageData(320, 240, 1, 1).data[3] > 0"
    wait_until(lambda: page.tab.evaluate(painted))
    keep(page, "record")
    page.go("Drive")
    page.wait_for("With its head and its camera")
    page.tab.evaluate("document.querySelector('.alone .main').click()")
    wait_until(lambda: page.enabled("Take the wheels"))
    page.go("Robot")
    page.wait_for("Trims and limits", "head pan", "Base")
    keep(page, "robot")
    page.go("Failsafe")
    page.wait_for("What happens")
    chosen = "const what = [...document.querySelectorAll('.failsafe select')][2]; what.value = 'bumper left';"
    page.tab.evaluate(f"{chosen} what.dispatchEvent(new Event('change'))")
    page.wait_for("backing off: bumper left")
    keep(page, "failsafe")
    phone = Page(browser, served, size=PHONE, view="#drive")
    phone.press("Take the wheels")
    phone.wait_for("You drive.")
    keep(phone, "drive")
    phone.stop.click()
    phone.wait_for("topped from this page", "Hold to release")
    keep(phone, "stopped")


if __name__ == "__main__":
    main()
