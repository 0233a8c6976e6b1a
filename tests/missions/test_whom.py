"""Names of people in missions: those whom the robot does not know are refused before anything moves."""

from pathlib import Path

import click
import numpy as np
import pytest

from missions.cli.request_checks import check_people
from missions.library.people import People
from missions.library.shipped import load_mission
from missions.request import RunRequest
from tests.missions.command import command

FIND = """
mission: find
params: {who: {type: text}, seen: {default: Anna}}
tree:
  sequence:
    - set: {later: Nobody}
    - find_face: {name: "${who}", scans: 1}
    - find_face: {name: "${later}", scans: 1}
    - face_seen: {name: "${seen}"}
    - face_seen
"""
REAL = """
robot: mine
camera: {driver: opencv, source: 0}
"""
ANNA, BEN = ([np.full((32, 32, 3), shade + number, np.uint8) for number in range(8)] for shade in (50, 150))
"""Pictures of two people, of whom nobody looks at what they show."""


@pytest.fixture
def mission(tmp_path: Path) -> str:
    path = tmp_path / "find.yaml"
    path.write_text(FIND)
    return str(path)


@pytest.fixture
def people(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> People:
    """The people of a user, who knows nobody yet."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return People(tmp_path / "data/missiontree/people")


@pytest.fixture
def robot(tmp_path: Path) -> str:
    path = tmp_path / "mine.yaml"
    path.write_text(REAL)
    return str(path)


def check(order: RunRequest) -> None:
    check_people(order, load_mission(order.mission, params=order.params, complete=True))


def refused(order: RunRequest) -> str:
    with pytest.raises(click.UsageError) as caught:
        check(order)
    return caught.value.message


@pytest.mark.parametrize("who", ["Ben", "ben", "unknown", ""])
def test_whom_the_world_has_a_simulated_robot_knows(mission: str, who: str) -> None:
    check(RunRequest(mission, {"who": who}, world="two_people"))


def test_a_name_that_nobody_in_the_world_has_is_refused_with_those_who_are_known(mission: str) -> None:
    said = refused(RunRequest(mission, {"who": "Nobodyy"}, world="house"))
    assert said == (
        "no person in world 'house' is called 'Nobodyy'; known: Anna, Ben, Chidi\n  try: --world NAME, where they are"
    )


def test_a_slip_is_told_of_with_the_name_that_was_meant(mission: str) -> None:
    assert refused(RunRequest(mission, {"who": "Bne"}, world="two_people")).endswith("did you mean 'Ben'?")


def test_all_names_that_are_not_known_are_told_of_and_only_those(mission: str) -> None:
    said = refused(RunRequest(mission, {"who": "Zoe", "seen": "Yves"}, world="two_people"))
    assert "is called 'Zoe' or 'Yves';" in said
    assert "'Nobody'" not in said  # it stands in a variable, which may hold another by then


@pytest.mark.parametrize("world", ["house_empty", "visitor"])
def test_a_house_whose_people_are_out_can_be_simulated_but_that_is_told(
    mission: str, world: str, capsys: pytest.CaptureFixture[str]
) -> None:
    check(RunRequest(mission, {"who": "Ben"}, world=world))
    assert capsys.readouterr().err == (f"no known person in world '{world}': the robot will not find 'Ben' or 'Anna'\n")


def test_a_real_robot_knows_those_who_were_added(mission: str, robot: str, people: People) -> None:
    order = RunRequest(mission, {"who": "Ben"}, robot)
    assert refused(order) == "no person is called 'Ben' or 'Anna'; known: none\n  try: mission person add Ben"
    people.add("Anna", ANNA)
    assert refused(order) == "no person is called 'Ben'; known: Anna\n  try: mission person add Ben"
    people.add("Ben", BEN)
    check(order)


def test_who_has_no_pictures_left_is_not_known(mission: str, robot: str, people: People) -> None:
    (people.folder / "Anna").mkdir(parents=True)
    assert "known: none" in refused(RunRequest(mission, {"who": "Anna"}, robot))


def test_a_true_camera_sees_the_users_people_even_where_the_rest_is_simulated(mission: str, people: People) -> None:
    people.add("Anna", ANNA)
    check(RunRequest(mission, {"who": "Anna"}, simulate="wire", camera="0"))
    assert "known: Anna\n" in refused(
        RunRequest(mission, {"who": "Ben"}, simulate="wire", camera="0", world="two_people")
    )


def test_a_name_with_a_blank_can_be_typed_as_the_hint_has_it(mission: str, robot: str, people: People) -> None:
    assert not people.known_people()
    assert refused(RunRequest(mission, {"who": "Ben Two"}, robot)).endswith("try: mission person add 'Ben Two'")


def test_people_who_cannot_be_read_are_told_of(mission: str, robot: str, people: People) -> None:
    people.folder.parent.mkdir(parents=True)
    people.folder.write_text("no folder")
    said = refused(RunRequest(mission, {"who": "Anna"}, robot))
    assert str(people.folder) in said
    assert "try: ls -ld" in said


def test_a_mission_that_names_nobody_needs_nobody(robot: str, people: People) -> None:
    check(RunRequest("greet", {}, robot))
    assert not people.known_people()


def test_a_run_with_a_wrong_name_does_not_begin(mission: str, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "run", mission, "--param", "who=Nobodyy", "--simulate", "fast")
    assert (outcome.code, outcome.out) == (2, "")
    assert "no person in world 'living_room' is called 'Nobodyy'; known: Anna" in outcome.err
