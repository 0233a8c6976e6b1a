"""The wheel in Pyodide, Python for browsers: no threads, processes or sockets, and only pure Python."""

import shutil
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path
from zipfile import ZipFile

import pytest

from tests.commands_in_turn import code_of, parsed

PYODIDE = Path(sys.prefix) / "pyodide" / "node_modules" / "pyodide"
"""Where the Makefile installs it."""

PURE = ("click", "py-trees", "pydot", "pyparsing", "pyyaml", "rich")
"""Distributions that the wheel needs there; their compiled parts, which are optional, stay behind."""

COMMANDS = [
    ("check", "greet", "wander"),
    ("show", "greet"),
    ("verify", "greet", "--robot", "turtlebot2_arm"),
    ("run", "greet", "--robot", "turtlebot2_arm", "--simulate", "fast", "--eyes", "truth"),
    ("run", "wander", "--robot", "pi_car", "--simulate", "fast", "--eyes", "truth", "--until", "5 s"),
]


def node() -> str:
    """Return where node is; skip the test where it, or Pyodide, is missing."""
    found = shutil.which("node")
    if found is None:
        pytest.skip("no node here: apt-get install npm, or .ci/run, which installs it")
    if not (PYODIDE / "pyodide.mjs").exists():
        pytest.skip("no Pyodide here: `make test` installs it by npm, if there is a network")
    return found


def unpack(wheel: Path, folder: Path) -> None:
    """Unpack the wheel, and beside it what it needs."""
    with ZipFile(wheel) as archive:
        archive.extractall(folder)
    for name in PURE:
        for file in distribution(name).files or ():
            if file.suffix == ".py":
                target = folder / file
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(str(file.locate()), target)


@pytest.mark.long
def test_a_mission_is_checked_shown_verified_and_simulated_in_python_for_browsers(tmp_path: Path) -> None:
    program = node()
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=Path(__file__).parents[2], check=True, capture_output=True)
    unpack(next(tmp_path.glob("*.whl")), tmp_path / "modules")
    done = subprocess.run(
        [program, str(Path(__file__).parents[1] / "pyodide.mjs"), str(PYODIDE), str(tmp_path / "modules")],
        input=code_of(COMMANDS),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for words, one in zip(COMMANDS, parsed(done.stdout), strict=True):
        assert one.code == (130 if "--until" in words else 0), one.said
        assert one.started == []
        if words[:2] == ("run", "greet"):  # as in this Python
            assert one.said.splitlines()[-1] == "✓ greet: success after 9.5 s"
