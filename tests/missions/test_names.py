"""Missions that ask who somebody is: with eyes that know the world, and with those that search its pictures."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from config.library import find_file
from config.world import WorldConfig, load_world
from drivers.api import DeviceStatus
from missions.assembly.drawn_portraits import drawn_gallery
from missions.assembly.gallery import gallery, recogniser
from missions.assembly.truth import TrueNames
from missions.executive.events import Event, Logged, PerceptSeen
from missions.executive.executive import Result
from missions.library.drivers import load_robot
from missions.library.interests import Interests, interests_of
from missions.library.people import People
from missions.library.shipped import load_mission
from missions.request import RunRequest
from missions.runner import Runner
from perception.api import UNKNOWN, Box, Detection
from perception.identity import FaceMatch, NullRecogniser
from perception.people import PatchRecogniser
from perception.tracks import FaceSighting
from tests.perception.people_drawn import pictures

FIND = """
mission: find
params: {who: Ben}
tree:
  sequence:
    - find_face: {name: "${who}", scans: 2}
      as: person
    - log: "found ${person.name} ${person.yaw}"
"""
WHO = """
mission: who
tree:
  sequence:
    - find_face:
      as: person
    - identify: "${person}"
      as: who
      timeout: 4 s
    - log: "found ${who.name} 0"
