"""Which extra of MissionTree a hint suggests."""

import pytest

from drivers import extras
from drivers.extras import extra_hint


def test_an_extra_that_lacks_a_part_is_suggested(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "lacking", lambda names: list(names)[:1])
    assert extra_hint("speak", "aplay -l") == "pip install 'missiontree[speak]'; aplay -l"
    assert extra_hint("speak") == "pip install 'missiontree[speak]'"


def test_an_installed_extra_is_not_suggested(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "lacking", lambda _: [])
    assert extra_hint("speak", "aplay -l", "", "alsamixer") == "aplay -l; alsamixer"
    assert extra_hint("speak") == ""
