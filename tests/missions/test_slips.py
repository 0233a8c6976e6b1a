"""Slips on the command line: each is answered with what to type."""

import os
import pty
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from drivers.errors import NotConnected
from drivers.transport.ports import PORTS_HINT, find_non_serial_kind, open_port
from missions.cli.numbers import QuantityInUnit, RealNumber, WholeNumber
from missions.cli.root import mission as root
from tests.missions.command import Outcome, command

Mission = Callable[..., Outcome]


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    """The command, run in a folder with a mission and a world."""
    monkeypatch.chdir(tmp_path)
    Path("ask.yaml").write_text("mission: ask\ntree: succeed\n")
    Path("home.yaml").write_text("world: home\nroom: {length: 4 m, width: 4 m}\n")
    return lambda *arguments: command(capsys, *arguments)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("runn ask.yaml", "no such command: 'runn'\n  try: mission run\n"),
        ("greet", "no such command: 'greet'\n  try: mission run greet\n"),
        ("mine.yaml", "no such command: 'mine.yaml'\n  try: mission run mine.yaml\n"),
        ("xyzzy", "no such command: 'xyzzy'\n  try: mission --help\n"),
        ("robot list", "no such command: 'list'\n  try: mission list robots\n"),
        ("controller list", "try: mission list controllers\n"),
        ("behaviours", "try: mission list behaviours\n"),
        ("world living_room", "try: mission show living_room\n"),
        ("run ask.yaml to=Anna", "unexpected: to=Anna\n  try: --param to=Anna\n"),
        ("run ask.yaml to=Anna fast", "unexpected: to=Anna fast\n  try: --param to=Anna\n"),
        ("run ask.yaml more", "unexpected: more\n"),
        ("run ask.yaml --record --eyes truth", "--record needs a value\n  try: --record FILE\n"),
        ("run ask.yaml --simulate quick", "--simulate takes wire or fast, got 'quick'\n"),
        ("run ask.yml", "'ask.yml': no such file; did you mean the file 'ask.yaml'?\n"),
        ("show ask.yml", "did you mean the file 'ask.yaml'?\n"),
        ("check ask.yml", "did you mean the file 'ask.yaml'?\n"),
        ("verify ask.yml", "did you mean the file 'ask.yaml'?\n"),
        ("run greet --world home", "unknown world 'home'; did you mean the file 'home.yaml'?\n"),
        ("run greet --world ask.yaml", "ask.yaml is a mission: mission run ask.yaml\n"),
        (
            "run home.yaml",
            "home.yaml is a world: mission show home.yaml, or mission run MISSION --world home.yaml\n",
        ),
        ("test ask.yaml", "create it with `tests: ask` and `cases:` (docs/testing.md)\n"),
        ("test home.yaml", "home.yaml is a world: "),
        ("record info ask.yaml", "try: mission run ask.yaml --record ask.mcap\n"),
        ("record info home.yaml", "home.yaml is a world: "),
    ],
)
def test_command_line_mistake_gives_a_hint(mission: Mission, line: str, said: str) -> None:
    outcome = mission(*line.split())
    assert outcome.code == 2
    assert said in outcome.err
    assert len(outcome.err.splitlines()) < 7


def test_param_with_a_space_is_suggested_in_quotes(mission: Mission) -> None:
    assert mission("run", "ask.yaml", "to=Anna Lee").err.endswith("try: --param 'to=Anna Lee'\n")


def test_simulate_option_may_have_no_value(mission: Mission) -> None:
    assert mission("run", "ask.yaml", "--simulate", "--robot", "turtlebot2", "--speed", "5").code == 2
    assert mission("run", "--simulate", "fast", "ask.yaml").code == 0


@pytest.mark.parametrize(
    ("port", "what"),
    [
        ("/dev/zero", "a device of another kind (mem)"),
        (".", "a folder"),
        ("ask.yaml", "a file"),
        ("queue", "a pipe"),
    ],
)
def test_non_serial_port_is_refused_without_waiting(mission: Mission, port: str, what: str) -> None:
    os.mkfifo("queue")
    Path("go.yaml").write_text("mission: go\ntree:\n  drive: 1 m\n")
    outcome = mission("run", "go.yaml", "--robot", "turtlebot2", "--port", f"base={port}")
    assert outcome.code == 3
    assert outcome.err == f"mission: base: {port}: not a serial port but {what}\n  try: {PORTS_HINT}\n"
    assert "waiting" not in outcome.out
    with pytest.raises(NotConnected, match="not a serial port"):
        open_port("base", port, 115200)


def test_pseudo_terminal_and_missing_port_are_accepted_as_ports() -> None:
    ours, theirs = pty.openpty()
    try:
        assert find_non_serial_kind(os.ttyname(theirs)) is None
        assert find_non_serial_kind("/dev/no_such_port") is None
    finally:
        os.close(ours)
        os.close(theirs)


@pytest.mark.parametrize(
    "line",
    [
        "run ask.yaml --seed \u0663",
        "run ask.yaml --seed 1_0",
        "run ask.yaml --simulate fast --speed \u0662",
        "run ask.yaml --simulate fast --speed nan",
        "verify ask.yaml --bound \uff11\uff10",
        "head look --pan nan",
    ],
)
def test_numbers_are_written_in_plain_digits(mission: Mission, line: str) -> None:
    outcome = mission(*line.split())
    assert outcome.code == 2
    assert f"{line.rsplit(maxsplit=1)[-1]!r} is not a" in outcome.err


def test_every_number_of_a_command_is_read_in_plain_digits() -> None:
    commands: list[click.Command] = [root]
    for command_of in commands:  # which grows meanwhile
        if isinstance(command_of, click.Group):
            context = click.Context(command_of)
            found = (command_of.get_command(context, name) for name in command_of.list_commands(context))
            commands += [each for each in found if each is not None]
    kinds = {param.type for each in commands for param in each.params}
    numbers = [kind for kind in kinds if kind.name.partition(" ")[0] in ("integer", "float")]
    assert len(numbers) > 20
    assert [kind for kind in numbers if not isinstance(kind, WholeNumber | RealNumber)] == []


@pytest.mark.parametrize(
    ("unit", "text", "found"),
    [
        ("deg", "20 deg", 20.0),
        ("deg", "-0.5 rad", -28.6479),
        ("deg", "20", 20.0),
        ("s", "2 min", 120.0),
        ("s", "500 ms", 0.5),
        ("s", "1.5", 1.5),
        ("Hz", "5 Hz", 5.0),
    ],
)
def test_option_accepts_quantities_with_units(unit: str, text: str, found: float) -> None:
    assert QuantityInUnit(unit).convert(text, None, None) == pytest.approx(found)


@pytest.mark.parametrize(
    ("text", "said"), [("20 m", "not an angle, such as '30 deg'"), ("twenty", "not an angle"), ("2 rad", "range")]
)
def test_option_refuses_wrong_dimension_and_range(text: str, said: str) -> None:
    with pytest.raises(click.BadParameter, match=said):
        QuantityInUnit("deg", -45.0, 45.0).convert(text, None, None)
