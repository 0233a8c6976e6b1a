"""What a mission listens for: how phrases are written, and what is wrong with them."""

from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError, SourceText
from missions.language.plan import Plan
from missions.library.drivers import parse_robot
from missions.library.interests import interests_of
from missions.library.shipped import load_mission
from missions.library.target import target_of
from tests.missions.command import command

EARS = target_of(parse_robot(SourceText("r.yaml", "robot: r2\nmicrophone: {pronunciations: {xyzzy: Z IH Z IY}}\n")))


def load(
    folder: Path, step: str, *, params: dict[str, str] | None = None, head: str = "", complete: bool = True
) -> Plan:
    file = folder / "ask.yaml"
    file.write_text(f"mission: ask\n{head}tree:\n  {step}\n", encoding="utf-8")
    return load_mission(str(file), params=params, complete=complete, robot=EARS)


def fault(folder: Path, step: str, *, head: str = "") -> str:
    with pytest.raises(InvalidFileError) as caught:
        load(folder, step, head=head)
    (found,) = caught.value.diagnostics
    return str(found)


def test_all_phrases_of_a_mission_are_listened_for_in_small_letters(tmp_path: Path) -> None:
    plan = load(tmp_path, 'sequence: [{listen: [Yes!, "no", stop]}, {heard: ["Hello, robot"]}, {listen: {for: yes}}]')
    assert interests_of(plan.tree, None).phrases == ("yes", "no", "stop", "hello robot")
    listen, heard, *_ = (step.arguments for step in plan.tree.walk() if step.leaf is not None)
    assert listen["for"].constant == {"yes": "Yes!", "no": "no", "stop": "stop"}
    assert heard["phrase"].constant == {"hello robot": "Hello, robot"}


def test_phrase_may_contain_a_param(tmp_path: Path) -> None:
    head = "params: {word: {type: text}, other: stop}\n"
    step = 'listen: ["${word} please", "${other}"]'
    assert interests_of(load(tmp_path, step, head=head, params={"word": "Tea"}).tree, None).phrases == (
        "tea please",
        "stop",
    )
    known = load(tmp_path, step, head=head, complete=False)  # as `mission check` does, which is given none
    assert interests_of(known.tree, None).phrases == ("stop",)


def test_phrase_of_a_submission_may_contain_a_param(tmp_path: Path) -> None:
    (tmp_path / "inner.yaml").write_text(
        'mission: inner\nparams: {word: stop}\ntree:\n  listen: "${word}"\n', encoding="utf-8"
    )
    head = "params: {order: {type: text}}\n"
    step = '{mission: inner.yaml, with: {word: "${order}"}}'
    assert interests_of(load(tmp_path, step, head=head, params={"order": "go"}).tree, None).phrases == ("go",)
    assert interests_of(load(tmp_path, step, head=head, complete=False).tree, None).phrases == ()


@pytest.mark.parametrize(
    ("step", "said"),
    [
        ("listen: []", "needs at least one phrase"),
        ("listen: {}", "'listen' needs 'for'"),
        ("listen: [{a: b}]", "needs a phrase"),
        ("listen: [route 66]", "cannot be 'route 66': it has digits"),
        ('listen: ["?!"]', "it has no words"),
        ("heard: 5", "it has digits"),
        ('listen: "yes, no"', "write [yes, no] for 2 phrases, or leave the comma out"),
        ("heard: {phrase: 'a, b, c'}", "write [a, b, c] for 3 phrases"),
        ("listen: {for: yes, no}", "write for: [yes, no] for two phrases"),
        ("heard: {phrase: yes, no}", "write phrase: [yes, no] for two phrases"),
        ("listen: {for: yes, no: 3}", "known are: for, timeout"),
        ('sequence: [{set: {a: yes}}, {listen: "${a}"}]', "'${a}' must be known before the mission starts"),
        ("listen: {for: yes, timeout: 8}", "'timeout' needs a duration"),
        ("heard: {phrase: yes, within: 5 min}", "'within' must be between 0.01 s and 30 s"),
    ],
)
def test_invalid_phrases_are_reported(tmp_path: Path, step: str, said: str) -> None:
    assert said in fault(tmp_path, step)


def test_unpronounceable_word_is_a_mistake_with_a_hint(tmp_path: Path) -> None:
    pytest.importorskip("pocketsphinx")
    load(tmp_path, "listen: [hello xyzzy]")
    said = fault(tmp_path, "listen: [hello zażółć]")
    assert "cannot listen for 'zażółć': no dictionary has it" in said
    assert "pronunciations: {zażółć: ...} in the section 'microphone' of robot 'r2'" in said


def test_unpronounceable_word_is_reported_as_written(tmp_path: Path) -> None:
    pytest.importorskip("pocketsphinx")
    assert "cannot listen for 'Größe'" in fault(tmp_path, "listen: ['Eine Größe!']")


def test_where_no_robot_is_named_the_words_are_checked_for_the_usual_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pocketsphinx")
    file = tmp_path / "ask.yaml"
    file.write_text("mission: ask\ntree:\n  listen: [yes, Größe]\n", encoding="utf-8")
    outcome = command(capsys, "check", str(file))
    assert outcome.code == 2
    assert "cannot listen for 'Größe'" in outcome.err
    assert "robot 'turtlebot2_arm' (docs/speech.md)" in outcome.err
    assert "was checked for the default robot (turtlebot2_arm); for another robot: --robot NAME" in outcome.err


def test_a_robot_without_ears_cannot_listen(tmp_path: Path) -> None:
    deaf = target_of(parse_robot(SourceText("r.yaml", "robot: r1\nvoice: {}\n")))
    load(tmp_path, "listen: [yes]")
    with pytest.raises(InvalidFileError, match="'listen' needs a microphone; robot 'r1' has none"):
        load_mission(str(tmp_path / "ask.yaml"), robot=deaf)
