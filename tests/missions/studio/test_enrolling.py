"""Who stands before the camera of a run is known to the robot then, by the rules of `mission person add`."""

from pathlib import Path

import pytest

from tests.missions.command import Process
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


def test_somebody_is_known_once_the_camera_of_a_run_has_seen_them(tmp_path: Path) -> None:
    mission = tmp_path / "facing.yaml"
    mission.write_text(FACING, encoding="utf-8")
    process = Process("run", str(mission), "--simulate", "wire", "--world", "living_room")
    try:
        process.wait_for_line(lambda line: "found" in line)
        with studio() as served, served.client(served.operator) as client:
            run = str(process.process.pid)
            client.hear(lambda told: told["say"] == "runs" and told["runs"])
            refused = client.ask("add_person", name="../Ana", run=run)
            assert (refused["error"], "../Ana" in refused["message"]) == ("no_person", True)
            told = client.ask("add_person", name="Ana", run=run)
            assert told["ok"], told
            assert "Ana: 6 pictures kept" in told["result"]["message"]
            assert client.ask("library")["result"]["people"] == ["Ana"]
    finally:
        process.process.terminate()
        process.end()
