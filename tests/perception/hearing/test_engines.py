"""The programs that recognise speech: how they are asked, and what their answers mean."""

import re
import sys
from collections.abc import Mapping
from math import log
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest

from drivers.clock import SystemClock
from drivers.transport.worker_process import WorkerProcess
from perception.hearing.acceptance import load_acceptance
from perception.hearing.engines import (
    DECOY_TOLERANCE,
    NO_PHRASE,
    ModelEngine,
    SherpaEngine,
    SphinxEngine,
    VoskEngine,
    limit_by_decoys,
)
from perception.hearing.grammar import PhraseGrammar
from perception.hearing.lexicon import Lexicon, load_english
from perception.hearing.sound import Clip
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

    def on_started(self) -> None:
        self.starts += 1

    def on_message(self, message: Mapping[str, Any], body: bytes) -> None:
        assert not body
        self.got.append(message)

    def on_exit(self, reason: str) -> None:
        raise AssertionError(reason)


def clip(count: int) -> Clip:
    return Clip(1.0, 2.0, 0.3, np.zeros(count, np.int16), np.zeros(0, np.int16))


SHERPA = '''
"""Stands in for sherpa-onnx: it understands a sound by how long it is, as models of English write: in capitals."""
import math
from pathlib import Path

class Stream:
    def __init__(self):
        self.count, self.over, self.left = 0, False, 2
    def accept_waveform(self, rate, samples):
        assert rate == 16000 and samples.dtype == "float32" and not self.over
        self.count += len(samples)
    def input_finished(self):
        self.over = True

class OnlineRecognizer:
    @classmethod
    def from_transducer(cls, tokens, encoder, decoder, joiner, num_threads, decoding_method):
        assert decoding_method == "modified_beam_search" and num_threads == 1
        assert [Path(each).name for each in (tokens, encoder, decoder, joiner)] == [
            "tokens.txt", "encoder-1.int8.onnx", "decoder-1.onnx", "joiner-1.onnx"]
        return cls()
    def create_stream(self):
        return Stream()
    def is_ready(self, stream):
        return stream.over and stream.left > 0
    def decode_stream(self, stream):
        stream.left -= 1
    def get_result(self, stream):
        assert stream.left == 0
        return ["YES", " THANK YOU", "NO THANK YOU"][(stream.count - 9600) // 1000]
    def ys_probs(self, stream):
        return [math.log(0.75)] * len(self.get_result(stream).split())
'''
FILES = ("tokens.txt", "encoder-1.onnx", "encoder-1.int8.onnx", "decoder-1.onnx", "joiner-1.onnx")


def isolated(engine: ModelEngine, beside: Path) -> WorkerProcess:
    """The program of an engine, which finds its library in the folder ``beside``."""
    code = f"import sys, runpy; sys.path.insert(0, {str(beside)!r}); runpy.run_path(sys.argv[1], None, '__main__')"
    return WorkerProcess("ears", engine.program, SystemClock(), command=(sys.executable, "-I", "-c", code))


@pytest.mark.parametrize(
    ("kind", "library", "stand_in"), [(VoskEngine, "vosk", VOSK), (SherpaEngine, "sherpa_onnx", SHERPA)]
)
def test_an_engine_is_given_the_phrases_and_the_users_model(
    kind: type[ModelEngine], library: str, stand_in: str, tmp_path: Path
) -> None:
    (tmp_path / f"{library}.py").write_text(stand_in)
    model = tmp_path / "model"
    model.mkdir()
    for name in FILES:
        (model / name).touch()
    engine = kind(PhraseGrammar.from_texts(["yes", "thank you"]), model)
    worker, ear = isolated(engine, tmp_path), Ear()
    worker.open(ear)
    try:
        wait_until(lambda: ear.starts)
        worker.send(engine.setup_message())
        for number in range(3):
            worker.send({"decode": number}, engine.prepare_sound(clip(1000 * number)))
        wait_until(lambda: len(ear.got) == 4)
    finally:
        worker.close()
    ready, *answers = ear.got
    assert ready == {"ready": True}
    assert [answer["decoded"] for answer in answers] == [0, 1, 2]
    judged = [engine.judge(clip(0), answer) for answer in answers[:2]]
    assert [phrase for phrase, _ in judged] == ["yes", "thank you"]
    assert [score for _, score in judged] == pytest.approx([log(3), log(3)])
    assert engine.judge(clip(2000), answers[2]) == NO_PHRASE


