"""Drivers of another distribution: installed, declared, checked, simulated; and one whose declaration is broken."""

import json
import os
import re
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import jsonschema
import pytest
import yaml

from drivers.clock import SystemClock
from drivers.virtual.terminal import PseudoTerminal
from tests.drivers.desks import RecordedMachine
from tests.shared import made_once

pytestmark = pytest.mark.long

SAMPLE = Path(__file__).parents[2] / "sample_distribution"
PAGE = Path(__file__).parents[3] / "docs" / "drivers.md"
BROKEN = """
from drivers.api.driver import Driver
from drivers.api.keys import key, keys

import a_module_that_is_not_there
"""


def install(into: Path, *sources: Path) -> None:
    """Install distributions as `pip install` does, with what the environment has already."""
    quietly = ["--quiet", "--disable-pip-version-check", "--no-deps", "--no-build-isolation"]
    pip = [sys.executable, "-m", "pip", "install", *quietly, "--target", str(into)]
    subprocess.run([*pip, *map(str, sources)], check=True, capture_output=True, text=True)


@pytest.fixture(scope="session")
def site(shared: Path) -> Path:
    """MissionTree and the sample, installed beside each other, apart from this folder: once for all workers."""
    folder = shared / "site"
    with made_once(folder) as missing:
        if missing:
            install(folder, Path(__file__).parents[3], SAMPLE)
    return folder


def mission(site: Path, *arguments: str, folder: Path = SAMPLE) -> subprocess.CompletedProcess[str]:
    """Run the command of that environment."""
    environment = {**os.environ, "PYTHONPATH": str(site), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "missions", *arguments]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
    )


def test_page_code_matches_the_sample_sources() -> None:
    sources = "\n".join(path.read_text(encoding="utf-8") for path in [*SAMPLE.rglob("*.py"), SAMPLE / "pyproject.toml"])
    blocks = re.findall(r"```(?:python|toml)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 6
    for block in blocks:
        for piece in filter(None, (piece.strip("\n") for piece in re.split(r"\n{3,}", block))):
            lines = [line for line in piece.splitlines() if not line.startswith(("from ", "import "))]
            told = "\n".join(lines).strip("\n")
            assert told in sources, f"the sample has no such lines:\n{told}"


def test_outside_drivers_are_listed_with_their_package_and_in_the_schema(site: Path) -> None:
    listed = mission(site, "list", "drivers")
    assert "base.rover" in listed.stdout
    assert "A rover that talks in lines of text. (of sample-robot)" in listed.stdout
    assert "base.kobuki" in listed.stdout
    reference = mission(site, "schema", "robots", "--reference").stdout
    assert "- `driver: rover`: A rover that talks in lines of text." in reference
    assert "| `max_speed` | a speed | 0.05 m/s to 2 m/s | `0.4 m/s` | Maximum speed. |" in reference
    schema = json.loads(mission(site, "schema", "robots").stdout)
    bases = schema["properties"]["base"]["properties"]["driver"]["enum"]
    assert bases == ["kobuki", "waveshare", "pi_car", "ros2", "legs", "rover"]
    robot = yaml.safe_load((SAMPLE / "sample.yaml").read_text(encoding="utf-8"))
    validator = jsonschema.Draft7Validator(schema)
    assert validator.is_valid(robot)
    robot["base"]["horn"] = "loud"
    assert not validator.is_valid(robot)


def test_a_robot_of_theirs_is_checked_with_their_keys_and_rules(site: Path, tmp_path: Path) -> None:
    assert mission(site, "check", "greet", "square_3m", "--robot", "sample.yaml").returncode == 0
    text = (SAMPLE / "sample.yaml").read_text(encoding="utf-8")
    wrong = (
        text.replace("1.5 m/s", "3 m/s")
        .replace("turned_by: mast", "turned_by: must")
        .replace("rover\n", "rover\n  hron: false\n", 1)
    )
    (tmp_path / "wrong.yaml").write_text(wrong, encoding="utf-8")
    told = mission(site, "check", "greet", "--robot", "wrong.yaml", folder=tmp_path)
    assert told.returncode == 2
    assert re.search(r"wrong\.yaml:\d+:\d+: 'max_speed' must be at most 2 m/s", told.stderr)
    assert re.search(r"wrong\.yaml:\d+:\d+: 'base' has no key 'hron'", told.stderr)
    assert "did you mean 'horn'?" in told.stderr
    assert re.search(r"wrong\.yaml:\d+:\d+: 'turned_by': the arm has no joint 'must'", told.stderr)
    assert "did you mean 'mast'?" in told.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("square_3m", "--simulate", "fast", "--world", "square_arena"),
        ("greet", "--simulate", "fast", "--eyes", "truth"),
    ],
    ids=["square-fast", "greet-fast"],
)
def test_outside_driver_runs_in_simulated_time(site: Path, arguments: tuple[str, ...]) -> None:
    ran = mission(site, "run", *arguments, "--robot", "sample.yaml", "--json")
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout.splitlines()[-1])["result"] == "success"


