"""The help of the command line: its groups, and an example for every command, which parses."""

import re
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

import click
import pytest

from missions.cli.root import COMMANDS, GROUPS, mission

FILES = (
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
def test_every_help_has_an_example_of_its_command_that_parses(
    path: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in FILES:
        Path(name).touch()
    words = example_of(path)
    assert words[: len(path)] == list(path)
    parsed(words)


def test_no_help_tells_of_bounds_that_there_are_not() -> None:
    assert not [path for path in ALL if "=None" in help_of(path)]


def test_an_example_with_an_option_that_is_not_there_does_not_parse() -> None:
    with pytest.raises(click.NoSuchOption):
        parsed(["run", "greet", "--fly"])


def test_the_help_of_the_command_lists_each_subcommand_once_in_its_group() -> None:
    lines = help_of(()).splitlines()
    titles = [lines.index(f"{title}:") for title in GROUPS]
    assert titles == sorted(titles)
    for start, (title, group) in zip(titles, GROUPS.items(), strict=True):
        listed = [line.split()[0] for line in lines[start + 1 : start + 99] if re.match(r"  \w", line)]
        assert listed[: len(group)] == list(group), title
    assert sum(map(len, GROUPS.values())) == len(COMMANDS)
