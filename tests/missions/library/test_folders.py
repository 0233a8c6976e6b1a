"""Where what is kept for the user has its folder."""

import pwd
from pathlib import Path

import pytest

from missions.library.folders import data_folder, state_folder


def test_the_users_environment_says_where() -> None:
    environment = {"XDG_DATA_HOME": "/data", "XDG_STATE_HOME": "/state"}
    assert data_folder(environment) == Path("/data/missiontree")
    assert state_folder(environment) == Path("/state/missiontree")


@pytest.mark.parametrize("home", ["", "relative"])
def test_a_user_without_a_home_has_folders_that_do_not_exist(home: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", home)
    monkeypatch.setattr(pwd, "getpwuid", {}.__getitem__)
    assert state_folder({}) == Path("/nonexistent/.local/state/missiontree")


@pytest.mark.parametrize("named", ["", "relative/folder"])
def test_what_is_no_absolute_path_counts_as_not_set(named: str) -> None:
    environment = {"XDG_DATA_HOME": named, "XDG_STATE_HOME": named}
    assert data_folder(environment) == data_folder({}) == Path.home() / ".local/share/missiontree"
    assert state_folder(environment) == state_folder({}) == Path.home() / ".local/state/missiontree"
