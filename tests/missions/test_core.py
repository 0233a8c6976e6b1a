"""The core alone: it checks, runs and stops without `missions/plugins`; a start imports only what it asks for."""

import ast
import json
import os
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from missions.cli.commands import COMMANDS
from missions.plugins import PLUGINS
from tests.waiting import wait_until

ROOT = Path(__file__).parents[2]
PACKAGES = ("missions", "behaviours", "drivers", "perception", "config")


class Core:
    """A copy of MissionTree, with folders of its own for runs and settings."""

    def __init__(self, folder: Path, *, plugins: bool) -> None:
        self.folder = folder
        left_out = shutil.ignore_patterns("__pycache__", *(() if plugins else ("plugins",)))
        for package in PACKAGES:
            shutil.copytree(ROOT / package, folder / "code" / package, ignore=left_out)
        own = ("XDG_RUNTIME_DIR", "XDG_STATE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "MISSION_SYSTEM_ROOT")
        self.environment = {**os.environ, **dict.fromkeys(own, str(folder)), "PYTHONPATH": str(folder / "code")}

    def start(self, *arguments: str) -> "subprocess.Popen[str]":
        """Start a command in the copy."""
        return subprocess.Popen(
            [sys.executable, "-m", "missions", *arguments],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *arguments: str) -> tuple[int, str, str]:
        """Run a command to its end; return its exit code, output and errors."""
        process = self.start(*arguments)
        out, err = process.communicate()
        return process.returncode, out, err


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Core:
    return Core(tmp_path_factory.mktemp("core"), plugins=False)


def test_core_has_only_its_own_commands(core: Core) -> None:
    code, out, err = core.run("--help")
    assert (code, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines() if line.startswith("  ") and line.split()[0] in COMMANDS]
    assert "studio" not in out
    code, _, err = core.run("record", "list")
    assert (code, "no such command: 'record'" in err) == (2, True)
    code, _, err = core.run("run", "greet", "--record", "a.mcap")
    assert (code, "--record" in err) == (2, True)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("check", "greet"), "greet: good (greet,"),
        (("check", "greet", "--robot", "turtlebot2_arm"), "greet: good"),
        (("show", "greet"), "gesture"),
        (("show", "greet", "--format", "json"), '"kind"'),
        (("list",), "turtlebot2_arm"),
        (("run", "greet", "--simulate", "fast", "--eyes", "truth"), "greet: success"),
        (("run", "greet", "--simulate", "fast"), "greet: success"),
        (("run", "1", "--simulate", "fast", "--eyes", "truth"), "forward: success"),
        (("run", "greet", "--simulate", "fast", "--events", "events.jsonl"), "greet: success"),
        (("stop",), "no mission is running"),
    ],
    ids=" ".join,
)
def test_the_core_works_without_plug_ins(core: Core, arguments: Sequence[str], said: str) -> None:
    code, out, err = core.run(*arguments)
    assert code == 0, err
    assert said in out


@pytest.mark.parametrize(
    ("arguments", "needs"),
    [
        (("show", "greet", "--diff", "wander"), "the plug-in 'pictures'"),
        (("show", "world", "empty"), "the plug-in 'pictures'"),
        (("show", "gait", "stroll"), "the plug-in 'legs'"),
        (("show", "greet", "-o", "a.svg"), "unknown format; known:"),
    ],
    ids=lambda each: " ".join(each) if isinstance(each, tuple) else "",
)
def test_core_names_the_missing_plugin(core: Core, arguments: Sequence[str], needs: str) -> None:
    code, _, err = core.run(*arguments)
    assert code == 2
    assert needs in err


def test_python_runs_a_mission_with_the_core_alone(core: Core) -> None:
    code = "import missions; print(missions.run('greet', simulate='fast', eyes='truth').result)"
    run = [sys.executable, "-c", code]
    done = subprocess.run(run, env=core.environment, capture_output=True, text=True, check=False)
    assert done.stdout == "success\n", done.stderr


@pytest.fixture
def watched() -> Iterator[list["subprocess.Popen[str]"]]:
    started: list[subprocess.Popen[str]] = []
    yield started
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.real_time
@pytest.mark.parametrize("simulate", [("--simulate", "wire"), ("--simulate", "fast", "--speed", "1")], ids=" ".join)
def test_the_core_stops_a_run(core: Core, watched: list["subprocess.Popen[str]"], simulate: Sequence[str]) -> None:
    events = core.folder / f"{simulate[1]}.jsonl"
    process = core.start("run", "wander", *simulate, "--eyes" if "fast" in simulate else "--seed",
                         "truth" if "fast" in simulate else "1", "--events", str(events))  # fmt: skip
    watched.append(process)
    wait_until(lambda: events.exists() and '"to": "base"' in events.read_text(encoding="utf-8"))
    code, out, err = core.run("stop", str(process.pid))
    assert (code, err) == (0, ""), out
    assert "stopped" in out
    code, out, _ = core.run("stop", "--end", str(process.pid))
    assert code == 0, out
    process.communicate(timeout=30)
    assert process.returncode == 130
    told = [json.loads(line) for line in events.read_text(encoding="utf-8").splitlines()]
    assert told[-1]["result"] == "interrupted"


