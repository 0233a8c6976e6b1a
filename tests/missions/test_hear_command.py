"""``mission hear``: what is understood of a recording, and what cannot be listened for."""

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from drivers.errors import NotConnected
from missions.cli.hear import command
from tests.missions.spoken import record

pytest.importorskip("pocketsphinx")
pytest.importorskip("espeakng_loader")


@pytest.fixture(scope="module")
def wav(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("spoken")
    return record(folder / "a.wav", 9.0, (1.0, "yes please"), (3.0, "what a lovely day"), (6.0, "hello Rodney"))


def hear(*arguments: str) -> Result:
    return CliRunner().invoke(command, [*arguments])


def lines(result: Result) -> list[list[str]]:
    assert result.exit_code == 0, result.output
    return [line.split(None, 3)[2:] for line in result.output.splitlines()[1:]]


def test_each_phrase_is_told_and_all_else_refused(wav: Path) -> None:
    result = hear("--for", "yes please, hello rodney", "--wav", str(wav))  # a name, which the synthesiser pronounces
    assert result.output.startswith("listening for: yes please, hello rodney\n")
    first, second, third = lines(result)
    assert (first[0], second[0], third[0]) == ("accepted", "refused", "accepted")
    assert first[1].startswith("yes please  (score +")
    assert third[1].startswith("hello rodney  (score +")


def test_a_threshold_may_be_asked_for(wav: Path) -> None:
    told = lines(hear("--for", "yes please, hello rodney", "--wav", str(wav), "--threshold", "9"))
    assert {verdict for verdict, _ in told} == {"refused"}


def test_the_phrases_of_a_mission_are_listened_for(wav: Path, tmp_path: Path) -> None:
    mission = tmp_path / "ask.yaml"
    mission.write_text("mission: ask\ntree: {listen: [yes please, stop]}\n", encoding="utf-8")
    told = lines(hear(str(mission), "--wav", str(wav)))
    assert told[0][1].startswith("yes please")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "say what to listen for"),
        (("greet", "--for", "yes"), "say what to listen for"),
        (("greet",), "mission 'greet' does not listen for anything"),
        (("--for", "yes, route 66"), "it has digits"),
        (("--for", "yes", "--robot", "head"), "has no microphone"),
    ],
)
def test_what_cannot_be_listened_for_is_said(arguments: tuple[str, ...], said: str, tmp_path: Path) -> None:
    robot = tmp_path / "head.yaml"
    robot.write_text("robot: head\nvoice: {}\n", encoding="utf-8")
    result = hear(*(str(robot) if each == "head" else each for each in arguments))
    assert result.exit_code == 2
    assert said in result.output


def test_a_recording_that_is_not_there_is_named(tmp_path: Path) -> None:
    error = hear("--for", "yes", "--wav", str(tmp_path / "none.wav")).exception
    assert isinstance(error, NotConnected)
    assert "none.wav: no such file" in str(error)
