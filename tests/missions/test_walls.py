"""The walls between the packages: what is not named as allowed is refused, by `make check`."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

HOUSE = Path(__file__).parents[2]


def test_a_behaviour_that_imports_a_module_of_drivers_that_is_not_for_it_is_refused(tmp_path: Path) -> None:
    for package in ("missions", "behaviours", "drivers", "perception", "config"):
        code = shutil.ignore_patterns("__pycache__", "*.yaml", "*.css", "*.js", "*.json")
        shutil.copytree(HOUSE / package, tmp_path / package, ignore=code)
    shutil.copy(HOUSE / "pyproject.toml", tmp_path)
    with (tmp_path / "behaviours" / "base.py").open("a", encoding="utf-8") as file:
        file.write("\nimport drivers.link\n")
    lint = Path(sys.executable).parent / "lint-imports"
    outcome = subprocess.run(
        [lint, "--no-cache"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert outcome.returncode == 1, outcome.stdout + outcome.stderr
    assert "behaviours.base -> drivers.link" in outcome.stdout
    assert " kept, 1 broken." in outcome.stdout