"""


def two_people(**known: bool) -> WorldConfig:
    """Return the world of Anna and Ben, known or not."""
    world = load_world(find_file("worlds", "two_people"))
    return replace(world, people=tuple(replace(each, known=known.get(each.name, True)) for each in world.people))


def ran(
    tmp_path: Path, text: str, *, world: WorldConfig, eyes: str = "truth", params: Mapping[str, str] | None = None
) -> tuple[Result, list[Event]]:
    path, events = tmp_path / "mission.yaml", list[Event]()
    path.write_text(text)
    order = RunRequest(
        str(path), params or {}, simulate="fast", world=world, eyes="truth" if eyes == "truth" else "pixels"
    )
    return Runner(order, listeners=[events.append]).run(), events


def found(events: list[Event]) -> tuple[str, float]:
    """Return whom a mission has found, and in which direction (degrees)."""
    (text,) = [event.text for event in events if isinstance(event, Logged) and event.text.startswith("found ")]
    _, name, yaw, *unit = text.split()
    assert unit in ([], ["deg"])
    return name, float(yaw)


@pytest.mark.parametrize("eyes", ["truth", "pixels"])
def test_person_is_found_by_name_instead_of_the_nearest(tmp_path: Path, eyes: str) -> None:
    result, events = ran(tmp_path, FIND, world=two_people(), eyes=eyes)
    assert result.result == "success", result.reason
    name, yaw = found(events)
    assert name == "Ben"
    assert yaw < 0, "Ben stands to the right"
    told = {face.get("name") for event in events if isinstance(event, PerceptSeen) for face in event.faces}
    assert None in told, "at first it was not decided"
    assert "Ben" in told


def test_absent_person_is_not_found_among_others(tmp_path: Path) -> None:
    result, _ = ran(tmp_path, FIND, world=two_people(), params={"who": "Chidi"})
    assert result.result == "failure"
    assert "no face found in 2 scans" in result.reason


@pytest.mark.parametrize("eyes", ["truth", "pixels"])
def test_a_stranger_is_found_as_unknown(tmp_path: Path, eyes: str) -> None:
    result, events = ran(tmp_path, FIND, world=two_people(Anna=False), eyes=eyes, params={"who": UNKNOWN})
    assert result.result == "success", result.reason
    name, yaw = found(events)
    assert name == UNKNOWN
    assert yaw > 0, "Anna stands to the left"


def test_identify_returns_the_name_or_unknown(tmp_path: Path) -> None:
    _, events = ran(tmp_path, WHO, world=two_people(Anna=False, Ben=False))
    assert found(events)[0] == UNKNOWN
    _, events = ran(tmp_path, WHO, world=two_people())
    assert found(events)[0] in ("Anna", "Ben")


# --- who asks, and what it costs ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("step", "asks"),
    [
        ("face_seen", False),
        ("face_seen: {within: 1 s}", False),
        ('face_seen: {name: ""}', False),
        ("face_seen: {name: Anna}", True),
        ('faces_at_least: {number: 2, name: "${to}"}', True),
        ("identify", True),
        ("log: ${face.seen}", False),
        ("log: ${face.name}", True),
        ("log: ${face.undecided}", True),
    ],
)
def test_names_are_recognised_only_if_a_mission_needs_them(tmp_path: Path, step: str, asks: bool) -> None:
    path = tmp_path / "ask.yaml"
    path.write_text(f"mission: ask\nparams: {{to: Anna}}\ntree:\n  sequence:\n    - {step}\n    - wait: 1 s\n")
    asked = interests_of(load_mission(str(path)).tree, None)
    assert asked.faces
    assert asked.names is asks


def test_no_face_recogniser_without_interest_in_names() -> None:
    assert recogniser(Interests(), lambda _: None, drawn=two_people().people) is None


# --- whom it knows -------------------------------------------------------------------------------------------------


def test_gallery_reports_look_alikes_and_omits_strangers() -> None:
    people, notices = two_people().people, list[DeviceStatus]()
    alike = [replace(each, look="anna") for each in people]
    drawn_gallery(alike, notices.append)
    assert [notice.message for notice in notices] == ["Anna and Ben look alike"]
    notices.clear()
    drawn_gallery([alike[0], replace(alike[1], known=False)], notices.append)
    assert notices == []
    assert isinstance(drawn_gallery([replace(each, known=False) for each in people], notices.append), NullRecogniser)


def test_a_real_camera_knows_the_people_in_the_folder_of_the_robot_file(tmp_path: Path) -> None:
    camera = load_robot(find_file("robots", "turtlebot2_arm")).camera
    assert camera is not None
    own = replace(camera, identity=replace(camera.identity, people=str(tmp_path / "people")))
    notices = list[DeviceStatus]()
    assert isinstance(gallery(own, notices.append), NullRecogniser)
    assert [(notice.message, notice.hint) for notice in notices] == [
        ("no people are known yet, so all are unknown", "mission person add NAME")
    ]
    notices.clear()
    people = People(tmp_path / "people")
    people.add("Anna", [picture[40:440, 120:520] for picture in pictures("anna", (1.2,), each=4)])
    assert isinstance(gallery(own, notices.append), PatchRecogniser)
    assert notices == []
    (people.folder / "Anna/001.png").write_bytes(b"broken")
    assert isinstance(gallery(own, notices.append), PatchRecogniser), "the other pictures are enough"
    assert [notice.message for notice in notices] == [f"{people.folder}/Anna/001.png: is not a portrait; it is skipped"]
    assert notices[0].hint == f"rm {people.folder}/Anna/001.png"


def test_people_folder_keeps_its_other_files_and_modes(tmp_path: Path) -> None:
    camera = load_robot(find_file("robots", "turtlebot2_arm")).camera
    assert camera is not None
    tool = tmp_path / "proj/bin/tool"
    tool.parent.mkdir(parents=True)
    tool.touch(0o755)
    tool.chmod(0o755)
    notices = list[DeviceStatus]()
    named = replace(camera, identity=replace(camera.identity, people=str(tmp_path)))
    assert isinstance(gallery(named, notices.append), NullRecogniser)
    assert [notice.message for notice in notices] == ["no people are known yet, so all are unknown"]
    assert tool.stat().st_mode & 0o777 == 0o755


def test_portrait_problems_are_reported_once_at_the_first_match() -> None:
    notices = list[DeviceStatus]()
    alike = [replace(each, look="anna") for each in two_people().people]
    known = recogniser(Interests(names=True), notices.append, drawn=alike)
    assert known is not None
    assert notices == []
    for image in pictures("anna", (1.5,), each=2):
        known.match(image, Box(300.0, 200.0, 60.0, 60.0))
    assert [notice.message for notice in notices] == ["Anna and Ben look alike"]


def test_simulated_recogniser_errs_at_the_given_rate() -> None:
    people = two_people(Ben=False).people
    shown = [
        FaceSighting(Detection(Box(x, 0.0, 50.0, 50.0), 5.0), found=True, person=who)
        for x, who in ((1, "Anna"), (2, "Ben"))
    ]
    exact, poor = TrueNames(people, 0.0, Random(1)), TrueNames(people, 0.3, Random(1))  # noqa: S311 - which looks are mistaken is no secret
    assert [exact.look(each.box, shown) for each in shown] == [FaceMatch("Anna", 1.0), FaceMatch("Ben", -1.0)]
    assert exact.look(Box(9.0, 9.0, 50.0, 50.0), shown) is None
    wrong = sum(poor.look(shown[0].box, shown) != FaceMatch("Anna", 1.0) for _ in range(1000))
    assert 250 < wrong < 350
