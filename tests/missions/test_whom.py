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
def test_simulated_robot_knows_the_people_of_its_world(mission: str, who: str) -> None:
    check(RunRequest(mission, {"who": who}, world="two_people"))


def test_unknown_person_is_refused_with_the_known_names(mission: str) -> None:
    said = refused(RunRequest(mission, {"who": "Nobodyy"}, world="house"))
    assert said == (
        "no person in world 'house' is called 'Nobodyy'; known: Anna, Ben, Chidi\n  try: --world NAME, where they are"
    )


def test_misspelt_person_gives_a_suggestion(mission: str) -> None:
    assert refused(RunRequest(mission, {"who": "Bne"}, world="two_people")).endswith("did you mean 'Ben'?")


def test_all_unknown_persons_are_reported(mission: str) -> None:
    said = refused(RunRequest(mission, {"who": "Zoe", "seen": "Yves"}, world="two_people"))
    assert "is called 'Zoe' or 'Yves';" in said
    assert "'Nobody'" not in said  # it stands in a variable, which may hold another by then


@pytest.mark.parametrize("world", ["house_empty", "visitor"])
def test_world_without_the_named_people_gives_a_warning(
    mission: str, world: str, capsys: pytest.CaptureFixture[str]
) -> None:
    check(RunRequest(mission, {"who": "Ben"}, world=world))
    assert capsys.readouterr().err == (f"no known person in world '{world}': the robot will not find 'Ben' or 'Anna'\n")


def test_real_robot_knows_the_added_people(mission: str, robot: str, people: People) -> None:
    order = RunRequest(mission, {"who": "Ben"}, robot)
    assert refused(order) == "no person is called 'Ben' or 'Anna'; known: none\n  try: mission person add Ben"
    people.add("Anna", ANNA)
    assert refused(order) == "no person is called 'Ben'; known: Anna\n  try: mission person add Ben"
    people.add("Ben", BEN)
    check(order)


def test_person_without_pictures_is_unknown(mission: str, robot: str, people: People) -> None:
    (people.folder / "Anna").mkdir(parents=True)
    assert "known: none" in refused(RunRequest(mission, {"who": "Anna"}, robot))


def test_a_true_camera_sees_the_users_people_even_where_the_rest_is_simulated(mission: str, people: People) -> None:
    people.add("Anna", ANNA)
    check(RunRequest(mission, {"who": "Anna"}, simulate="wire", camera="0"))
    assert "known: Anna\n" in refused(
        RunRequest(mission, {"who": "Ben"}, simulate="wire", camera="0", world="two_people")
    )


def test_hint_quotes_a_name_with_a_space(mission: str, robot: str, people: People) -> None:
    assert not people.known_people()
    assert refused(RunRequest(mission, {"who": "Ben Two"}, robot)).endswith("try: mission person add 'Ben Two'")


def test_unreadable_people_folder_is_reported(mission: str, robot: str, people: People) -> None:
    people.folder.parent.mkdir(parents=True)
    people.folder.write_text("no folder")
    said = refused(RunRequest(mission, {"who": "Anna"}, robot))
    assert str(people.folder) in said
    assert "try: ls -ld" in said


def test_mission_without_names_needs_no_known_people(robot: str, people: People) -> None:
    check(RunRequest("greet", {}, robot))
    assert not people.known_people()


def test_a_run_with_a_wrong_name_does_not_begin(mission: str, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "run", mission, "--param", "who=Nobodyy", "--simulate", "fast")
    assert (outcome.code, outcome.out) == (2, "")
    assert "no person in world 'living_room' is called 'Nobodyy'; known: Anna" in outcome.err