@pytest.mark.real_time
@pytest.mark.parametrize("name", ["square_3m", "greet"])
@pytest.mark.timeout(300)
def test_outside_driver_runs_down_to_the_wire(site: Path, name: str) -> None:
    here = ("--world", "square_arena", "--param", "side=20 cm") if name == "square_3m" else ()
    ran = mission(site, "run", name, "--robot", "sample.yaml", "--simulate", "wire", *here, "--json")
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout.splitlines()[-1])["result"] == "success"


class Reporting:
    """What the rover says on its wire, at rest."""

    baud = 38_400

    def feed(self, data: bytes, now: float) -> bytes:
        assert not data, "it is asked for nothing"
        return self.poll(now)

    def poll(self, now: float) -> bytes:
        del now
        return b"o 0 0 0 0 0\n"


@pytest.mark.real_time
def test_outside_driver_is_recognised_on_a_port(site: Path, tmp_path: Path) -> None:
    desk = RecordedMachine(tmp_path / "machine")
    with closing(PseudoTerminal("rover", Reporting(), SystemClock())) as terminal:
        terminal.open()
        desk.port("ttyUSB0", "0403:6015", serial="R1", behind=terminal.path)
        told = mission(site, "ports", "--root", str(desk.root), "--json")
    (port,) = json.loads(told.stdout)["ports"]
    assert port["answers"] == {"driver": "base.rover", "about": "a rover", "keys": {"baud": 38_400}, "units": []}


@pytest.mark.real_time
def test_outside_driver_is_checked_by_its_own_doctor(site: Path, tmp_path: Path) -> None:
    desk = RecordedMachine(tmp_path / "machine")
    with closing(PseudoTerminal("rover", Reporting(), SystemClock())) as terminal:
        terminal.open()
        desk.port("ttyUSB0", "0403:6015", serial="R1", behind=terminal.path)
        asked = ("--robot", "sample.yaml", "--port", "base=/dev/ttyUSB0", "--root", str(desk.root), "--json")
        told = mission(site, "doctor", *asked)
    found = {(each["part"], each["about"]): each for each in json.loads(told.stdout)["findings"]}
    assert found["base", "reports"]["verdict"] == "ok"
    assert found["base", "reports"]["message"].endswith(" a second")


def test_broken_declaration_is_reported_in_one_line_and_affects_no_other(site: Path, tmp_path: Path) -> None:
    """Everything else goes on; who names the broken driver is told whose it is, and what is wrong."""
    package = tmp_path / "site"
    (package / "broken_robot").mkdir(parents=True)
    (package / "broken_robot" / "__init__.py").write_text("")
    (package / "broken_robot" / "declared.py").write_text(BROKEN)
    information = package / "broken_robot-0.1.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: broken-robot\nVersion: 0.1\n")
    (information / "entry_points.txt").write_text(
        "[missiontree.drivers]\nbase.wreck = broken_robot.declared:WRECK\nbase.other = json:dumps\n"
    )
    both = f"{site}{os.pathsep}{package}"
    (tmp_path / "wreck.yaml").write_text("robot: wreck\nbase: {driver: wreck, port: /dev/wreck}\n")
    told = mission(Path(both), "check", "square_3m", "--robot", "wreck.yaml", folder=tmp_path)
    assert told.returncode == 2
    assert told.stderr.count("'driver: wreck' cannot be used") == 1
    assert "base.wreck = broken_robot.declared:WRECK of broken-robot cannot be imported" in told.stderr
    assert "No module named 'a_module_that_is_not_there'" in told.stderr
    assert "Traceback" not in told.stderr
    listed = mission(Path(both), "list", "drivers")
    assert listed.returncode == 0
    assert "base.other = json:dumps of broken-robot is <function dumps at" in listed.stdout
    assert ", not a drivers.api.driver.Driver" in listed.stdout
    assert "base.rover" in listed.stdout
    assert mission(Path(both), "check", "square_3m", "--robot", str(SAMPLE / "sample.yaml")).returncode == 0
