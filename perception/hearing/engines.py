"""Recognition engines: the messages to their worker processes, and the interpretation of the replies."""

from collections.abc import Mapping
from math import log
from pathlib import Path
from typing import Any

from perception.hearing.acceptance import AcceptanceModel
from perception.hearing.features import Decoding, acceptance_features
from perception.hearing.grammar import PhraseGrammar, normalise
from perception.hearing.lexicon import Lexicon
from perception.hearing.sound import Clip, enhance_speech

Judgement = tuple[str, float]
"""The phrase nearest to a clip, and its score: the logarithm of the odds that it was spoken.

It is ``NO_PHRASE`` if no phrase is near.
"""

NO_PHRASE: Judgement = ("", -99.0)

DECOY_TOLERANCE, DECOY_SCALE = 1.4, 0.5
"""Margin (log per frame) by which a decoy may fit better than a spoken word; margin per unit of score."""


def limit_by_decoys(score: float, margin: float | None) -> float:
    """Return the score, reduced if the ``margin`` to the best decoy is small.

    A decoy is a common word that is not in the phrase. Without a margin (None) the score is unchanged.
    """
    return score if margin is None else min(score, (margin + DECOY_TOLERANCE) / DECOY_SCALE)


class SphinxEngine:
    """Recognition engine pocketsphinx with its English model.

    Raises ValueError for words that ``lexicon`` does not know.
    """

    program = Path(__file__).with_name("recogniser_worker.py")
    hint = "`pip install 'missiontree[listen]'` installs the recogniser"

    def __init__(self, grammar: PhraseGrammar, lexicon: Lexicon, acceptance: AcceptanceModel) -> None:
        if unknown := lexicon.unknown_words(grammar.words):
            raise ValueError(f"cannot listen for {', '.join(map(repr, unknown))}: no known pronunciation")
        self._grammar = grammar
        self._lexicon = lexicon
        self._acceptance = acceptance

    def setup_message(self) -> Mapping[str, Any]:
        """Return the setup message for a new worker process: pronunciations, and the network of words."""
        words = {word: [" ".join(ways) for ways in self._lexicon.pronunciations(word)] for word in self._grammar.words}
        return {"words": words, "arcs": self._grammar.arcs()}

    def prepare_sound(self, clip: Clip) -> bytes:
        """Return the enhanced speech of a clip, to be decoded."""
        return enhance_speech(clip.samples, clip.noise).tobytes()

    def judge(self, clip: Clip, answer: Mapping[str, Any]) -> Judgement:
        """Return the phrase and score for the worker's reply to a clip."""
        said = Decoding.from_answer(answer)
        if said is None:
            return NO_PHRASE
        return said.phrase, limit_by_decoys(
            self._acceptance.score(acceptance_features(said, clip)), answer.get("margin")
        )


class ModelEngine:
    """Recognition engine with a model that the user provides as a folder.

    The model has its own dictionary, and computes confidences of the recognised words.
    """

    program: Path
    hint: str

    def __init__(self, grammar: PhraseGrammar, model: Path) -> None:
        self._grammar = grammar
        self._model = model

    def setup_message(self) -> Mapping[str, Any]:
        """Return the setup message for a new worker process: model folder and phrases."""
        return {"model": str(self._model), "phrases": list(self._grammar.phrases)}

    def prepare_sound(self, clip: Clip) -> bytes:
        """Return the unchanged sound of a clip, to be decoded."""
        return clip.samples.tobytes()

    def judge(self, clip: Clip, answer: Mapping[str, Any]) -> Judgement:  # noqa: ARG002 - the answer says it all
        """Return the phrase and its score for a worker's reply to a clip.

        The score is computed from the lowest confidence of the words, or parts of words, in the reply.
        """
        phrase, parts = normalise(str(answer.get("phrase", ""))), answer.get("sure", ())
        if phrase not in self._grammar.phrases or not parts:
            return NO_PHRASE
        sure = min(max(min(parts), 0.001), 0.999)
        return phrase, log(sure / (1 - sure))


class VoskEngine(ModelEngine):
    """Recognition engine Vosk. It recognises only the phrases, and reports all other speech as unknown words."""

    program = Path(__file__).with_name("vosk_worker.py")
    hint = "`pip install 'missiontree[vosk]'` installs Vosk; alphacephei.com/vosk/models has models"


class SherpaEngine(ModelEngine):
    """Recognition engine sherpa-onnx with a streaming transducer.

    It transcribes all speech; a transcription that is not one of the phrases is refused.
    """

    program = Path(__file__).with_name("sherpa_worker.py")
    hint = "`pip install 'missiontree[sherpa]'` installs sherpa-onnx; its documentation has streaming transducers"


MODEL_ENGINES: Mapping[str, type[ModelEngine]] = {"vosk": VoskEngine, "sherpa": SherpaEngine}
"""Engines that need a model of the user's, by their names in robot files."""
