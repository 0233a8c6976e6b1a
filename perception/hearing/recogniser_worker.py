"""Worker process that recognises speech with pocketsphinx, which holds the GIL while it decodes.

Messages are lines of JSON on standard input and output. If one has ``bytes: N``, N bytes of sound follow, 16-bit mono
at 16 kHz. ``{"words": {word: [phones, ..]}, "arcs": [[from, to, probability, word], ..]}`` sets the grammar, from state
0 to state 1, and is answered by ``{"ready": true}``. ``{"decode": id}`` with a sound is answered by the recognised
phrase and its scores. For comparison, the answer also has the scores of free speech, recognised as any sequence of
phones; each word of the phrase is also compared with common English words. The process ends when its standard input is
closed.
"""

import heapq
import json
import math
import os
import sys
import time
from collections.abc import Container, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its matrices are small: threads would wait for each other

import numpy as np
import pocketsphinx

from perception.hearing.acoustic_model import AcousticModel, WordContest, WordScore
from perception.hearing.features import DECODER_FRAME
from perception.hearing.sound import Samples, add_noise

LOG_SCALE = 1e4
"""Ratio of natural logarithms to pocketsphinx's scores.

The scores are logarithms to the base 1.0001, shifted right by 10 bits.
"""

GRAMMAR_BEAMS = {"beam": 1e-80, "wbeam": 1e-60, "pbeam": 1e-80}
"""Search beams for the grammar: it is small, so hardly any path needs to be dropped early."""

LOOP_BEAMS = {"beam": 1e-20, "wbeam": 1e-15, "pbeam": 1e-20}
"""Search beams for the loop over phones, which has countless paths."""

DECODER_NOISE, CONTEST_NOISE = 40.0, 20.0
"""Standard deviation of noise added for pocketsphinx, and for the contest, in which weak ends of words are decisive."""

MAX_COMMON_WORDS, MAX_DECOY_PHONES = 1000, 6
"""Number of the most common words that may be decoys, and the largest number of their phones."""

CONNECTED_MARGIN = 1.6
"""Log likelihood per frame that is added to the margin of a word within a longer phrase.

Words of a phrase run into each other, and so fit less well than single words.
"""

MIN_MARGIN_FRAMES = 5
"""Smallest number of frames (10 ms) by which the margin of a word is divided, so that short words get no large margin.
"""

Segments = list[tuple[str, int, int, float]]
"""Segments of a decoding: name, first frame (of 10 ms), number of frames, and total score of each."""


def make_decoder(**settings: Any) -> pocketsphinx.Decoder:
    """Return a decoder with the English model and without words."""
    folder = pocketsphinx.get_model_path("en-us/en-us")
    return pocketsphinx.Decoder(hmm=folder, dict=None, lm=None, bestpath=False, cmn="batch", **settings)


def decode_sound(engine: pocketsphinx.Decoder, sound: bytes) -> None:
    """Decode a whole sound; the decoder keeps the result."""
    engine.start_utt()
    engine.process_raw(sound, no_search=False, full_utt=True)
    engine.end_utt()


def to_log(score: float) -> float:
    """Return a score of pocketsphinx as a natural logarithm."""
    return math.log(max(score, 1e-300)) * LOG_SCALE


def decoded_segments(engine: pocketsphinx.Decoder) -> Segments:
    """Return the segments of the last decoding."""
    return [
        (each.word, each.start_frame, each.end_frame - each.start_frame + 1, to_log(each.ascore))
        for each in engine.seg()
    ]


def add_search(
    engine: pocketsphinx.Decoder, name: str, words: dict[str, list[str]], arcs: list[tuple[Any, ...]]
) -> None:
    """Add a search named ``name`` to a decoder, for a network of words.

    ``words`` are the pronunciations of each word, ``arcs`` the arcs of the network (see ``grammar.Arc``).
    """
    for word, ways in words.items():
        for number, phones in enumerate(ways, 1):
            engine.add_word(word if number == 1 else f"{word}({number})", phones, False)
    engine.add_fsg(name, engine.create_fsg(name, 0, 1, arcs))


def find_decoys(words: dict[str, list[str]]) -> dict[str, list[str]]:
    """Return common words as decoys, with their pronunciations, which are compared with the ``words`` of a mission.

    Words that sound exactly like one of ``words`` are left out.
    """
    model = pocketsphinx.NGramModel.readfile(pocketsphinx.get_model_path("en-us/en-us.lm.bin"))
    plain = (word for word, _ in iter_dictionary() if word.isalpha())
    ways: dict[str, list[str]] = {
        word: [] for word in heapq.nlargest(MAX_COMMON_WORDS, plain, key=lambda word: model.prob([word]))
    }
    for entry, phones in iter_dictionary():
        if (word := entry.partition("(")[0]) in ways:
            ways[word].append(phones)
    own = {phones for said in words.values() for phones in said}
    return {
        word: said
        for word, said in ways.items()
        if word not in words and own.isdisjoint(said) and len(said[0].split()) <= MAX_DECOY_PHONES
    }


def iter_dictionary() -> Iterator[tuple[str, str]]:
    """Yield the entries of the dictionary: a word, or ``word(2)`` for another pronunciation, and its phones."""
    with Path(pocketsphinx.get_model_path("en-us/cmudict-en-us.dict")).open(encoding="utf-8") as lines:
        for line in lines:
            entry, _, phones = line.strip().partition(" ")
            if entry[1:2].isalnum():
                yield entry, phones


