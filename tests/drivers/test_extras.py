"""Which extra of MissionTree a hint suggests."""

from importlib import metadata
from pathlib import Path

import pytest

from drivers import extras
from drivers.extras import extra_hint


def test_extra_hint_suggests_the_incomplete_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "missing_distributions", lambda names: list(names)[:1])
    assert extra_hint("speak", "aplay -l") == "pip install 'missiontree[speak]'; aplay -l"
    assert extra_hint("speak") == "pip install 'missiontree[speak]'"


def test_an_installed_extra_is_not_suggested(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "missing_distributions", lambda _: [])
    assert extra_hint("speak", "aplay -l", "", "alsamixer") == "aplay -l; alsamixer"
    assert extra_hint("speak") == ""


def test_installed_distributions_match_the_standard_library() -> None:
    named = {dist.metadata["Name"]: dist.version for dist in metadata.distributions()}
    assert {extras._normalized(name) for name in named} <= extras.installed_distributions().keys()
    assert extras._requirements() == metadata.requires("missiontree")


def test_missing_metadata_means_no_requirements(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("sys.path", [str(tmp_path / "missing"), str(tmp_path)])
    assert not extras.extras()
    (tmp_path / "missiontree-1.0.dist-info").mkdir()
    assert not extras.extras()
    assert extras.missing_distributions(["missiontree", "mcap"]) == ["mcap"]
