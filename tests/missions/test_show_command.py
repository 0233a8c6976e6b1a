"""``mission show``: which kind of thing a name means, and which options fit it."""

import json
from pathlib import Path

import pytest

from config.library import find_file
from tests.missions.command import command


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("greet",), "track_face"),
        (("dock",), "dock as charge"),
        (("behaviour", "dock"), "claims:"),
        (("find_face",), "arguments:"),
        (("if",), "if: "),
        (("party",), "To draw it: mission show party"),
        (("world", "party"), "To draw it: mission show party"),
        (("stroll",), "support margin"),
        (("1",), "drive"),
    ],
)
def test_show_finds_the_kind_of_a_name(words: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "show", *words)
    assert outcome.code == 0, outcome.err
    assert told in outcome.out


def test_show_finds_the_kind_of_a_file_by_its_keys(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("here.yaml").write_text(find_file("worlds", "empty").read_text())
    assert "To draw it: mission show here.yaml" in command(capsys, "show", "here.yaml").out
    Path("party.yaml").write_text("mission: party\ntree:\n  succeed\n")
    assert "succeed" in command(capsys, "show", "party.yaml").out


def test_a_behaviour_is_shown_as_json_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    (shown,) = json.loads(command(capsys, "show", "behaviour", "drive", "--format", "json").out)
    assert shown["claims"] == ["base"]


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("greet", "--camera"), "--camera is for a world, and 'greet' is a mission"),
        (("party", "--format", "json"), "and 'party' is a world"),
        (("behaviour", "dock", "-o", "dock.svg"), "--output is for a"),
        (("stroll", "--fold", "0"), "and 'stroll' is a gait"),
        (("drive", "--format", "svg"), "a behaviour is shown as text or as json"),
        (("greet", "--at", "5 s"), "a mission has no times, unlike a record"),
        (("world", "greet"), "unknown world 'greet'"),
        (("planet", "greet"), "mission show {mission|record|behaviour|world|gait} NAME"),
        (("prty",), "did you mean 'party'?"),
        (("strol",), "did you mean 'stroll'?"),
        (("gret",), "did you mean 'greet'?"),
    ],
)
def test_show_refuses_unsuitable_options(words: tuple[str, ...], why: str, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "show", *words)
    assert outcome.code == 2
    assert why in outcome.err
