"""The walls between the packages: what is not named as allowed is refused, by `make check`."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

HOUSE = Path(__file__).parents[2]


def test_import_linter_names_forbidden_imports(tmp_path: Path) -> None:
    wrong = {
        "behaviours/base.py": "drivers.transport.link",  # a leaf sees parts, and no lines
        "drivers/api/kinds.py": "drivers.table",  # what is declared loads no driver
        "drivers/servos/wire2.py": "drivers.transport.loop",  # a wire is bytes and values
        "drivers/rplidar/nodes.py": "drivers.rplidar.make",
        "perception/crops.py": "tests",  # what ships runs without them
    }
    for package in ("missions", "behaviours", "drivers", "perception", "config"):
        code = shutil.ignore_patterns("__pycache__", "*.yaml", "*.css", "*.js", "*.json")
        shutil.copytree(HOUSE / package, tmp_path / package, ignore=code)
    shutil.copy(HOUSE / "pyproject.toml", tmp_path)
    for name, imported in wrong.items():
        with (tmp_path / name).open("a", encoding="utf-8") as file:
            file.write(f"\nimport {imported}\n")
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
    for name, imported in wrong.items():
        assert f"{name.removesuffix('.py').replace('/', '.')} -> {imported}" in outcome.stdout
    assert " kept, 4 broken." in outcome.stdout
