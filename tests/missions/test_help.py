"""The help of the command line: its groups, and an example for every command, which parses."""

import re
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

import click
import pytest

from missions.cli.commands import OLD_NAMES, current_name, declared_commands
from missions.cli.root import mission
from missions.plugin import COMMAND_GROUPS as GROUPS
from tests.missions.command import command

FILES = (
    "patrol.xml",
    "monday.mcap",
    "tuesday.mcap",
    "photo.jpg",
    "anna1.jpg",
    "anna2.jpg",
    "anna3.jpg",
    "my_robot.yaml",
    "joints.yaml",
)
"""The files of a user that examples name."""


def commands(path: Sequence[str] = (), of: click.Command = mission) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Yield every command and group, with the words that lead to it."""
    yield tuple(path), of
    if isinstance(of, click.Group):
        context = click.Context(of)
        for name in of.list_commands(context):
            inner = of.get_command(context, name)
            assert inner is not None
            yield from commands((*path, name), inner)


ALL = dict(commands())


def help_of(path: Sequence[str]) -> str:
    return ALL[tuple(path)].get_help(click.Context(ALL[tuple(path)], info_name=" ".join(("mission", *path))))


def example_of(path: Sequence[str]) -> list[str]:
    """Return the words of the example in a command's help, behind `mission`."""
    found = re.findall(r"^  Example: mission (.+)$", help_of(path), re.MULTILINE)
    assert len(found) == 1, f"mission {' '.join(path)}: its help has no `Example:` on a line of its own"
    return shlex.split(found[0])


def parsed(words: Sequence[str]) -> click.Context:
    """Parse a command line by what the commands declare, and run none of it; return the innermost context."""
    context = mission.make_context("mission", list(words))
    while isinstance(context.command, click.Group):
        rest = [*context._protected_args, *context.args]
        if not rest and context.command.invoke_without_command:
            break
        name, inner, rest = context.command.resolve_command(context, rest)
        assert inner is not None
        context = inner.make_context(name, rest, parent=context)
    return context


@pytest.mark.parametrize("path", ALL, ids=lambda path: " ".join(path) or "mission")
def test_every_help_has_a_valid_example(path: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in FILES:
        Path(name).touch()
    words = example_of(path)
    assert words[: len(path)] == list(path)
    parsed(words)


def test_help_shows_no_bounds_of_none() -> None:
    assert not [path for path in ALL if "=None" in help_of(path)]


def test_example_with_an_unknown_option_is_invalid() -> None:
    with pytest.raises(click.NoSuchOption):
        parsed(["run", "greet", "--fly"])


def test_help_lists_each_command_once_in_its_group() -> None:
    lines = help_of(()).splitlines()
    titles = [lines.index(f"{title}:") for title in GROUPS]
    assert titles == sorted(titles)
    ends = [*titles[1:], len(lines) - 1]
    for title, start, end in zip(GROUPS, titles, ends, strict=True):
        listed = [line.split()[0] for line in lines[start + 1 : end] if re.match(r"  \w", line)]
        assert listed == [name for name, it in declared_commands() if it.group == title and " " not in name], title
    assert len(lines) < 60, "the help fits on a screen: no line on a command takes two"


def test_number_of_commands_and_options_is_limited() -> None:
    assert len(mission.list_commands(click.Context(mission))) <= 30
    own = [each for of in ALL.values() for each in of.params if isinstance(each, click.Option)]
    shared = {(path[:-1], each.name) for path, of in ALL.items() for each in getattr(of, "shared", ())}
    assert len(own) + len(shared) <= 330


def test_no_help_shows_more_than_20_options_and_help_all_shows_the_rest(capsys: pytest.CaptureFixture[str]) -> None:
    for path, of in ALL.items():
        told = command(capsys, *path, "--help")
        assert len(re.findall(r"^  (?:-\w, )?--\w", told.out, re.MULTILINE)) <= 20, path
        if "--help-all" in told.out:
            every = command(capsys, *path, "--help-all").out
            flags = [each.opts[-1] for each in of.get_params(click.Context(of)) if not getattr(each, "hidden", False)]
            assert all(flag in every for flag in flags if flag.startswith("-")), path


@pytest.mark.parametrize("old", OLD_NAMES)
def test_an_old_name_of_a_command_is_refused_with_the_new_one(old: str, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, *old.split(), "greet")
    assert outcome.code == 2
    new = current_name([*old.split(), "greet"])
    assert f"  try: {new}" in outcome.err
    if new.startswith("mission "):
        named = [word for word in new.split()[1:] if word.islower() and not word.startswith("-")]
        assert any(" ".join(named[:size]) in map(" ".join, ALL) for size in (1, 2)), new


def test_no_summary_of_a_command_is_cut_off() -> None:
    groups = [path for path, each in ALL.items() if isinstance(each, click.Group)]
    assert not [
        line for path in groups for line in help_of(path).splitlines() if line.endswith("...") and "Usage:" not in line
    ]
