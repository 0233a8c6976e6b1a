"""The pictures of people: who may read them, what is kept, and that nothing is left of whom one removes."""

import os
import resource
import stat
from collections.abc import Iterator
from itertools import count, takewhile
from pathlib import Path
from threading import Event, Thread

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import SystemClock
from missions.library.people import People, PeopleError, people_folder, picture_files, proper_name
from perception.api import Image
from perception.people import MAX_PICTURES, MAX_PICTURES_TOGETHER, MIN_PICTURES


def taken(number: int, size: int = 20) -> Image:
    """Return a picture that no other number has."""
    return np.random.default_rng(number).integers(0, 255, (size, size, 3), np.uint8)


ANNA, BEN, CHIDI = ([taken(start + number) for number in range(3)] for start in (0, 10, 20))


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
    return stat.S_IMODE(path.lstat().st_mode)


def portraits(people: People) -> dict[str, list[Image]]:
    """Return the pictures of everybody, where there is nothing the matter with any."""
    told = list[PeopleError]()
    found = people.portraits(told.append)
    assert told == []
    return found


def test_pictures_are_stored_by_name_with_private_permissions(people: People) -> None:
    assert people.add("Anna", ANNA) == "Anna"
    assert people.add("anna", [taken(3)]) == "Anna"
    (known,) = people.known_people()
    assert (known.name, known.pictures) == ("Anna", 4)
    kept = portraits(people)["Anna"]
    assert all(np.array_equal(one, other) for one, other in zip(kept, [*ANNA, taken(3)], strict=True))
    assert rights(people.folder) == rights(people.folder / "Anna") == 0o700
    files = list((people.folder / "Anna").iterdir())
    assert sorted(file.name for file in files) == ["001.png", "002.png", "003.png", "004.png"]
    assert {rights(file) for file in files} == {0o600}


def test_remove_deletes_all_pictures_of_a_person(people: People) -> None:
    people.add("Anna", ANNA)
    people.add("Ben", BEN)
    assert people.remove("ANNA") == 3
    assert [path.name for path in people.folder.iterdir()] == ["Ben"]
    with pytest.raises(PeopleError, match="no person is called 'Anna'") as refused:
        people.remove("Anna")
    assert refused.value.hint == "known: Ben"


def test_missing_people_folder_has_no_known_people(people: People) -> None:
    assert people.known_people() == []
    assert portraits(people) == {}
    assert not people.restrict_access()
    assert not people.folder.exists(), "looking made no folder"


def test_people_folder_is_in_the_users_data_folder(tmp_path: Path) -> None:
    assert people_folder({"XDG_DATA_HOME": str(tmp_path)}) == tmp_path / "missiontree/people"
    assert people_folder({}) == Path.home() / ".local/share/missiontree/people"


# --- what is somebody else's ---------------------------------------------------------------------------------------


@pytest.fixture
def crowded(people: People) -> People:
    """Anna's pictures in a folder where much else is, and links to what is elsewhere; all of it readable by all."""
    outside = people.folder.parent / "outside"
    outside.mkdir()
    (outside / "001.png").write_bytes(b"elsewhere")
    (people.folder / "proj/bin").mkdir(parents=True)
    (people.folder / "proj/bin/tool").touch(0o755)
    (people.folder / "proj/bin/001.png").touch(0o644)
    (people.folder / "notes.txt").touch(0o644)
    people.add("Anna", ANNA)
    home = people.folder / "Anna"
    (home / "letter.txt").touch(0o644)
    (home / "007.png").symlink_to(outside / "001.png")
    (people.folder / "Zoe").symlink_to(outside)
    return people


def seen(where: Path) -> dict[str, int]:
    """Return the rights of all in a folder and below; links are not followed."""
    return {str(path.relative_to(where)): rights(path) for path in where.rglob("*")}


