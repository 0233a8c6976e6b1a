"""What missions name, and what finds it."""

from pathlib import Path

import pytest

from missions.library.lookups import find_controller


def test_controller_is_cached_until_its_file_changes(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("controller: mine\nturn: {p: 1.2, d: 0.1}\n", encoding="utf-8")
    first = find_controller(str(file))
    assert find_controller(str(file)) is first
    file.write_text("controller: mine\nturn: {p: 1.5, d: 0.1}\n", encoding="utf-8")
    assert find_controller(str(file)) != first
    file.write_text("controller: mine\nturn: {p: 1.5}\n", encoding="utf-8")
    with pytest.raises(LookupError, match="turn: a PD controller needs 'd'"):
        find_controller(str(file))
