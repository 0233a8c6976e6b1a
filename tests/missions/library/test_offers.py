"""What other distributions offer is found wherever they are installed, and costs little where nobody offers."""

import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from missions.library.import_trial import entry_points_of

GROUP = "missiontree.tests"
DECLARED = f"[{GROUP}]\nsecond = json:loads\nfirst = json:dumps\n"
ABOUT = "Metadata-Version: 2.1\nName: somebodys\nVersion: 1.0\n"


@pytest.mark.parametrize("folder", ["somebodys-1.0.dist-info", "somebodys-1.0.egg-info"])
def test_distribution_in_a_folder_offers_its_entry_points(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = tmp_path / folder
    info.mkdir()
    (info / ("METADATA" if "dist" in folder else "PKG-INFO")).write_text(ABOUT, encoding="utf-8")
    (info / "entry_points.txt").write_text(DECLARED, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    assert [point.value for point in entry_points_of(GROUP)] == ["json:dumps", "json:loads"]


def test_a_distribution_in_an_archive_does_too(tmp_path: Path) -> None:
    archive = tmp_path / "somebodys.zip"
    with ZipFile(archive, "w") as packed:
        packed.writestr("somebodys-1.0.dist-info/METADATA", ABOUT)
        packed.writestr("somebodys-1.0.dist-info/entry_points.txt", DECLARED)
    # Python keeps an archive open that was on its path: so in a process of its own.
    program = f"""
import sys
sys.path.append({str(archive)!r})
from missions.library.import_trial import entry_points_of
print(*(point.name for point in entry_points_of({GROUP!r})))
"""
    assert said(program) == ["first", "second"]


def test_unknown_entry_point_group_is_empty() -> None:
    assert not entry_points_of("missiontree.nobody")


WITHOUT = (
    "numpy",
    "cv2",
    "importlib.metadata",
    "rich",
    "serial",
    "perception.hearing.engines",
    "drivers.sound.engines",
    "missions.library.moves.sheet",
    "behaviours.wander",
)
"""What a check of a mission that greets has no use for."""


def test_check_imports_only_packages_that_the_mission_names() -> None:
    program = """
import sys
from missions.cli.root import mission
mission(["check", "greet"], standalone_mode=False)
print(*sys.modules)
"""
    imported = said(program)
    assert "behaviours.sight" in imported
    assert not {*imported} & {*WITHOUT}


def said(program: str) -> list[str]:
    """Return the words that a program of Python prints."""
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
