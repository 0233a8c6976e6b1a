"""The program that recognises with pocketsphinx: which single word it takes, and how that is weighed."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pocketsphinx")

from perception.hearing import recogniser_worker
from perception.hearing.acoustic_model import WordScore
from perception.hearing.engines import DECOY_TOLERANCE
from perception.hearing.grammar import PhraseGrammar
from perception.hearing.lexicon import load_english
from perception.hearing.recogniser_worker import (
    CONNECTED_MARGIN,
    MAX_COMMON_WORDS,
    MAX_DECOY_PHONES,
    SpeechRecogniser,
    find_decoys,
    margin,
)
from perception.hearing.sound import RATE, Samples, enhance_speech
from tests.benchmarks.speaking import Speaking
from tests.benchmarks.spoken import HISS, levelled, trimmed


class Ruled:
    """Contest that a given word always wins."""

    def __init__(self, word: str) -> None:
        self.word = word

    def rank_words(self, samples: Samples) -> list[WordScore]:
        assert len(samples) > RATE / 2
        return [WordScore("maybe", 40, -100.0), WordScore(self.word, 30, -130.0)]


def listening(*phrases: str) -> SpeechRecogniser:
    grammar, lexicon = PhraseGrammar.from_texts(phrases), load_english()
    assert lexicon is not None
    words = {word: [" ".join(way) for way in lexicon.pronunciations(word)] for word in grammar.words}
    recogniser = SpeechRecogniser()
    recogniser.set_grammar(words, [list(arc) for arc in grammar.arcs()])
    return recogniser


@pytest.mark.real_time
def test_the_contest_decides_between_single_words_and_weighs_each_word_of_longer_phrases() -> None:
    pytest.importorskip("espeakng_loader")
    recogniser = listening("yes", "no", "thank you")
    quiet = np.zeros(RATE // 3, np.int16)
    with Speaking() as speaking:
        yes, thanks = (
            np.concatenate([quiet, speaking.say(text, "en-us", 150), quiet]) for text in ("yes", "thank you")
        )
    assert recogniser.decode(yes)["phrase"] == "yes"
    longer = recogniser.decode(thanks)
    recogniser.contest = Ruled("no")  # type: ignore[assignment]
    overruled = recogniser.decode(yes)
    assert (overruled["phrase"], overruled["margin"]) == ("no", pytest.approx(-1))
    assert {phone[0] for phone in overruled["aligned"]} >= {"N", "OW"}
    assert longer["phrase"] == "thank you"
    assert longer["margin"] > -DECOY_TOLERANCE


def test_similar_words_fit_worse_than_decoys() -> None:
    pytest.importorskip("espeakng_loader")
    recogniser, quiet = listening("go forward"), np.zeros(RATE // 3)
    hiss = np.random.default_rng(1)
    with Speaking() as speaking:
        for text in ("go forward", "yellow flowers", "slow water", "mellow powers"):
            sound = np.concatenate([quiet, levelled(trimmed(speaking.say(text, "en-us", 160))), quiet])
            noisy = np.asarray(sound + hiss.standard_normal(len(sound)) * HISS, np.int16)
            found = recogniser.decode(enhance_speech(noisy, np.zeros(0, np.int16)))["margin"]
            assert (found is not None and found > -DECOY_TOLERANCE) is (text == "go forward"), text


def test_a_margin_is_over_the_best_decoy_for_each_frame_and_words_of_a_phrase_have_some_more() -> None:
    entries = [
        WordScore("no", 30, -90.0),
        WordScore("maybe", 30, -100.0),
        WordScore("often", 30, -101.0),
        WordScore("yes", 2, -120.0),
    ]
    assert margin("no", entries, ("yes", "no")) == pytest.approx(10 / 30)
    assert margin("yes", entries, ("yes", "no")) == pytest.approx(-20 / 5)
    recogniser = SpeechRecogniser()
    recogniser.contest = Ruled("no")  # type: ignore[assignment]
    words = [("<sil>", 0, 40, 0.0), ("no(2)", 40, 60, 0.0)]
    assert recogniser.connected_margin("no no", words, np.zeros(2 * RATE, np.int16)) == pytest.approx(
        -1 + CONNECTED_MARGIN
    )


def test_decoys_are_short_common_words_unlike_any_phrase() -> None:
    found = find_decoys({"no": ["N OW"]})
    assert MAX_COMMON_WORDS / 2 < len(found) < MAX_COMMON_WORDS
    assert {"the", "yes", "go"} <= set(found)
    assert not {"no", "know"} & set(found)
    assert all(len(ways[0].split()) <= MAX_DECOY_PHONES for ways in found.values())


@pytest.mark.parametrize("error", [ValueError("trained on other features"), FileNotFoundError("no sendump")])
def test_recogniser_works_without_a_contest_for_another_model(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: Path) -> None:
        raise error

    monkeypatch.setattr(recogniser_worker, "AcousticModel", refuse)
    recogniser = listening("yes")
    assert recogniser.contest is None
    assert recogniser.decode(np.zeros(RATE, np.int16))["phrase"] in {"", "yes"}
