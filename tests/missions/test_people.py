"""The pictures of people: who may read them, what is kept, and that nothing is left of whom one removes."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from missions.people import People, PeopleError, folder, proper_name
from perception.api import Image

PICTURE: Image = np.full((20, 20, 3), 90, np.uint8)


@pytest.fixture(autouse=True)
def open_to_all() -> Iterator[None]:
    """Let new files be readable by all, as far as nobody takes care."""
    before = os.umask(0)
    yield
    os.umask(before)


@pytest.fixture
def people(tmp_path: Path) -> People:
    return People(tmp_path / "people")


def rights(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_pictures_are_kept_by_name_for_their_owner_only(people: People) -> None:
    assert people.add("Anna", [PICTURE] * 3) == "Anna"
    assert people.add("anna", [PICTURE]) == "Anna"
    (known,) = people.known()
    assert (known.name, known.pictures) == ("Anna", 4)
    assert all(np.array_equal(each, PICTURE) for each in people.portraits("Anna"))
    assert rights(people.where) == rights(people.where / "Anna") == 0o700
    files = list((people.where / "Anna").iterdir())
    assert sorted(file.name for file in files) == ["001.png", "002.png", "003.png", "004.png"]
    assert {rights(file) for file in files} == {0o600}


def test_a_folder_that_others_may_read_is_shut(people: People) -> None:
    people.add("Anna", [PICTURE])
    assert not people.shut()
    people.where.chmod(0o755)
    (people.where / "Anna/001.png").chmod(0o644)
    assert people.shut()
    assert not people.shut()


def test_nothing_is_left_of_whom_one_removes(people: People) -> None:
    people.add("Anna", [PICTURE] * 2)
    people.add("Ben", [PICTURE])
    assert people.remove("ANNA") == 2
    assert [path.name for path in people.where.iterdir()] == ["Ben"]
    with pytest.raises(PeopleError, match="nobody is called 'Anna'") as refused:
        people.remove("Anna")
    assert refused.value.hint == "known: Ben"


def test_nobody_is_known_where_there_is_no_folder(people: People) -> None:
    assert people.known() == []
    assert people.all_portraits() == {}
    assert not people.shut()
    assert not people.where.exists(), "looking made no folder"


@pytest.mark.parametrize("name", ["", "  ", "..", "a/b", "unknown", "UNKNOWN", ".hidden", "x" * 61, "a\nb", "-rf"])
def test_what_cannot_be_a_name_is_refused(people: People, name: str) -> None:
    with pytest.raises(PeopleError):
        people.add(name, [PICTURE])
    assert not people.where.exists()


@pytest.mark.parametrize("name", ["Anna", "Anne-Marie", "Li Wei", "José", "Ben_2", "Ä"])
def test_names_of_people_are_names(name: str) -> None:
    assert proper_name(f" {name} ") == name


def test_a_name_is_the_same_however_it_is_composed(people: People) -> None:
    people.add("Jose\u0301", [PICTURE])
    assert people.find("JOS\u00c9") == "Jos\u00e9"


def test_a_picture_that_is_none_is_named(people: People) -> None:
    people.add("Anna", [PICTURE])
    (people.where / "Anna/001.png").write_bytes(b"no picture")
    with pytest.raises(PeopleError, match=r"001\.png: is no picture"):
        people.all_portraits()


def test_they_are_kept_among_the_users_data(tmp_path: Path) -> None:
    assert folder({"XDG_DATA_HOME": str(tmp_path)}) == tmp_path / "missiontree/people"
    assert folder({}) == Path.home() / ".local/share/missiontree/people"
