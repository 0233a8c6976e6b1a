"""A robot whose camera is mounted on its side looks at people as any other."""

from pathlib import Path

import pytest

import missions
from config.library import find_file

LOOK = """mission: look
tree:
  sequence:
    - find_face: {pan: [-60 deg, 60 deg], tilt: [-40 deg, 10 deg]}
      timeout: 30 s
    - race:
        - track_face: {max_turn: 0 deg/s}
          as: person
        - face_centred: {within: 5 deg, face: "${person}"}
          hold: 1 s
      timeout: 15 s
"""


@pytest.mark.parametrize("mounted", ["rotate: 0", "rotate: 90", "rotate: 180, flip: true", "rotate: 270"])
def test_rotated_camera_tracks_a_face(mounted: str, tmp_path: Path) -> None:
    text = find_file("robots", "turtlebot2_arm").read_text(encoding="utf-8")
    before, _, after = text.partition("camera:\n")
    robot, mission = tmp_path / "turned.yaml", tmp_path / "look.yaml"
    robot.write_text(before + "camera:\n  " + mounted.replace(", ", "\n  ") + "\n" + after, encoding="utf-8")
    mission.write_text(LOOK, encoding="utf-8")
    result = missions.run(mission, robot=str(robot), simulate="fast")
    assert result.result == "success", result.reason
