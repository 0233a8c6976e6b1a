"""The page's stop of a fleet: only robots that have confirmed it count."""

import re
from pathlib import Path

from config.defaults import config_folder
from missions.plugins.studio import studio as studio_module
from tests.browser import Browser
from tests.missions.service.fleets import free_port, router
from tests.missions.studio.page import Page
from tests.missions.studio.serving import studio


def write_fleet_file(port: int) -> None:
    config_folder().mkdir(parents=True)
    file = f"fleet: trial\nmode: client\nconnect: ['tcp/127.0.0.1:{port}']\n"
    (config_folder() / "fleet.yaml").write_text(file, encoding="utf-8")


def test_stop_of_a_fleet_without_robots_is_not_reported_as_confirmed(browser: Browser) -> None:
    port = free_port()
    write_fleet_file(port)
    with router(port), studio() as served:
        page = Page(browser, served, view="#fleet")
        page.wait_for("No robots in fleet trial")
        page.press("Stop the fleet")
        page.wait_for("No connected robots in this fleet: none was reached.")
        assert "robots confirmed" not in page.tab.text()


def test_page_reads_the_members_of_the_stop_reply() -> None:
    script = (Path(studio_module.__file__).parent / "page" / "fleet.js").read_text(encoding="utf-8")
    read = re.search(r"const \{ (answers[^}]*) \} = await this\.#link\.ask", script)
    assert read is not None
    names = {name.split("=")[0].strip() for name in read[1].split(",")}
    assert names == set(studio_module._stop_json({}, ["anna"]))
