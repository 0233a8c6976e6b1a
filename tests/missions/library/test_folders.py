"""Where what is kept for the user has its folder."""

import pwd
from pathlib import Path

import pytest

from missions.library.folders import data_folder, state_folder


def test_folders_follow_the_xdg_environment() -> None:
    environment = {"XDG_DATA_HOME": "/data", "XDG_STATE_HOME": "/state"}
    assert data_folder(environment) == Path("/data/missiontree")
    assert state_folder(environment) == Path("/state/missiontree")


@pytest.mark.parametrize("home", ["", "relative"])
def test_a_user_without_a_home_has_folders_that_do_not_exist(home: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", home)
    monkeypatch.setattr(pwd, "getpwuid", {}.__getitem__)
    assert state_folder({}) == Path("/nonexistent/.local/state/missiontree")


@pytest.mark.parametrize("named", ["", "relative/folder"])
def test_relative_xdg_paths_are_ignored(named: str) -> None:
    environment = {"XDG_DATA_HOME": named, "XDG_STATE_HOME": named}
    assert data_folder(environment) == data_folder({}) == Path.home() / ".local/share/missiontree"
    assert state_folder(environment) == state_folder({}) == Path.home() / ".local/state/missiontree"