@pytest.mark.real_time
def test_ctrl_c_ends_a_run_of_the_core(core: Core, watched: list["subprocess.Popen[str]"]) -> None:
    events = core.folder / "interrupted.jsonl"
    process = core.start("run", "greet", "--simulate", "wire", "--events", str(events))
    watched.append(process)
    wait_until(lambda: events.exists() and '"tick"' in events.read_text(encoding="utf-8"))
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode == 130


LIST_MODULES = """
import atexit, sys
atexit.register(lambda: open(PATH, "w").write("\\n".join(sys.modules)))
from missions.__main__ import main
sys.argv = ["mission", *ARGUMENTS]
main()
"""


def modules_of(folder: Path, *arguments: str) -> set[str]:
    """Run a command, and return the modules that it imported."""
    listed = folder / "modules"
    code = LIST_MODULES.replace("PATH", repr(str(listed))).replace("ARGUMENTS", repr(arguments))
    own = ("XDG_RUNTIME_DIR", "XDG_STATE_HOME", "XDG_CONFIG_HOME", "MISSION_SYSTEM_ROOT")
    environment = {**os.environ, **dict.fromkeys(own, str(folder))}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert done.returncode == 0, done.stderr
    return set(listed.read_text().splitlines())


def plugins_among(modules: set[str]) -> set[str]:
    """Return the plug-ins of which more than their options was imported."""
    light = {"missions.plugins", *(plugin.run_options.partition(":")[0] for plugin in PLUGINS if plugin.run_options)}
    light |= {name.rpartition(".")[0] for name in light}
    return {name.split(".")[2] for name in modules - light if name.startswith("missions.plugins.")}


@pytest.mark.parametrize(
    ("arguments", "asked"),
    [
        (("--help",), set()),
        (("run", "--help"), set()),
        (("check", "greet"), set()),
        (("show", "behaviour", "say"), {"pictures"}),
        (("stop",), set()),
        (("list", "robots"), set()),
        (("run", "greet", "--simulate", "fast", "--eyes", "truth"), set()),
        (("run", "1", "--robot", "turtlebot2", "--simulate", "fast", "--eyes", "truth"), set()),
        (("run", "1", "--robot", "turtlebot2", "--simulate", "wire"), set()),
        (("run", "greet", "--simulate", "fast", "--eyes", "truth", "--record", "RECORD"), {"records", "pictures"}),
        (("run", "greet", "--simulate", "fast", "--no-record"), set()),
        (("check", str(ROOT / "missions" / "greet.test.yaml")), {"testing"}),
    ],
    ids=lambda each: " ".join(each) if isinstance(each, tuple) else "",
)
def test_start_imports_only_the_plugins_in_use(tmp_path: Path, arguments: Sequence[str], asked: set[str]) -> None:
    modules = modules_of(tmp_path, *(str(tmp_path / "a.mcap") if each == "RECORD" else each for each in arguments))
    assert plugins_among(modules) <= asked
    if "turtlebot2" in arguments:
        assert not [each for each in modules if each.startswith("drivers.legs")]
    if arguments == ("stop",):
        assert not {"missions.plugins", "missions.library.vocabulary", "py_trees"} & modules


def test_each_plugin_declares_its_dependencies() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    held = next(each for each in contracts if each["name"].startswith("a plug-in imports the core"))
    assert {name.rpartition(".")[2] for name in held["modules"]} == {plugin.name for plugin in PLUGINS}
    allowed = {tuple(part.split(".")[2] for part in line.split(" -> ")) for line in held["ignore_imports"]}
    assert allowed == {(plugin.name, need) for plugin in PLUGINS for need in plugin.needs}
    folders = {path.name for path in (ROOT / "missions" / "plugins").iterdir() if (path / "__init__.py").exists()}
    assert folders == {plugin.name for plugin in PLUGINS}


def test_the_declarations_import_nothing_but_the_interface() -> None:
    tree = ast.parse((ROOT / "missions" / "plugins" / "__init__.py").read_text())
    imported = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert imported == ["missions.plugin"]
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.Import)]
