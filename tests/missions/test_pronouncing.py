"""How the robot's ears come by the words that they listen for, and what is said where they cannot."""

from pathlib import Path

import pytest

from drivers.api import ignore
from drivers.api.driver import DriverContext
from drivers.api.sensor_sections import MicrophoneKeys
from drivers.clock import ManualClock, SystemClock
from drivers.errors import BadRequest, NotConnected
from drivers.microphone.declared import WavFileKeys
from drivers.microphone.make import recording, sound_card
from drivers.microphone.sound_card import SoundCardMicrophone
from drivers.microphone.wav_microphone import WavMicrophone
from missions.assembly.hearing import make_ears
from missions.library import pronunciation
from missions.library.pronunciation import find_confusable_phrases, find_unpronounceable, lexicon_for

pytest.importorskip("pocketsphinx")


def test_the_robot_file_goes_before_the_dictionary() -> None:
    config = MicrophoneKeys(pronunciation_texts={"hello": "HH AY"})
    assert lexicon_for(config, ["hello"], SystemClock()).pronunciations("hello")[0] == ("HH", "AY")


def test_name_in_no_dictionary_is_pronounced_by_the_synthesiser() -> None:
    pytest.importorskip("espeakng_loader")
    assert find_unpronounceable(MicrophoneKeys(), ["hello", "wheatleyon"]) == []
    lexicon = lexicon_for(MicrophoneKeys(), ["hello", "wheatleyon"], SystemClock())
    assert lexicon.pronunciations("wheatleyon")[0][0] == "W"
    assert lexicon.pronunciations("hello")


def test_name_is_unpronounceable_without_a_synthesiser(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pronunciation, "find_spec", lambda _: None)
    assert find_unpronounceable(MicrophoneKeys(), ["hello", "wheatleyon"]) == ["wheatleyon"]


def test_word_unknown_to_the_synthesiser_gives_a_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(*_: object) -> str:
        raise ValueError("phoneme 'q' is not one of the voice en-us")

    monkeypatch.setattr(pronunciation, "_phones", silent)
    with pytest.raises(BadRequest, match="unknown pronunciation: wheatleyon") as caught:
        lexicon_for(MicrophoneKeys(), ["wheatleyon"], SystemClock())
    assert "pronunciations" in caught.value.hint


def test_letters_beyond_english_are_left_to_the_robot_file_by_the_checker_and_the_ears_alike() -> None:
    said = MicrophoneKeys(pronunciation_texts={"schön": "SH EH N"})
    assert find_unpronounceable(MicrophoneKeys(), ["schön"]) == ["schön"]
    assert find_unpronounceable(said, ["schön"]) == []
    with pytest.raises(BadRequest, match="unknown pronunciation: schön:"):
        lexicon_for(MicrophoneKeys(), ["hello", "schön"], SystemClock())
    assert lexicon_for(said, ["schön"], SystemClock()).pronunciations("schön") == [("SH", "EH", "N")]


@pytest.mark.parametrize("recogniser", ["vosk", "sherpa"])
def test_recognisers_with_a_model_of_the_users_know_their_own_words(recogniser: str) -> None:
    keys = MicrophoneKeys(recogniser=recogniser, model="m")
    assert (find_unpronounceable(keys, ["wheatleyon"]), find_confusable_phrases(keys, ["go", "no"])) == ((), ())


def test_missing_recogniser_gives_an_install_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pronunciation, "load_english", lambda _: None)
    assert find_unpronounceable(MicrophoneKeys(), ["hello"]) == ()
    with pytest.raises(NotConnected, match="pocketsphinx, which understands speech, is not installed") as caught:
        lexicon_for(MicrophoneKeys(), ["hello"], SystemClock())
    assert "missiontree[listen]" in caught.value.hint


def test_microphone_source_follows_the_robot_file() -> None:
    clock = ManualClock()
    assert isinstance(sound_card(MicrophoneKeys(), DriverContext(clock)), SoundCardMicrophone)
    assert isinstance(recording(WavFileKeys(source="a.wav"), DriverContext(clock)), WavMicrophone)


def test_missing_recording_is_reported_with_its_full_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    source = recording(WavFileKeys(source="a.wav"), DriverContext(ManualClock()))
    source.open()
    assert source.health().detail == f"microphone: {tmp_path / 'a.wav'}: no such file"


@pytest.mark.parametrize(
    "config", [MicrophoneKeys(), *(MicrophoneKeys(recogniser=other, model="m") for other in ("vosk", "sherpa"))]
)
def test_closed_ears_are_offline_and_empty(config: MicrophoneKeys, tmp_path: Path) -> None:
    clock = ManualClock()
    source = WavMicrophone(tmp_path / "none.wav", clock)
    ears = make_ears(config, source, ["hello robot"], clock, report=ignore)
    assert (ears.words(), ears.refused(), ears.listened(), ears.level()) == ((), (), None, -90.0)
    assert not ears.health().online
    ears.rest()
    ears.close()
    ears.close()
