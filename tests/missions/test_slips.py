"""Slips on the command line: each is answered with what to type."""

from collections.abc import Callable
from pathlib import Path

import pytest

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
        ("xyzzy", "no such command: 'xyzzy'\n  try: mission --help\n"),
        ("world living_room", "try: mission world show living_room\n"),
        ("run ask.yaml to=Anna", "unexpected: to=Anna\n  try: --param to=Anna\n"),
        ("run ask.yaml to=Anna fast", "unexpected: to=Anna fast\n  try: --param to=Anna\n"),
        ("run ask.yaml more", "unexpected: more\n"),
        ("run ask.yaml --record --eyes truth", "--record needs a value\n  try: --record FILE\n"),
        ("run ask.yaml --simulate quick", "--simulate takes wire or fast, got 'quick'\n"),
        ("run ask", "unknown mission 'ask'; did you mean the file 'ask.yaml'?\n"),
        ("show ask", "did you mean the file 'ask.yaml'?\n"),
        ("check ask", "did you mean the file 'ask.yaml'?\n"),
        ("verify ask", "did you mean the file 'ask.yaml'?\n"),
        ("run greet --world home", "unknown world 'home'; did you mean the file 'home.yaml'?\n"),
        ("run greet --world ask.yaml", "ask.yaml is a mission: mission run ask.yaml\n"),
        (
            "run home.yaml",
            "home.yaml is a world: mission world show home.yaml, or mission run MISSION --world home.yaml\n",
        ),
        ("test ask.yaml", "write it, beginning with `tests: ask` and `cases:` (docs/testing.md)\n"),
        ("test home.yaml", "home.yaml is a world: "),
        ("record info ask.yaml", "try: mission run ask.yaml --record ask.mcap, which makes one\n"),
        ("record info home.yaml", "home.yaml is a world: "),
    ],
)
def test_a_slip_is_answered_with_what_to_type(mission: Mission, line: str, said: str) -> None:
    outcome = mission(*line.split())
    assert outcome.code == 2
    assert said in outcome.err
    assert len(outcome.err.splitlines()) < 7


def test_a_param_with_a_blank_is_told_in_quotes(mission: Mission) -> None:
    assert mission("run", "ask.yaml", "to=Anna Lee").err.endswith("try: --param 'to=Anna Lee'\n")


def test_what_stood_alone_may_still_stand_alone(mission: Mission) -> None:
    assert mission("run", "ask.yaml", "--simulate", "--robot", "turtlebot2", "--speed", "5").code == 2
    assert mission("run", "--simulate", "fast", "ask.yaml").code == 0
