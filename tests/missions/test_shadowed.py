"""Another module in the place of one of ours: the command names it, and what helps."""

import os
import subprocess
import sys
from pathlib import Path

MISSION = (sys.executable, "-m", "missions", "--version")


def said(folder: Path, *, path: Path | None = None) -> list[str]:
    """Return what the command says in ``folder``, with ``path`` as the PYTHONPATH."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if path is not None:
        environment["PYTHONPATH"] = str(path)
    done = subprocess.run(MISSION, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return done.stderr.splitlines()


def test_shadowing_distribution_suggests_pip_uninstall(tmp_path: Path) -> None:
    site, home = tmp_path / "site", tmp_path / "home"
    home.mkdir()
    (site / "config").mkdir(parents=True)
    (site / "config" / "__init__.py").write_text("")
    (site / "config-0.5.1.dist-info").mkdir()
    (site / "config-0.5.1.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: config\nVersion: 0.5.1\n")
    (site / "config-0.5.1.dist-info" / "RECORD").write_text("config/__init__.py,,\n")
    assert said(home, path=site) == [
        "mission: another module shadows a package of MissionTree:",
        f"  config: found {site / 'config' / '__init__.py'}",
        f"  try: {sys.executable} -m pip uninstall config",
    ]


def test_shadowing_module_in_the_folder_or_pythonpath_gives_a_hint(tmp_path: Path) -> None:
    home, other = tmp_path / "home", tmp_path / "other"
    for folder in (home, other):
        folder.mkdir()
        (folder / "drivers.py").write_text("")
    assert said(home)[-1] == f"  try: rename {home / 'drivers.py'}, or run mission in another folder"
    assert said(tmp_path, path=other)[-1] == "  try: unset PYTHONPATH"
