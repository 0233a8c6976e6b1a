"""Who stands before the camera of a run is known to the robot then, by the rules of `mission person add`."""

import asyncio
import base64
from math import radians
from pathlib import Path
from typing import Any, cast

import cv2
import pytest

from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import PinholeLens, Viewpoint
from drivers.sim.world import SimulatedWorld
from missions.control.commands import BadMessage, ClientCommand
from missions.library.folders import state_folder
from missions.plugins.studio.access import StudioAccess
from missions.plugins.studio.audit_log import AuditLog
from missions.plugins.studio.run_launcher import RunLauncher
from missions.plugins.studio.studio import Studio
from missions.plugins.studio.studio_commands import AddPerson, ShowPerson
from tests.browser import Browser, chromium
from tests.missions.command import Process
from tests.missions.studio.page import Page
from tests.missions.studio.serving import studio

FACING = """
mission: facing
tree:
  sequence:
    - find_face: {pan: [-60 deg, 60 deg]}
    - log: found
    - wait: 1000 s
"""


@pytest.mark.real_time
def test_person_is_added_with_the_camera_of_a_run(browser: Browser, tmp_path: Path) -> None:
    mission = tmp_path / "facing.yaml"
    mission.write_text(FACING, encoding="utf-8")
    process = Process("run", str(mission), "--simulate", "wire", "--world", "living_room")
    try:
        process.wait_for_line(lambda line: "found" in line)
        with studio() as served:
            page = Page(browser, served, view="#run")
            page.wait_for("The robot knows no people yet")
            for name, said in (("1", "'1' cannot be a name"), ("Ana", "Ana: 6 pictures saved")):
                page.tab.evaluate("document.querySelector('.people input').value = ''")
                page.tab.find("textbox", "Name").focus()
                page.tab.type(name)
                page.press("Add with the robot's camera")
                page.wait_for(said)
            page.wait_for("The robot knows Ana.")
    finally:
        process.process.terminate()
        process.end()


@pytest.mark.real_time
def test_person_is_added_with_the_camera_of_the_browser(tmp_path: Path) -> None:
    film = tmp_path / "face.mjpeg"
    camera = Renderer(
        SimulatedWorld(people=(Person("p", "anna", x=0.7),)), PinholeLens(640, 480, radians(60)), noise=2.0
    )
    frames = [camera.draw(Viewpoint(z=1.55, yaw=radians(turn)), 0.0) for turn in range(-8, 9, 2)]
    film.write_bytes(b"".join(cv2.imencode(".jpg", frame)[1].tobytes() for frame in frames))
    flags = ("--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream")
    with Browser(chromium(), *flags, f"--use-file-for-fake-video-capture={film}") as browser, studio() as served:
        page = Page(browser, served, view="#run")
        page.wait_for("The robot knows no people yet")
        page.tab.find("textbox", "Name").focus()
        page.tab.type("Ana")
        page.press("Add with this browser's camera")
        page.wait_for("Take a step back")
        page.wait_for("pictures saved")
        page.wait_for("The robot knows Ana.")
        assert page.tab.evaluate("document.querySelectorAll('video').length") == 0
        # A page that is no secure context is given no camera, and says so.
        page.tab.evaluate("Object.defineProperty(navigator, 'mediaDevices', {value: undefined})")
        page.press("Add with this browser's camera")
        page.wait_for("only over https")
    log = (state_folder() / "studio.log").read_text(encoding="utf-8")
    assert "add_person" in log
    assert "jpeg" not in log


def test_person_needs_valid_pictures(tmp_path: Path) -> None:
    studio = Studio(AuditLog(tmp_path / "log"), RunLauncher(record=False), cast("Any", None), StudioAccess())

    class Somebody:
        name = "operator 1"

    by = cast("Any", Somebody())

    def refused(command: ClientCommand) -> BadMessage:
        with pytest.raises(BadMessage) as found:
            asyncio.run(studio.run_command(command, by))
        return found.value

    assert refused(AddPerson(name="Ana")).hint == "show_person"
    assert refused(ShowPerson(jpeg="no base64!")).error == "bad_field"
    asyncio.run(studio.run_command(ShowPerson(jpeg=base64.b64encode(b"no picture").decode()), by))
    assert refused(AddPerson(name="Ana")).error == "no_person"
