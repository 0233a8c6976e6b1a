"""Takes the pictures of the studio that are in its page of the docs, in Chromium, as a visitor sees it, light and dark.

    python -m tests.missions.studio.pictures [FOLDER]

Look at them afterwards: they show what they show.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from config.defaults import config_folder
from missions.control.run_folders import SYSTEM_ROOT
from tests.browser import Browser, chromium
from tests.missions.service.fleets import CountingBody, free_port, local_fleet, member, router
from tests.missions.studio.page import DESKTOP, PHONE, Page
from tests.missions.studio.serving import Served, studio
from tests.waiting import wait_until

FOLDER = Path(__file__).parents[3] / "docs" / "studio"

LARGE = ("live", "failsafe")
"""Pictures that are shown as wide as the page is, where they are light; the others are half as wide as the window."""

FLEET = "fleet: trial\nmode: client\nconnect: ['tcp/127.0.0.1:{port}']\nrobots: [anna, berta, carl]\n"


def main() -> None:
    """Take them all."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as home:
        for name in ("XDG_STATE_HOME", "XDG_RUNTIME_DIR", "XDG_CONFIG_HOME", SYSTEM_ROOT):
            os.environ[name] = home
        with fleet(Path(home)), studio() as served, Browser(chromium()) as browser:
            take(served, browser, folder)


@contextmanager
def fleet(home: Path) -> Iterator[None]:
    """Have a fleet of two robots, of which a third is missing."""
    port = free_port()
    config_folder().mkdir(parents=True, exist_ok=True)
    (config_folder() / "fleet.yaml").write_text(FLEET.format(port=port), encoding="utf-8")
    with (
        router(port),
        member(local_fleet(port), "anna", home / "anna", CountingBody()),
        member(local_fleet(port), "berta", home / "berta", CountingBody()),
    ):
        yield


def keep(page: Page, folder: Path, name: str) -> None:
    """Keep what the window shows, light and dark, in 256 colours: a third of the bytes."""
    for scheme, ending in (("light", ""), ("dark", "_dark")):
        page.tab.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        page.tab.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done, 300)))")
        picture = Image.open(BytesIO(page.tab.screenshot())).convert("RGB")
        if picture.width > PHONE[0] and not (name in LARGE and scheme == "light"):
            picture = picture.reduce(2)
        picture.quantize(256).save(folder / f"{name}{ending}.png", optimize=True)


def take(served: Served, browser: Browser, folder: Path) -> None:
    """Greet in the simulated living room, drive, stop, and look back."""
    page = Page(browser, served, size=DESKTOP, view="#run/greet")
    page.wait_for("Run simulated")
    keep(page, folder, "run")
    page.press("Run simulated")
    wait_until(lambda: page.tab.evaluate("document.querySelector('canvas')?.ariaLabel.includes('face')"))
    wait_until(lambda: any("gesture" in each.name and "running" in each.name for each in page.tab.all("treeitem")))
    keep(page, folder, "live")
    wait_until(lambda: page.tab.evaluate("!!document.querySelector('.result.success')"))
    page.go("Records")
    wait_until(lambda: page.tab.evaluate("!!document.querySelector('.record-list .success a')"))
    keep(page, folder, "records")
    page.tab.evaluate("document.querySelector('.record-list a').click()")
    wait_until(lambda: any(each.name.startswith("sequence") for each in page.tab.all("treeitem")))
    half = "const e = document.querySelector('input[type=range]'); e.value = e.max / 2;"
    page.tab.evaluate(f"{half} e.dispatchEvent(new Event('input'))")
    painted = "document.querySelector('canvas')?.getContext('2d').getImageData(320, 240, 1, 1).data[3] > 0"
    wait_until(lambda: page.tab.evaluate(painted))
    wait_until(lambda: any(": running" in each.name for each in page.tab.all("treeitem")))
    keep(page, folder, "record")
    page.go("Drive")
    page.wait_for("With head and camera")
    page.tab.evaluate("document.querySelector('.alone .main').click()")
    wait_until(lambda: page.enabled("Release control"))
    page.go("Robot")
    page.wait_for("Trims and limits", "head pan", "Base")
    keep(page, folder, "robot")
    page.go("Failsafe")
    page.wait_for("Fault")
    chosen = "const what = [...document.querySelectorAll('.failsafe select')][2]; what.value = 'bumper left';"
    page.tab.evaluate(f"{chosen} what.dispatchEvent(new Event('change'))")
    page.wait_for("backing off: bumper left")
    keep(page, folder, "failsafe")
    with served.client(served.operator) as client:
        client.ask("add_task", mission="greet", simulate="wire", at="18:00", every="day")
        client.ask("add_task", mission="patrol", simulate="wire", needs_approval=True, priority=5)
    page.go("Tasks")
    page.wait_for("greet", "needs approval")
    keep(page, folder, "tasks")
    page.go("Fleet")
    wait_until(lambda: page.tab.text().count("ONLINE") == 2)
    keep(page, folder, "fleet")
    phone = Page(browser, served, size=PHONE, view="#drive")
    phone.press("Take control")
    phone.wait_for("You drive.")
    keep(phone, folder, "drive")
    phone.stop.click()
    phone.wait_for("topped from this page", "Hold to release")
    keep(phone, folder, "stopped")


if __name__ == "__main__":
    main()
