"""Who stands before the camera of a run is known to the robot then, by the rules of `mission person add`."""

from pathlib import Path

import pytest

from tests.browser import Browser
from tests.missions.command import Process
from tests.missions.studio.page import Page
from tests.missions.studio.serving import studio

pytestmark = pytest.mark.real_time

FACING = """
mission: facing
tree:
  sequence:
    - find_face: {pan: [-60 deg, 60 deg]}
    - log: found
    - wait: 1000 s
"""


def test_somebody_is_known_once_the_camera_of_a_run_has_seen_them(browser: Browser, tmp_path: Path) -> None:
    mission = tmp_path / "facing.yaml"
    mission.write_text(FACING, encoding="utf-8")
    process = Process("run", str(mission), "--simulate", "wire", "--world", "living_room")
    try:
        process.wait_for_line(lambda line: "found" in line)
        with studio() as served:
            page = Page(browser, served, view="#run")
            page.wait_for("The robot knows nobody yet")
            for name, said in (("1", "'1' cannot be a name"), ("Ana", "Ana: 6 pictures kept")):
                page.tab.evaluate("document.querySelector('.people input').value = ''")
                page.tab.find("textbox", "Name").focus()
                page.tab.type(name)
                page.press("Add with the robot's camera")
                page.wait_for(said)
            page.wait_for("The robot knows Ana.")
    finally:
        process.process.terminate()
        process.end()