def test_only_pictures_and_their_folders_are_shut(crowded: People) -> None:
    home = crowded.folder / "Anna"
    before, outside = seen(crowded.folder), seen(crowded.folder.parent / "outside")
    assert not crowded.restrict_access()
    crowded.folder.chmod(0o755)
    home.chmod(0o755)
    (home / "001.png").chmod(0o444)
    assert crowded.restrict_access()
    assert not crowded.restrict_access()
    assert rights(crowded.folder) == 0o700
    assert seen(crowded.folder) == before | {"Anna/001.png": 0o400}
    assert seen(crowded.folder.parent / "outside") == outside


def test_folder_without_people_is_left_unchanged(tmp_path: Path) -> None:
    (tmp_path / "src").mkdir(0o755)
    (tmp_path / "src/tool").touch(0o755)
    tmp_path.chmod(0o755)
    before = seen(tmp_path)
    assert not People(tmp_path).restrict_access()
    assert seen(tmp_path) == before
    assert rights(tmp_path) == 0o755


def test_only_people_with_pictures_are_known_and_removable(crowded: People) -> None:
    before = seen(crowded.folder)
    assert [each.name for each in crowded.known_people()] == ["Anna"]
    for name in ("proj", "Zoe", "..", "notes.txt"):
        with pytest.raises(PeopleError, match="no person is called"):
            crowded.remove(name)
    assert crowded.remove("Anna") == 3
    assert seen(crowded.folder) == {path: mode for path, mode in before.items() if path not in {
        "Anna/001.png", "Anna/002.png", "Anna/003.png"}}  # fmt: skip


def test_add_does_not_follow_a_link(crowded: People) -> None:
    outside = seen(crowded.folder.parent / "outside")
    with pytest.raises(PeopleError, match="Zoe: nothing was stored: Not a directory"):
        crowded.add("Zoe", CHIDI)
    assert seen(crowded.folder.parent / "outside") == outside
    assert not list(crowded.folder.glob(".*"))


def test_existing_picture_names_are_not_overwritten(crowded: People) -> None:
    crowded.add("Anna", [taken(3)])
    home = crowded.folder / "Anna"
    assert (home / "007.png").is_symlink()
    assert (home / "008.png").is_file()


# --- what happens meanwhile ----------------------------------------------------------------------------------------


def test_dangling_link_is_not_counted_as_a_picture(people: People) -> None:
    people.add("Anna", ANNA)
    (people.folder / "Anna/017.png").symlink_to("nowhere.png")
    (people.folder / "link").symlink_to("nowhere")
    assert not people.restrict_access()
    assert [each.pictures for each in people.known_people()] == [3]
    assert len(portraits(people)["Anna"]) == 3


def test_vanished_folder_has_no_picture_files(tmp_path: Path) -> None:
    assert picture_files(tmp_path / "gone") == {}


def test_people_are_added_and_removed_beside_readers(people: People) -> None:
    people.add("Ben", BEN)
    over, faults = Event(), list[Exception]()

    def change() -> None:
        while not over.is_set():
            people.add("Anna", ANNA)
            people.add("Anna", [taken(3), taken(4)])
            people.remove("Anna")

    def guarded() -> None:
        try:
            change()
        except Exception as error:
            faults.append(error)

    writer = Thread(target=guarded)
    writer.start()
    try:
        met, clock = set[int](), SystemClock()
        # On a busy machine the reader may have looked 300 times before the first one is added.
        for _ in takewhile(lambda number: number < 300 or (not met and clock.now() < 60.0), count()):
            told = list[PeopleError]()
            people.restrict_access()
            met.update(each.pictures for each in people.known_people() if each.name == "Anna")
            found = people.portraits(told.append)
            assert len(found["Ben"]) == 3
            assert all("too few" in str(each) for each in told), told
            assert len(found.get("Anna", ANNA)) >= 3
    finally:
        over.set()
        writer.join(60.0)
    assert not writer.is_alive()
    assert faults == []
    assert met, "Anna was never there"


def test_concurrent_adds_are_all_stored(people: People) -> None:
    def add(name: str, first: int) -> None:
        for number in range(10):
            people.add(name, [taken(first + 3 * number + each) for each in range(3)])

    adding = [Thread(target=add, args=("Anna", 100 * number)) for number in (1, 2, 3)]
    for thread in adding:
        thread.start()
    for thread in adding:
        thread.join(20.0)
    assert [each.pictures for each in people.known_people()] == [90]
    assert [path.name for path in people.folder.iterdir()] == ["Anna"]


