"""The sections ``microphone`` and ``screen`` of robot files: what they say, and what is wrong with them."""

import json

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from config.diagnostics import InvalidFileError, SourceText
from config.robot import RobotConfig
from drivers.api.sensor_sections import PHONES, MicrophoneKeys
from drivers.microphone.declared import WavFileKeys
from drivers.screen.declared import PageKeys
from missions.library.drivers import parse_robot
from perception.hearing.grammar import PhraseGrammar, normalise
from perception.hearing.lexicon import KIND_OF


def robot(text: str) -> RobotConfig:
    return parse_robot(SourceText("r.yaml", f"robot: r\n{text}\n"))


def test_missing_sections_give_no_parts() -> None:
    assert robot("voice: {}").parts == {"voice"}


def test_empty_sections_mean_the_sound_card_and_a_page() -> None:
    found = robot("microphone: {}\nscreen: {}")
    assert (found.microphone, found.screen) == (MicrophoneKeys(), PageKeys())
    assert found.parts == {"microphone", "screen"}


def test_microphone_and_screen_sections_are_read() -> None:
    found = robot(
        "microphone: {driver: file, source: a.wav, recogniser: vosk, model: m, threshold: 1.5,"
        " pronunciations: {Rodney: r aa d n iy}}\n"
        "screen: {driver: print, port: 8400, mood: happy}"
    )
    said = {"rodney": "R AA D N IY"}
    assert found.microphone == WavFileKeys(
        source="a.wav", recogniser="vosk", model="m", threshold=1.5, pronunciation_texts={"Rodney": "r aa d n iy"}
    )
    assert found.microphone.pronunciations == said
    assert found.screen == PageKeys(port=8400, mood="happy")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("microphone: {driver: file}", "needs 'source'"),
        ("microphone: {recogniser: vosk}", "'recogniser: vosk' needs 'model'"),
        ("microphone: {recogniser: sherpa}", "'recogniser: sherpa' needs 'model'"),
        ("microphone: {recogniser: voks}", "did you mean 'vosk'?"),
        ("microphone: {threshold: 11}", "'threshold' must be at most 10"),
        ("microphone: {pronunciations: {rodney: R AA D N IX}}", "'rodney': no phone is called 'IX'"),
        ("microphone: {pronunciations: {rodney: }}", "'rodney' needs its phones"),
        ("microphone: {pronunciations: {r2-d2: AA}}", "'pronunciations': 'r2-d2' is not one word of letters"),
        ("microphone: {pronunciations: {r2: AA}}", "'r2' is not one word of letters"),
        ("microphone: {pronunciations: {hello robot: AA}}", "'hello robot' is not one word of letters"),
        ("microphone: {pronunciations: {66: AA}}", "'66' is not one word of letters"),
        ("screen: {port: 80}", "'port' must be at least 1024"),
        ("screen: {mood: hapy}", "did you mean 'happy'?"),
    ],
)
def test_microphone_section_faults_are_reported(text: str, said: str) -> None:
    with pytest.raises(InvalidFileError) as caught:
        robot(text)
    (fault,) = caught.value.diagnostics
    assert said in str(fault)


@given(st.text(st.characters(codec="utf-8", categories=["L", "M", "Nd", "P"]), min_size=1, max_size=6))
@example("O\u2019Hara")
@example("Cafe\u0301")
@example("\u0390")
def test_pronunciation_keys_are_normalised_as_phrases(key: str) -> None:
    try:
        section = robot(f"microphone: {{pronunciations: {{{json.dumps(key)}: AA}}}}").microphone
    except InvalidFileError:
        return
    assert section is not None
    (word,) = section.pronunciations
    assert normalise(key) == word
    assert PhraseGrammar.from_texts([key]).words == (word,)


@pytest.mark.parametrize(
    ("key", "word"),
    [("Rodney", "rodney"), ("o\u2019hara", "o'hara"), ("cafe\u0301", "caf\u00e9"), ("Na\u00efve", "na\u00efve")],
)
def test_words_are_taken_in_any_writing(key: str, word: str) -> None:
    section = robot(f"microphone: {{pronunciations: {{{key}: AA}}}}").microphone
    assert section is not None
    assert section.pronunciations == {word: "AA"}


def test_phones_of_the_file_equal_those_of_the_model() -> None:
    assert set(PHONES) == set(KIND_OF) - {"SIL"}