@pytest.mark.parametrize(
    ("files", "complaint"),
    [((), "there is no tokens.txt"), (FILES[:1], r"there is no encoder\*.onnx"), (FILES[:3], "there is no decoder")],
)
def test_folder_without_a_transducer_is_reported(files: tuple[str, ...], complaint: str, tmp_path: Path) -> None:
    (tmp_path / "sherpa_onnx.py").write_text(SHERPA)
    for name in files:
        (tmp_path / name).touch()
    engine = SherpaEngine(PhraseGrammar.from_texts(["yes"]), tmp_path)
    worker, lost = isolated(engine, tmp_path), Event()
    told: list[str] = []

    class Lost(Ear):
        def on_exit(self, reason: str) -> None:
            told.append(reason)
            lost.set()

    ear = Lost()
    worker.open(ear)
    try:
        wait_until(lambda: ear.starts)
        worker.send(engine.setup_message())
        assert lost.wait(20)
    finally:
        worker.close()
    assert re.search(complaint, told[0])


@pytest.mark.parametrize("kind", [VoskEngine, SherpaEngine])
@pytest.mark.parametrize(
    ("answer", "judged"),
    [
        ({"phrase": "", "sure": []}, NO_PHRASE),
        ({"phrase": "yes [unk]", "sure": [0.9, 0.9]}, NO_PHRASE),
        ({"phrase": "thank you", "sure": [0.9, 0.5]}, ("thank you", 0.0)),
        ({"phrase": " Thank you.", "sure": [0.9, 0.9, 0.5]}, ("thank you", 0.0)),
        ({"phrase": "yes", "sure": []}, NO_PHRASE),
        ({"phrase": "yes", "sure": [1.0]}, ("yes", pytest.approx(log(999)))),
    ],
)
def test_answer_is_as_certain_as_its_least_certain_part(
    kind: type[ModelEngine], answer: dict[str, Any], judged: Any
) -> None:
    assert kind(PhraseGrammar.from_texts(["yes", "thank you"]), Path("model")).judge(clip(0), answer) == judged


def test_unpronounceable_words_are_refused_before_the_start() -> None:
    with pytest.raises(ValueError, match="cannot listen for 'rodney': no known pronunciation"):
        SphinxEngine(PhraseGrammar.from_texts(["hello rodney"]), Lexicon("hello HH AH L OW\n"), load_acceptance())


def test_an_answer_without_an_understanding_is_nothing() -> None:
    engine = SphinxEngine(PhraseGrammar.from_texts(["hello"]), Lexicon("hello HH AH L OW\n"), load_acceptance())
    assert engine.judge(clip(16000), {"decoded": 1, "phrase": ""}) == NO_PHRASE


def test_word_certainty_is_limited_by_decoys() -> None:
    assert limit_by_decoys(3.0, None) == 3.0
    assert limit_by_decoys(3.0, 1000.0) == 3.0
    assert limit_by_decoys(3.0, -DECOY_TOLERANCE) == 0.0
    assert limit_by_decoys(-2.0, -DECOY_TOLERANCE) == -2.0
    assert limit_by_decoys(3.0, -DECOY_TOLERANCE - 20) < 0


def test_pocketsphinx_finds_no_phrase_in_noise_and_reports_its_cost() -> None:
    pytest.importorskip("pocketsphinx")
    lexicon = load_english()
    assert lexicon is not None
    engine = SphinxEngine(PhraseGrammar.from_texts(["yes", "hello robot"]), lexicon, load_acceptance())
    worker, ear = WorkerProcess("ears", engine.program, SystemClock()), Ear()
    noise = Clip(1.0, 2.0, 0.3, np.random.default_rng(0).normal(0, 900, 24000).astype(np.int16), np.zeros(0, np.int16))
    worker.open(ear)
    try:
        wait_until(lambda: ear.starts)
        worker.send({"decode": 1}, engine.prepare_sound(noise))
        worker.send(engine.setup_message())
        worker.send({"decode": 2}, engine.prepare_sound(noise))
        wait_until(lambda: len(ear.got) == 3)
    finally:
        worker.close()
    early, ready, answer = ear.got
    assert (early["decoded"], early["phrase"], ready) == (1, "", {"ready": True})
    assert (answer["decoded"], answer["spent"] > 0) == (2, True)
    assert engine.judge(noise, answer)[1] < -2
