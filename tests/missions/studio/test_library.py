"""The list of what there is to run: the user's own files first, and another edition once one of them changes."""

import os
import socket
from contextlib import suppress
from pathlib import Path
from threading import Event

import pytest

from config.defaults import config_folder
from missions.control.commands import BadMessage
from missions.library.folders import checkup_file
from missions.plugins.studio import library
from missions.plugins.studio.library import TimeLimitError, load_with_behaviours
from missions.plugins.studio.studio_commands import LibraryQuery, MissionQuery
from tests.cases import each

SAYS = "mission: {}\ntree:\n  say: Hello\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def entries(kind: str = "missions") -> dict[str, dict[str, object]]:
    found = library.answer_library(LibraryQuery())[kind]
    assert isinstance(found, list)
    return {entry["name"]: entry for entry in found}


def edition() -> str:
    return str(library.answer_library(LibraryQuery())["edition"])


def test_own_missions_come_first_under_their_names(here: Path) -> None:
    write(here / "zzz one.yaml", SAYS.format("'my dance' # the best"))
    write(here / "broken.yaml", "mission: broken_dance\ntree:\n  sya: Hello\n")
    write(config_folder() / "missions" / "evening.yaml", SAYS.format("good_night"))
    found = entries()
    assert [(each["name"], each["title"]) for each in list(found.values())[:3]] == [
        ("broken.yaml", "broken_dance"), ("zzz one.yaml", "my dance"), ("evening", "good_night"),
    ]  # fmt: skip
    assert "\n" in str(found["broken.yaml"]["trouble"])
    assert [name for name, each in found.items() if each.get("own")] == ["broken.yaml", "zzz one.yaml", "evening"]


def test_own_robots_and_worlds_of_the_users_folders_are_offered(here: Path) -> None:
    shipped = Path(library.__file__).parents[3] / "config"
    robot = (shipped / "robots" / "turtlebot2.yaml").read_text(encoding="utf-8")
    world = next((shipped / "worlds").glob("*.yaml"))
    write(config_folder() / "robots" / "homebot.yaml", robot)
    write(config_folder() / "defaults.yaml", f"folders: [{here / 'mine'}]\n")
    write(here / "mine" / "worlds" / "my_room.yaml", world.read_text(encoding="utf-8"))
    assert next(iter(entries("robots"))) == "homebot"
    assert next(iter(entries("worlds"))) == "my_room"
    assert library.check_name("robots", "homebot") == "homebot"


@pytest.mark.usefixtures("here")
def test_own_file_with_a_shipped_name_is_listed_by_its_path() -> None:
    path = write(config_folder() / "missions" / "greet.yaml", SAYS.format("my_greet"))
    found = entries()
    assert found[str(path)]["title"] == "my_greet"
    assert "own" not in found["greet"]
    assert library.answer_mission(MissionQuery(name=str(path)))["title"] == "my_greet"


@each("change", ["added", "changed", "removed", "leaves beside it", "a part in a folder", "the check-up"])
def test_changed_file_changes_the_library_edition(here: Path, change: str) -> None:
    one = write(here / "one.yaml", SAYS.format("one"))
    leaves = write(here / "behaviours" / "mine.py", "")
    part = write(here / "parts" / "part.yaml", SAYS.format("part"))
    before = edition()
    assert library.answer_library(LibraryQuery(edition=before)) == {"edition": before}
    match change:
        case "added":
            write(here / "two.yaml", SAYS.format("two"))
        case "changed":
            write(one, SAYS.format("one").replace("Hello", "Hullo"))
            os.utime(one, (1.0, 1.0))
        case "removed":
            one.unlink()
        case "leaves beside it":
            write(leaves, "X = 1\n")
        case "a part in a folder":
            write(part, SAYS.format("part") + "\n")
        case _:
            write(checkup_file(), "{}")
    assert edition() != before


def test_mission_is_checked_again_when_its_submission_changes(here: Path) -> None:
    write(here / "whole.yaml", "mission: whole\ntree:\n  mission: part.yaml\n")
    part = write(here / "part.yaml", SAYS.format("part"))
    assert "trouble" not in entries()["whole.yaml"]
    write(part, "mission: part\ntree:\n  sya: Hello there\n")
    assert "sya" in str(entries()["whole.yaml"]["trouble"])


