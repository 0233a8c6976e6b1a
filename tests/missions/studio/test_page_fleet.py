"""The page's stop of a fleet: only robots that have confirmed it count."""

from config.defaults import config_folder
from tests.browser import Browser
from tests.missions.service.fleets import free_port, router
from tests.missions.studio.page import Page
from tests.missions.studio.serving import studio


def test_a_stop_of_a_fleet_without_robots_is_not_told_as_one(browser: Browser) -> None:
    port = free_port()
    config_folder().mkdir(parents=True)
    file = f"fleet: trial\nmode: client\nconnect: ['tcp/127.0.0.1:{port}']\n"
    (config_folder() / "fleet.yaml").write_text(file, encoding="utf-8")
    with router(port), studio() as served:
        page = Page(browser, served, view="#fleet")
        page.wait_for("No robots in fleet trial")
        page.press("Stop the fleet")
        page.wait_for("No robots in this fleet; none has confirmed.")
        assert "robots have confirmed" not in page.tab.text()