def make_contest(words: dict[str, list[str]]) -> WordContest:
    """Return the comparison of single words with each other and with decoys.

    Raises OSError, ValueError or KeyError if the acoustic model's files cannot be used.
    """
    model = AcousticModel(Path(pocketsphinx.get_model_path("en-us/en-us")))
    everybody = {**find_decoys(words), **words}
    return WordContest(model, [(word, way.split()) for word, ways in everybody.items() for way in ways])


class SpeechRecogniser:
    """Recogniser of phrases: one decoder with the grammar, and one with a loop over all phones.

    There are two decoders, because beams can only be set for a whole decoder. Single words are compared with each other
    and with decoys, if the acoustic model's files can be read. Each word of a longer phrase is compared with decoys.
    """

    def __init__(self) -> None:
        self.grammar: pocketsphinx.Decoder | None = None
        self.single_words: dict[str, list[str]] = {}
        self.contest: WordContest | None = None
        self.loop = make_decoder(**LOOP_BEAMS)
        self.loop.add_allphone_file("phones", pocketsphinx.get_model_path("en-us/en-us-phone.lm.bin"))
        self.loop.activate_search("phones")

    def set_grammar(self, words: dict[str, list[str]], arcs: list[list[Any]]) -> None:
        """Replace the phrases to listen for.

        ``words`` are the pronunciations of each word, ``arcs`` the arcs of the network of phrases (see
        ``grammar.Arc``).
        """
        self.grammar = make_decoder(**GRAMMAR_BEAMS)
        add_search(self.grammar, "phrases", words, [tuple(arc) for arc in arcs])
        self.single_words = {word: words[word] for begin, end, _, word in arcs if (begin, end) == (0, 1)}
        self.contest = None
        for word in self.single_words:
            add_search(self.grammar, single_word_search(word), {}, [(0, 1, 1.0, word)])
        with suppress(OSError, ValueError, KeyError):  # another model than that which pocketsphinx brings along
            self.contest = make_contest(words)

    def decode(self, sound: Samples) -> dict[str, Any]:
        """Return the recognised phrase with its scores, or an empty phrase."""
        engine = self.grammar
        if engine is None:
            return {"phrase": ""}
        loud, faint = add_noise(sound, DECODER_NOISE).tobytes(), add_noise(sound, CONTEST_NOISE)
        phrase = decode_phrase(engine, "phrases", loud)
        entries: list[WordScore] = []
        if phrase in self.single_words and self.contest is not None:
            entries = self.contest.rank_words(faint)
            best = next(entry.word for entry in entries if entry.word in self.single_words)
            if best != phrase:
                phrase = decode_phrase(engine, single_word_search(best), loud)
        if not phrase:
            return {"phrase": ""}
        words, frames = decoded_segments(engine), engine.n_frames()
        engine.set_alignment()
        decode_sound(engine, loud)
        aligned = engine.get_alignment() or ()
        phones = [(phone.name, phone.start, phone.duration, phone.score) for word in aligned for phone in word]
        decode_sound(self.loop, loud)
        return {
            "phrase": phrase,
            "frames": frames,
            "words": words,
            "aligned": phones,
            "loop": decoded_segments(self.loop),
            "margin": margin(phrase, entries, self.single_words)
            if entries
            else self.connected_margin(phrase, words, faint),
        }

    def connected_margin(self, phrase: str, words: Segments, sound: Samples) -> float | None:
        """Return the mean margin of the words of ``phrase`` over their decoys, weighted by length.

        ``words`` are the segments of the decoding of ``sound``. None if decoys are not compared.
        """
        if self.contest is None:
            return None
        total, frames = 0.0, 0
        for entry, start, length, _ in words:
            word = entry.partition("(")[0]
            if word in phrase.split():
                part = sound[start * DECODER_FRAME : (start + length) * DECODER_FRAME]
                total += length * margin(word, self.contest.rank_words(part), (word,))
                frames += length
        return total / frames + CONNECTED_MARGIN if frames else None


def margin(word: str, entries: list[WordScore], own: Container[str]) -> float:
    """Return by how much a word fits better than the best word outside ``own``, per frame: a natural logarithm.

    ``entries`` are the scores of all compared words, the best first.
    """
    mine = next(entry for entry in entries if entry.word == word)
    best = next(entry for entry in entries if entry.word not in own)
    return (mine.score - best.score) / max(MIN_MARGIN_FRAMES, mine.frames)


def single_word_search(word: str) -> str:
    """Return the name of the search for one word."""
    return f"only {word}"


def decode_phrase(engine: pocketsphinx.Decoder, name: str, sound: bytes) -> str:
    """Return the text that the search ``name`` of a decoder recognises in a sound; empty if it recognises none."""
    engine.activate_search(name)
    decode_sound(engine, sound)
    found = engine.hyp()
    return "" if found is None else str(found.hypstr)


def main() -> None:
    """Answer requests on standard input until it ends."""
    pocketsphinx.set_loglevel("FATAL")
    recogniser = SpeechRecogniser()
    for line in sys.stdin.buffer:
        message = json.loads(line)
        sound = np.frombuffer(sys.stdin.buffer.read(message.get("bytes", 0)), np.int16)
        if "arcs" in message:
            recogniser.set_grammar(message["words"], message["arcs"])
            answer: dict[str, Any] = {"ready": True}
        else:
            began = time.process_time()
            answer = {"decoded": message["decode"], **recogniser.decode(sound), "spent": time.process_time() - began}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
