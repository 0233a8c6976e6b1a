"""The file of defaults: what it may say, how names are found by it, and that one line of it can be changed."""

from pathlib import Path

import pytest

from config.defaults import config_folder, load_defaults, set_default, unreadable_folders, user_files
from config.diagnostics import InvalidFileError
from config.library import UnknownNameError, find_file
from tests.missions.command import command


def write(text: str) -> Path:
    path = config_folder() / "defaults.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("text", [None, "", "# nothing yet\n"])
def test_empty_defaults_file_gives_no_defaults(text: str | None) -> None:
    if text is not None:
        write(text)
    found = load_defaults()
    assert (found.robot, found.world, found.folders) == ("", "", ())


def test_defaults_fault_is_reported_with_its_line() -> None:
    write("robot: humanoid\nwrold: living_room\n")
    with pytest.raises(InvalidFileError, match=r"defaults\.yaml:2:1.*wrold"):
        load_defaults()


def test_one_default_is_written_and_the_rest_of_the_file_stays() -> None:
    path = set_default("robot", "humanoid")
    assert path.read_text().endswith("robot: humanoid\n")
    path.write_text(path.read_text() + "world: square_arena  # for laps\n")
    set_default("robot", "turtlebot2")
    assert path.read_text().endswith("robot: turtlebot2\nworld: square_arena  # for laps\n")
    assert load_defaults().robot == "turtlebot2"


def test_user_files_are_found_by_name_and_never_shadow_shipped_ones(tmp_path: Path) -> None:
    write(f"folders: [{tmp_path}]\n")
    for folder, name in ((config_folder(), "rosie"), (tmp_path, "rosie"), (tmp_path, "kit"), (tmp_path, "humanoid")):
        (folder / "robots").mkdir(parents=True, exist_ok=True)
        (folder / "robots" / f"{name}.yaml").write_text(f"robot: {name}\n")
    assert find_file("robots", "rosie") == config_folder() / "robots/rosie.yaml"
    assert find_file("robots", "kit") == tmp_path / "robots/kit.yaml"
    assert find_file("robots", "humanoid").parent.parent.name == "config"
    assert set(user_files("robots")) == {"rosie", "kit", "humanoid"}
    assert user_files("worlds") == {}


def test_robot_mine_is_the_default_robot_or_gives_a_hint() -> None:
    with pytest.raises(UnknownNameError, match="mission robot use NAME"):
        find_file("robots", "mine")
    set_default("robot", "humanoid")
    assert find_file("robots", "mine").stem == "humanoid"


def test_unreadable_folder_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    config_folder().mkdir(parents=True, exist_ok=True)
    (config_folder() / "robots").write_text("no folder")
    told = f"{config_folder() / 'robots'} cannot be read: Not a directory"
    assert (user_files("robots"), unreadable_folders("robots")) == ({}, [told])
    assert unreadable_folders("worlds") == []
    listed = command(capsys, "list", "robots")
    assert listed.code == 0
    assert listed.err == f"mission: {told}\n"
    refused = command(capsys, "check", "greet", "--robot", "rosie")
    assert refused.code == 2
    assert told in refused.err