def test_leftovers_of_a_killed_add_are_ignored_and_removed(people: People) -> None:
    people.add("Ben", BEN)
    left = people.folder / ".new-abc"
    left.mkdir()
    (left / "001.png").write_bytes(b"half a picture")
    assert [each.name for each in people.known_people()] == ["Ben"]
    people.add("Anna", ANNA)
    assert sorted(path.name for path in people.folder.iterdir()) == ["Anna", "Ben"]


# --- what can be learnt from ---------------------------------------------------------------------------------------


def test_a_picture_counts_once(people: People) -> None:
    with pytest.raises(PeopleError, match="too few pictures of Anna: 2, where each counts once"):
        people.add("Anna", [ANNA[0], ANNA[1], ANNA[0].copy(), ANNA[0]])
    assert not people.folder.exists()
    people.add("Anna", [*ANNA, *ANNA])
    people.add("Anna", [ANNA[2], taken(3)])
    assert [each.pictures for each in people.known_people()] == [4]
    people.add("Anna", ANNA)
    assert [each.pictures for each in people.known_people()] == [4]


def test_picture_of_another_person_is_refused(people: People) -> None:
    people.add("Anna", ANNA)
    with pytest.raises(PeopleError, match="one of the pictures of Ben is already stored for Anna") as refused:
        people.add("Ben", [*BEN, ANNA[1]])
    assert "mission person remove Anna" in refused.value.hint
    assert [path.name for path in people.folder.iterdir()] == ["Anna"]