def test_broken_defaults_and_missing_folder_hide_no_shipped_mission(here: Path) -> None:
    write(config_folder() / "defaults.yaml", "robt: x\n")
    assert "robt" in str(library.answer_library(LibraryQuery())["trouble"])
    assert "greet" in entries()
    here.rename(here.with_name("gone"))
    here.with_name("gone").rename(here)
    assert library.check_name("missions", "greet") == "greet"


def test_no_name_leads_elsewhere(here: Path) -> None:
    write(here / "inner" / "hidden.yaml", SAYS.format("hidden"))
    for name in ("inner/hidden.yaml", str(here / "inner" / "hidden.yaml"), "../x.yaml"):
        with pytest.raises(BadMessage, match="there is no mission"):
            library.check_name("missions", name)


# --- files of which each may fail alone -------------------------------------------------------------------------------


def test_slow_file_is_reported_and_hides_no_other(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("first", "slow", "third"):
        write(here / f"{name}.yaml", SAYS.format(name))
    monkeypatch.setattr(library, "FILE_TIMEOUT", 0.2)
    loaded = list[str]()

    def endless(name: str) -> object:
        loaded.append(name)
        while name == "slow.yaml":
            with suppress(Exception):  # what handles all errors ends all the same
                Event().wait(0.01)
        return load_with_behaviours(name)

    monkeypatch.setattr(library, "load_with_behaviours", endless)
    found = entries()
    assert str(found["slow.yaml"]["trouble"]).startswith("it takes more than 0.2 s to read\n  try: mission check slow")
    assert found["slow.yaml"]["title"] == "slow"
    assert [name for name in ("first.yaml", "third.yaml", "greet") if "trouble" in found[name]] == []
    assert entries() == found
    assert loaded.count("slow.yaml") == 1  # until a file changes


def test_shipped_mission_that_timed_out_is_read_again(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(here / "own.yaml", SAYS.format("own"))
    monkeypatch.setattr(library, "_entries", {})

    def busy(name: str) -> object:
        if name == "greet":
            raise TimeLimitError
        return load_with_behaviours(name)

    with monkeypatch.context() as patch:
        patch.setattr(library, "load_with_behaviours", busy)
        before = edition()
        assert "takes more than" in str(entries()["greet"]["trouble"])
    assert edition() != before
    assert "trouble" not in entries()["greet"]


def test_list_that_timed_out_continues_later(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("first", "third"):
        write(here / f"{name}.yaml", SAYS.format(name))
    with monkeypatch.context() as patch:
        patch.setattr(library, "LIST_TIMEOUT", 0.0)
        cut = edition()
        cut_short = entries()
        assert {cut_short[f"{name}.yaml"]["trouble"] for name in ("first", "third")} == {
            "not read yet; other files take long"
        }
    assert edition() != cut
    assert not any("unread" in each for each in entries().values())


@pytest.mark.parametrize("error", [RecursionError("deep"), MemoryError(), OSError(5, "no disk"), ValueError("odd")])
def test_error_of_one_file_does_not_affect_others(
    here: Path, error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(here / "odd.yaml", SAYS.format("odd"))

    def odd(name: str) -> object:
        if name == "odd.yaml":
            raise error
        return load_with_behaviours(name)

    monkeypatch.setattr(library, "load_with_behaviours", odd)
    found = entries()
    assert str(found["odd.yaml"]["trouble"]).startswith(f"it cannot be read: {type(error).__name__}")
    assert "trouble" not in found["greet"]


@pytest.mark.parametrize("kind", ["fifo", "socket", "folder", "dangling", "loop", "device", "huge", "binary"])
def test_odd_file_hides_no_mission(here: Path, kind: str) -> None:
    path = here / "odd.yaml"
    match kind:
        case "fifo":
            os.mkfifo(path)
        case "socket":
            with socket.socket(socket.AF_UNIX) as made:
                made.bind(str(path))
        case "folder":
            path.mkdir()
        case "dangling":
            path.symlink_to("nowhere.yaml")
        case "loop":
            path.symlink_to("odd.yaml")
        case "device":
            path.symlink_to("/dev/zero")
        case "huge":
            write(path, "mission: huge\n" + "#" * 2_000_000)
        case "binary":
            path.write_bytes(b"mission: odd\n\xff\x00\xfe")
    write(here / "good.yaml", SAYS.format("good"))
    found = entries()
    assert "trouble" not in found["good.yaml"]
    assert "trouble" in found.get("odd.yaml", {"trouble": "it is no file"})
