"""What recognises speech: how each program is asked, and how its answers are judged."""

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
"""The nearest phrase and how surely it was said: the logarithm of the odds. No phrase at all is ``NO_PHRASE``."""

NO_PHRASE: Judgement = ("", -99.0)

DECOY_TOLERANCE, DECOY_SCALE = 1.4, 0.5
"""By how much the best decoy may fit better than a word that was said, a logarithm for each frame; and how much more
makes the odds e times as high."""


def limit_by_decoys(score: float, margin: float | None) -> float:
    """Return a score, but no more than the decoys leave: ``margin`` is how much better than they it fits."""
    return score if margin is None else min(score, (margin + DECOY_TOLERANCE) / DECOY_SCALE)


class SphinxEngine:
    """Pocketsphinx with its English model. Words of the grammar that ``lexicon`` does not know raise ValueError."""

    program = Path(__file__).with_name("recogniser_worker.py")
    hint = "`pip install 'missiontree[listen]'` installs the recogniser"

    def __init__(self, grammar: PhraseGrammar, lexicon: Lexicon, acceptance: AcceptanceModel) -> None:
        if unknown := lexicon.unknown_words(grammar.words):
            raise ValueError(f"cannot listen for {', '.join(map(repr, unknown))}: nobody says how it is pronounced")
        self._grammar = grammar
        self._lexicon = lexicon
        self._acceptance = acceptance

    def setup_message(self) -> Mapping[str, Any]:
        """Return what a new process must be told: how words are said, and in what order they come."""
        words = {word: [" ".join(ways) for ways in self._lexicon.pronunciations(word)] for word in self._grammar.words}
        return {"words": words, "arcs": self._grammar.arcs()}

    def prepare_sound(self, clip: Clip) -> bytes:
        """Return what is decoded of a clip: speech made clearer."""
        return enhance_speech(clip.samples, clip.noise).tobytes()

    def judge(self, clip: Clip, answer: Mapping[str, Any]) -> Judgement:
        """Return what an answer means."""
        said = Decoding.from_answer(answer)
        if said is None:
            return NO_PHRASE
        return said.phrase, limit_by_decoys(
            self._acceptance.score(acceptance_features(said, clip)), answer.get("margin")
        )


class ModelEngine:
    """A recogniser that takes the model in a folder of the user's, has its own dictionary, and says how sure it is."""

    program: Path
    hint: str

    def __init__(self, grammar: PhraseGrammar, model: Path) -> None:
        self._grammar = grammar
        self._model = model

    def setup_message(self) -> Mapping[str, Any]:
        """Return what a new process must be told: where the model is, and the phrases."""
        return {"model": str(self._model), "phrases": list(self._grammar.phrases)}

    def prepare_sound(self, clip: Clip) -> bytes:
        """Return what is decoded of a clip: all of it, as it is."""
        return clip.samples.tobytes()

    def judge(self, clip: Clip, answer: Mapping[str, Any]) -> Judgement:  # noqa: ARG002 - the answer says it all
        """Return what an answer means: a phrase is as sure as its least sure part; others beside it are refused."""
        phrase, parts = normalise(str(answer.get("phrase", ""))), answer.get("sure", ())
        if phrase not in self._grammar.phrases or not parts:
            return NO_PHRASE
        sure = min(max(min(parts), 0.001), 0.999)
        return phrase, log(sure / (1 - sure))


class VoskEngine(ModelEngine):
    """Vosk. It looks for the phrases alone, and has an "unknown" of its own for all else."""

    program = Path(__file__).with_name("vosk_worker.py")
    hint = "`pip install 'missiontree[vosk]'` installs Vosk; alphacephei.com/vosk/models has models"


class SherpaEngine(ModelEngine):
    """Sherpa-onnx with a streaming transducer. It writes down whatever was said, of which only the phrases count."""

    program = Path(__file__).with_name("sherpa_worker.py")
    hint = "`pip install 'missiontree[sherpa]'` installs sherpa-onnx; its documentation has streaming transducers"


MODEL_ENGINES: Mapping[str, type[ModelEngine]] = {"vosk": VoskEngine, "sherpa": SherpaEngine}
"""Those that need a model of the user's, by what robot files call them."""
