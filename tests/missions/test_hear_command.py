"""``mission hear``: what is understood of a recording, and what cannot be listened for."""

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from config.diagnostics import InvalidFileError
from drivers.errors import BadRequest, NoReply, NotConnected
from missions.plugins.setup.hear import command
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


def test_hear_accepts_phrases_and_refuses_other_speech(wav: Path) -> None:
    result = hear("--for", "yes please, hello rodney", "--wav", str(wav))  # a name, which the synthesiser pronounces
    assert result.output.startswith("listening for: yes please, hello rodney\n")
    first, second, third = lines(result)
    assert (first[0], second[0], third[0]) == ("accepted", "refused", "accepted")
    assert first[1].startswith("yes please  (score +")
    assert third[1].startswith("hello rodney  (score +")


def test_hear_warns_of_easily_confused_phrases(wav: Path) -> None:
    said = "mission: 'go' and 'no' are easily confused\n  try: another or a longer phrase\n"
    assert said in hear("--for", "go, no, hello", "--wav", str(wav)).stderr
    assert not hear("--for", "yes please, hello", "--wav", str(wav)).stderr


def test_hear_applies_the_threshold(wav: Path) -> None:
    told = lines(hear("--for", "yes please, hello rodney", "--wav", str(wav), "--threshold", "9"))
    assert {verdict for verdict, _ in told} == {"refused"}


def test_the_phrases_of_a_mission_are_listened_for(wav: Path, tmp_path: Path) -> None:
    mission = tmp_path / "ask.yaml"
    mission.write_text("mission: ask\ntree: {listen: [yes please, stop]}\n", encoding="utf-8")
    told = lines(hear(str(mission), "--wav", str(wav)))
    assert told[0][1].startswith("yes please")


def test_phrases_may_be_params_and_stand_in_leaves_of_ones_own(wav: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.py"
    own.write_text(
        "from behaviours.hearing import Listen\n\n\n"
        'class Await(Listen):\n    """Wait for a phrase."""\n\n    tag = "await"\n',
        encoding="utf-8",
    )
    mission = tmp_path / "ask.yaml"
    mission.write_text(
        'mission: ask\nparams: {word: {type: text}}\ntree: {await: ["${word} please", stop]}\n', encoding="utf-8"
    )
    result = hear(str(mission), "--behaviours", str(own), "--param", "word=yes", "--wav", str(wav))
    assert result.output.startswith("listening for: yes please, stop\n")
    assert lines(result)[0][1].startswith("yes please")
    error = hear(str(mission), "--behaviours", str(own), "--wav", str(wav)).exception
    assert isinstance(error, InvalidFileError)
    assert '--param word="..."' in str(error)


@pytest.mark.parametrize("recogniser", ["vosk", "sherpa"])
def test_hear_without_its_recogniser_hints_at_the_extra(
    recogniser: str, wav: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("missions.plugins.setup.hear.RECOGNITION_TIMEOUT", 0.5)
    robot = tmp_path / "r.yaml"
    robot.write_text(f"robot: r\nmicrophone: {{recogniser: {recogniser}, model: none}}\n", encoding="utf-8")
    error = hear("--for", "yes", "--robot", str(robot), "--wav", str(wav)).exception
    assert isinstance(error, NoReply)
    assert f"missiontree[{recogniser}]" in error.hint


def test_hear_refuses_words_without_a_pronunciation(wav: Path) -> None:
    error = hear("--for", "schön", "--wav", str(wav)).exception
    assert isinstance(error, BadRequest)
    assert "unknown pronunciation: schön" in str(error)
    assert "pronunciations: {schön:" in error.hint


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "no phrases given"),
        (("greet", "--for", "yes"), "no phrases given"),
        (("greet",), "mission 'greet' does not listen for anything"),
        (("--for", "yes, route 66"), "it has digits"),
        (("--for", "yes", "--robot", "head"), "has no microphone"),
        (("--for", "yes", "--param", "a=b"), "need a mission"),
        (("--for", "yes", "--threshold", "nan"), "'nan' is not a number"),
        (("--for", "yes", "--threshold", "11"), "must be between -10 and 10"),
    ],
)
def test_hear_refuses_invalid_arguments(arguments: tuple[str, ...], said: str, tmp_path: Path) -> None:
    robot = tmp_path / "head.yaml"
    robot.write_text("robot: head\nvoice: {}\n", encoding="utf-8")
    result = hear(*(str(robot) if each == "head" else each for each in arguments))
    assert result.exit_code == 2
    assert said in result.output


def test_hear_names_a_missing_recording(tmp_path: Path) -> None:
    error = hear("--for", "yes", "--wav", str(tmp_path / "none.wav")).exception
    assert isinstance(error, NotConnected)
    assert "none.wav: no such file" in str(error)
