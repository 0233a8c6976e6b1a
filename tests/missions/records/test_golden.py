"""What former versions have decided, this one decides too; or it is written down that it is meant otherwise."""

from pathlib import Path

import pytest

from missions.request import RunRequest
from tests.missions.records.golden import FOLDER, MISSIONS, decided_again, keep

RECORDS = sorted(FOLDER.glob("*.mcap"))

ROOM = 2_200_000
"""Bytes that all of them may take."""


def test_golden_records_exist_for_ten_missions_and_are_small() -> None:
    assert {path.stem for path in RECORDS} == set(MISSIONS)
    assert len(MISSIONS) == 10
    assert sum(path.stat().st_size for path in RECORDS) < ROOM


@pytest.mark.parametrize("path", RECORDS, ids=lambda path: path.stem)
def test_golden_records_are_decided_alike(path: Path) -> None:
    other = "\n".join(decided_again(path))
    assert not other, f'{other}\nif that is meant: make golden BECAUSE="..."'


def test_golden_check_finds_a_changed_mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "motions-back_and_forth.mcap"
    keep(path.stem, path)
    assert decided_again(path) == []
    other = RunRequest("motions/forward")
    monkeypatch.setitem(MISSIONS, path.stem, other)
    assert any("first difference" in line or "not the same commands" in line for line in decided_again(path))
