"""Completion, in a true bash that was set up by the one documented command; and of what words a shell is told."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from click.shell_completion import ShellComplete

from config.defaults import config_folder
from config.library import find_file, shipped_files
from missions.cli.completion import completion_script
from missions.cli.names import BEHAVIOUR, CONTROLLER, GESTURE, MISSION, ROBOT, SHOWN_NAME, WORLD, NameType, ParamsType
from missions.cli.root import COMPLETION_VARIABLE, mission
from missions.control.holders import announce_command
from tests.missions.command import Outcome, command
from tests.missions.test_help import ALL

BASH = shutil.which("bash")

TYPED = """
. .bashrc
compopt() { :; }
typed() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=(); _mission_completion mission
  echo "${COMPREPLY[*]}"; }
"""
"""Has bash do what it does at TAB, without a terminal: call the function of ``complete`` with the words so far."""


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty home folder, which is the working directory too, with a ``mission`` in the PATH."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME", "ZDOTDIR"):
        monkeypatch.delenv(name, raising=False)
    tool, root = tmp_path / "bin" / "mission", Path(__file__).parents[2]
    tool.parent.mkdir()
    tool.write_text(
        f"#!{sys.executable}\nimport sys\nsys.path.insert(0, {str(root)!r})\n"
        "from missions.__main__ import main\nmain()\n"
    )
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", str(tool.parent), prepend=":")
    return tmp_path


@pytest.fixture
def typed(home: Path, capsys: pytest.CaptureFixture[str]) -> Callable[[str], list[str]]:
    """Return what a true bash offers for some words; the last of them is being typed, after "|" a new one begins."""
    assert command(capsys, "completion", "install", "--shell", "bash").code == 0

    def ask(*lines: str) -> list[str]:
        asked = "".join(f"typed {line}\n" for line in lines)
        assert BASH is not None
        done = subprocess.run(
            [BASH, "--norc", "-c", TYPED + asked], capture_output=True, text=True, check=True, cwd=home
        )
        assert done.stderr == ""
        return done.stdout.splitlines()

    return ask


def person(home: Path, *names: str) -> None:
    """Let this user's robots know people, by a picture each."""
    for name in names:
        folder = home / ".local/share/missiontree/people" / name
        folder.mkdir(parents=True)
        (folder / "001.png").touch()


@pytest.mark.skipif(BASH is None, reason="there is no bash")
def test_a_true_bash_completes_commands_missions_robots_gestures_params_and_people(
    home: Path, typed: Callable[..., list[str]]
) -> None:
    person(home, "Ada", "Anna Maria")
    (home / "my_tour.yaml").write_text("mission: my_tour\nparams: {pace: 1 m/s}\ntree:\n  succeed\n")
    assert typed(
        "mission stu",
        "mission run greet_",
        "mission run my",
        "mission run greet --robot = turtlebot2_",
        "mission servo play gree",
        "mission run my_tour.yaml --param p",
        "mission run take_message --param to = A",
        "mission person remove ''",
    ) == [
        "studio",
        "greet_by_name greet_by_turning greet_everybody",
        "my_tour.yaml",
        "turtlebot2_arm",
        "greeting",
        "pace=",
        "Ada 'Anna Maria'",
        "Ada 'Anna Maria'",
    ]


@pytest.mark.skipif(BASH is None, reason="there is no bash")
def test_bash_has_the_installed_completion_function(home: Path, typed: Callable[..., list[str]]) -> None:
    del typed
    assert BASH is not None
    told = subprocess.run(
        [BASH, "--norc", "-c", ". .bashrc; complete -p mission"], check=True, capture_output=True, text=True, cwd=home
    )
    assert told.stdout == "complete -o nosort -F _mission_completion mission\n"


def test_second_completion_install_adds_no_second_line(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (home / ".zshrc").write_text("alias ll='ls -l'")
    outcomes = [command(capsys, "completion", "install", "--shell", "zsh") for _ in range(2)]
    script_file = home / ".local/share/missiontree/completion.zsh"
    assert [each.out.splitlines()[-1] for each in outcomes] == [
        f"wrote {script_file}, and a line at the end of {home / '.zshrc'}",
        f"wrote {script_file}",
    ]
    assert (home / ".zshrc").read_text() == f"alias ll='ls -l'\n[ -r {script_file} ] && . {script_file}\n"


def test_completion_install_uses_the_shell_of_the_environment(
    home: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SHELL", "/usr/bin/fish")
    assert command(capsys, "completion", "install").code == 0
    assert (home / ".config/fish/completions/mission.fish").read_text() == completion_script("fish")
    monkeypatch.setenv("SHELL", "/bin/tcsh")
    outcome: Outcome = command(capsys, "completion", "install")
    assert outcome.code == 2
    assert "mission completion install --shell bash" in outcome.err


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_the_scripts_of_other_shells_are_sound(shell: str, tmp_path: Path) -> None:
    tool = shutil.which(shell)
    if tool is None:
        pytest.skip(f"there is no {shell}")
    file = tmp_path / "script"
    file.write_text(completion_script(shell))
    subprocess.run([tool, "-n", str(file)], check=True)


def test_every_kind_of_name_is_offered_and_a_path_is_left_to_the_shell() -> None:
    context = click.Context(mission)
    for kind in (MISSION, ROBOT, WORLD, GESTURE, CONTROLLER, BEHAVIOUR, SHOWN_NAME):
        assert len(kind.shell_complete(context, mission.params[0], "")) > 2
    assert [each.value for each in GESTURE.shell_complete(context, mission.params[0], "")] == list(
        shipped_files("gestures")
    )
    assert [each.type for each in NameType("robots").shell_complete(context, mission.params[0], "./my")] == ["file"]


def completed(*words: str) -> list[str]:
    """Return what a shell offers for the last of some words."""
    complete = ShellComplete(mission, {}, "mission", COMPLETION_VARIABLE)
    return [str(item.value) for item in complete.get_completions([*words[:-1]], words[-1])]


@pytest.mark.usefixtures("home")
def test_tasks_runs_and_files_of_ones_own_are_offered(capsys: pytest.CaptureFixture[str]) -> None:
    assert command(capsys, "task", "add", "greet", "--at", "2099-01-01 18:00").code == 0
    assert completed("task", "remove", "") == ["1"]
    assert completed("stop", "") == []
    with announce_command("teleop", "kit", ""):
        assert completed("stop", "") == [str(os.getpid())]
    own = config_folder() / "robots"
    own.mkdir(parents=True)
    (own / "zoe.yaml").write_text(
        find_file("robots", "turtlebot2").read_text().replace("robot: turtlebot2", "robot: zoe")
    )
    assert completed("run", "greet", "--robot", "z") == ["zoe"]


@pytest.mark.parametrize("path", ALL, ids=lambda path: " ".join(path) or "mission")
def test_options_for_names_and_params_have_completion(path: tuple[str, ...]) -> None:
    for param in (each for each in ALL[path].params if not getattr(each, "is_flag", False)):
        if {"--robot", "--world", "--controller", "--mission"} & set(param.opts):
            assert isinstance(param.type, NameType), param.opts
        if "--param" in param.opts:
            assert isinstance(param.type, ParamsType)
