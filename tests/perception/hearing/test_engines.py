"""The programs that recognise speech: how they are asked, and what their answers mean."""

import sys
from collections.abc import Mapping
from math import log
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.clock import SystemClock
from drivers.pipe import Worker
from perception.hearing.acceptance import learned
from perception.hearing.endpoint import Clip
from perception.hearing.engines import BEATEN, NOTHING, Sphinx, Vosk, weighed
from perception.hearing.grammar import Grammar
from perception.hearing.lexicon import Lexicon, english
from tests.waiting import wait_until

VOSK = '''
"""Stands in for Vosk: it understands a sound by how long it is."""
import json

def SetLogLevel(level):
    assert level == -1

class Model:
    def __init__(self, path):
        assert path.endswith("model"), path

class KaldiRecognizer:
    def __init__(self, model, rate, grammar):
        assert isinstance(model, Model) and rate == 16000
        self.phrases, self.sound = json.loads(grammar), b""
    def SetWords(self, wanted):
        assert wanted is True
    def Reset(self):
        self.sound = b""
    def AcceptWaveform(self, sound):
        self.sound += sound
    def FinalResult(self):
        text = self.phrases[len(self.sound) // 2000]
        return json.dumps({"text": text, "result": [{"word": word, "conf": 0.75} for word in text.split()]})
'''


class Ear:
    def __init__(self) -> None:
        self.starts = 0
        self.got: list[Mapping[str, Any]] = []

    def started(self) -> None:
        self.starts += 1

    def received(self, message: Mapping[str, Any], body: bytes) -> None:
        assert not body
        self.got.append(message)

    def lost(self, why: str) -> None:
        raise AssertionError(why)


def clip(count: int) -> Clip:
    return Clip(1.0, 2.0, 0.3, np.zeros(count, np.int16), np.zeros(0, np.int16))


@pytest.mark.real_time
def test_vosk_is_given_the_phrases_and_the_users_model(tmp_path: Path) -> None:
    (tmp_path / "vosk.py").write_text(VOSK)
    engine = Vosk(Grammar.of(["yes", "thank you"]), tmp_path / "model")
    code = f"import sys, runpy; sys.path.insert(0, {str(tmp_path)!r}); runpy.run_path(sys.argv[1], None, '__main__')"
    worker = Worker("ears", engine.program, SystemClock(), command=(sys.executable, "-I", "-c", code))
    ear = Ear()
    worker.open(ear)
    try:
        wait_until(lambda: ear.starts)
        worker.send(engine.instructions())
        for number in range(3):
            worker.send({"decode": number}, engine.sound(clip(1000 * number)))
        wait_until(lambda: len(ear.got) == 4)
    finally:
        worker.close()
    ready, *answers = ear.got
    assert ready == {"ready": True}
    assert [answer["decoded"] for answer in answers] == [0, 1, 2]
    judged = [engine.judge(clip(0), answer) for answer in answers[:2]]
    assert [phrase for phrase, _ in judged] == ["yes", "thank you"]
    assert [score for _, score in judged] == pytest.approx([log(3), log(3)])
    assert engine.judge(clip(2000), answers[2]) == NOTHING


@pytest.mark.parametrize(
    ("answer", "judged"),
    [
        ({"phrase": "", "sure": []}, NOTHING),
        ({"phrase": "yes [unk]", "sure": [0.9, 0.9]}, NOTHING),
        ({"phrase": "thank you", "sure": [0.9, 0.5]}, ("thank you", 0.0)),
        ({"phrase": "yes", "sure": [1.0]}, ("yes", pytest.approx(log(999)))),
    ],
)
def test_an_answer_of_vosk_is_as_sure_as_its_least_sure_word(answer: dict[str, Any], judged: Any) -> None:
    assert Vosk(Grammar.of(["yes", "thank you"]), Path("model")).judge(clip(0), answer) == judged


def test_words_that_nobody_can_say_are_told_before_anything_runs() -> None:
    with pytest.raises(ValueError, match="cannot listen for 'rodney': nobody says how it is pronounced"):
        Sphinx(Grammar.of(["hello rodney"]), Lexicon("hello HH AH L OW\n"), learned())


def test_an_answer_without_an_understanding_is_nothing() -> None:
    engine = Sphinx(Grammar.of(["hello"]), Lexicon("hello HH AH L OW\n"), learned())
    assert engine.judge(clip(16000), {"decoded": 1, "phrase": ""}) == NOTHING


def test_a_word_is_no_surer_than_the_decoys_leave_it() -> None:
    assert weighed(3.0, None) == 3.0
    assert weighed(3.0, 1000.0) == 3.0
    assert weighed(3.0, -BEATEN) == 0.0
    assert weighed(-2.0, -BEATEN) == -2.0
    assert weighed(3.0, -BEATEN - 20) < 0


@pytest.mark.real_time
def test_pocketsphinx_hears_no_phrase_in_noise_and_says_what_that_cost() -> None:
    pytest.importorskip("pocketsphinx")
    lexicon = english()
    assert lexicon is not None
    engine = Sphinx(Grammar.of(["yes", "hello robot"]), lexicon, learned())
    worker, ear = Worker("ears", engine.program, SystemClock()), Ear()
    noise = Clip(1.0, 2.0, 0.3, np.random.default_rng(0).normal(0, 900, 24000).astype(np.int16), np.zeros(0, np.int16))
    worker.open(ear)
    try:
        wait_until(lambda: ear.starts)
        worker.send({"decode": 1}, engine.sound(noise))
        worker.send(engine.instructions())
        worker.send({"decode": 2}, engine.sound(noise))
        wait_until(lambda: len(ear.got) == 3)
    finally:
        worker.close()
    early, ready, answer = ear.got
    assert (early["decoded"], early["phrase"], ready) == (1, "", {"ready": True})
    assert (answer["decoded"], answer["spent"] > 0) == (2, True)
    assert engine.judge(noise, answer)[1] < -2