@pytest.fixture
def small_files() -> Iterator[None]:
    """Let no file be larger than 4 kB, as if the disk were full then."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.usefixtures("small_files")
def test_full_disk_stores_no_new_person(people: People) -> None:
    with pytest.raises(PeopleError, match="Anna: nothing was stored: File too large") as refused:
        people.add("Anna", [*ANNA, taken(3, size=100)])
    assert "df -h" in refused.value.hint
    assert list(people.folder.iterdir()) == []


@pytest.mark.usefixtures("small_files")
def test_full_disk_leaves_a_known_person_unchanged(people: People) -> None:
    people.add("Anna", ANNA)
    with pytest.raises(PeopleError, match="File too large"):
        people.add("Anna", [taken(3), taken(4, size=100)])
    assert len(list((people.folder / "Anna").iterdir())) == 3
    assert [path.name for path in people.folder.iterdir()] == ["Anna"]


def test_failed_add_removes_all_of_its_pictures(people: People, monkeypatch: pytest.MonkeyPatch) -> None:
    people.add("Anna", ANNA)
    rename = Path.rename

    def fail_at_five(path: Path, target: Path) -> Path:
        if target.name == "005.png":
            raise OSError(5, "Input/output error")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", fail_at_five)
    with pytest.raises(PeopleError, match="Input/output error"):
        people.add("Anna", [taken(3), taken(4)])
    assert sorted(path.name for path in people.folder.rglob("*")) == ["001.png", "002.png", "003.png", "Anna"]


HALF = cv2.imencode(".png", ANNA[0])[1].tobytes()[:60]


@pytest.mark.parametrize("content", [b"no picture", b"", HALF], ids=["text", "empty", "half"])
def test_invalid_picture_is_reported_and_skipped(people: People, content: bytes) -> None:
    people.add("Anna", [*ANNA, taken(3)])
    people.add("Ben", BEN)
    (people.folder / "Anna/001.png").write_bytes(content)
    told = list[PeopleError]()
    found = people.portraits(told.append)
    assert {name: len(each) for name, each in found.items()} == {"Anna": 3, "Ben": 3}
    (error,) = told
    assert str(error) == f"{people.folder}/Anna/001.png: is not a portrait; it is skipped"
    assert error.hint == f"rm {people.folder}/Anna/001.png"


def test_person_with_too_few_pictures_is_reported_and_skipped(people: People) -> None:
    people.add("Anna", ANNA)
    people.add("Ben", BEN)
    (people.folder / "Anna/001.png").unlink()
    told = list[PeopleError]()
    assert list(people.portraits(told.append)) == ["Ben"]
    assert [str(error) for error in told] == ["Anna: 2 pictures are too few: at least 3 are needed"]


# --- names ---------------------------------------------------------------------------------------------------------

NO_NAMES = ["", "  ", ".", "..", "a/b", "unknown", "UNKNOWN", ".hidden", "x" * 61, "a\nb", "-rf", "2nd", "'x", "a\0b",
            "a:b", "a\u202eb", "\u0301", "\u200da"]  # fmt: skip
NAMES = ["Anna", "Anne-Marie", "Li Wei", "Jos\u00e9", "Ben_2", "\u00c4", "O'Brien", "O\u2019Brien", "J. R.",
         "\u0905\u092e\u093f\u0924", "\u05d3\u05b8\u05bc\u05d5\u05b4\u05d3", "\u0645\u062d\u0645\u0651\u062f",
         "\u0639\u0644\u06cc\u200c\u0631\u0636\u0627", "\u674e\u4f1f", "x" * 60]  # fmt: skip


@pytest.mark.parametrize("name", NO_NAMES)
def test_invalid_person_name_is_refused(people: People, name: str) -> None:
    with pytest.raises(PeopleError) as refused:
        people.add(name, ANNA)
    assert refused.value.hint
    assert not people.folder.exists()


@pytest.mark.parametrize("name", NAMES)
def test_names_of_people_are_names(people: People, name: str) -> None:
    proper = proper_name(f" {name} ")
    assert proper_name(proper) == proper
    people.add(name, ANNA)
    assert [each.name for each in people.known_people()] == [people.find(name)] == [proper]
    assert people.remove(name) == 3


@given(st.text(max_size=70))
def test_proper_name_stays_within_the_folder_and_is_not_hidden(name: str) -> None:
    try:
        found = proper_name(name)
    except PeopleError:
        return
    assert Path(found).name == found
    assert not found.startswith((".", "-"))
    assert len(os.fsencode(found)) <= 255


def test_person_names_are_normalised(people: People) -> None:
    people.add("Jose\u0301", ANNA)
    assert people.find(" JOS\u00c9") == "Jos\u00e9"
    people.add("\u0639\u0644\u06cc\u200c\u0631\u0636\u0627", BEN)
    assert people.find("\u0639\u0644\u06cc\u0631\u0636\u0627") is not None


def test_many_pictures_are_sampled_evenly(tmp_path: Path) -> None:
    people, told = People(tmp_path), list[PeopleError]()
    people.add("Anna", [taken(number, 4) for number in range(150)])
    people.add("Ben", [taken(1000 + number, 4) for number in range(3)])
    found = people.portraits(told.append)
    assert (len(found["Anna"]), len(found["Ben"])) == (MAX_PICTURES, 3)
    assert np.array_equal(found["Anna"][0], taken(0, 4))
    assert np.array_equal(found["Anna"][-1], taken((MAX_PICTURES - 1) * 150 // MAX_PICTURES, 4))
    assert [str(each) for each in told] == [f"Anna: {MAX_PICTURES} of 150 pictures are used, spread over all of them"]
    assert [each.pictures for each in people.known_people()] == [150, 3]


def test_many_people_share_the_limit_and_the_rest_are_reported(tmp_path: Path) -> None:
    people, told = People(tmp_path), list[PeopleError]()
    data = cv2.imencode(".png", taken(0, 4))[1].tobytes()
    for number in range(MAX_PICTURES_TOGETHER // MIN_PICTURES + 2):
        (tmp_path / f"P{number:03}").mkdir()
        for picture in range(5):
            (tmp_path / f"P{number:03}/{picture:03}.png").write_bytes(data)
    found = people.portraits(told.append)
    assert sum(map(len, found.values())) == MAX_PICTURES_TOGETHER
    assert "2 people are left out, P080 to P081: there is room for 80" in [str(each) for each in told]
