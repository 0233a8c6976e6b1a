"""The program that recognises with pocketsphinx: which single word it takes, and how that is weighed."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pocketsphinx")

from perception.hearing import recogniser_worker
from perception.hearing.contest import Entry
from perception.hearing.grammar import Grammar
from perception.hearing.lexicon import english
from perception.hearing.recogniser_worker import BEST, COMMON, SHORT, Recogniser, decoys
from perception.hearing.sound import RATE, Samples
from tests.benchmarks.speaking import Speaking


class Ruled:
    """A contest that a word has won before it begins."""

    def __init__(self, word: str) -> None:
        self.word = word

    def entries(self, samples: Samples) -> list[Entry]:
        assert len(samples) > RATE / 2
        return [Entry("maybe", 40, -100.0), Entry(self.word, 30, -130.0)]


def listening(*phrases: str) -> Recogniser:
    grammar, lexicon = Grammar.of(phrases), english()
    assert lexicon is not None
    words = {word: [" ".join(way) for way in lexicon.pronunciations(word)] for word in grammar.words}
    recogniser = Recogniser()
    recogniser.listen_for(words, [list(arc) for arc in grammar.arcs()])
    return recogniser


@pytest.mark.real_time
def test_the_contest_decides_between_single_words_and_leaves_longer_phrases_alone() -> None:
    pytest.importorskip("espeakng_loader")
    recogniser = listening("yes", "no", "thank you")
    quiet = np.zeros(RATE // 3, np.int16)
    with Speaking() as speaking:
        yes, thanks = (
            np.concatenate([quiet, speaking.say(text, "en-us", 150), quiet]) for text in ("yes", "thank you")
        )
    assert recogniser.decode(yes)["phrase"] == "yes"
    recogniser.contest = Ruled("no")  # type: ignore[assignment]
    overruled, longer = recogniser.decode(yes), recogniser.decode(thanks)
    assert (overruled["phrase"], overruled["margin"]) == ("no", pytest.approx(-1))
    assert {phone[0] for phone in overruled["aligned"]} >= {"N", "OW"}
    assert (longer["phrase"], longer["margin"]) == ("thank you", None)


def test_a_margin_is_over_the_mean_of_the_best_decoys_for_each_frame() -> None:
    recogniser = Recogniser()
    recogniser.alone = {"yes": [], "no": []}
    decoys_of_it = [Entry(str(number), 30, -100.0 - number) for number in range(2 * BEST)]
    entries = [Entry("no", 30, -90.0), *decoys_of_it, Entry("yes", 2, -120.0)]
    bar = -100 - (BEST - 1) / 2
    assert recogniser.margin("no", entries) == pytest.approx((-90 - bar) / 30)
    assert recogniser.margin("yes", entries) == pytest.approx((-120 - bar) / 5)
    assert recogniser.margin("thank you", entries) is None


def test_decoys_are_short_common_words_that_sound_like_no_phrase() -> None:
    found = decoys({"no": ["N OW"]})
    assert COMMON / 2 < len(found) < COMMON
    assert {"the", "yes", "go"} <= set(found)
    assert not {"no", "know"} & set(found)
    assert all(len(ways[0].split()) <= SHORT for ways in found.values())


@pytest.mark.parametrize("error", [ValueError("trained on other features"), FileNotFoundError("no sendump")])
def test_words_are_heard_without_a_contest_where_the_acoustic_model_is_another(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: Path) -> None:
        raise error

    monkeypatch.setattr(recogniser_worker, "AcousticModel", refuse)
    recogniser = listening("yes")
    assert recogniser.contest is None
    assert recogniser.decode(np.zeros(RATE, np.int16))["phrase"] in {"", "yes"}
