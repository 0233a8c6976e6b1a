"""The program that recognises speech with pocketsphinx, in a process of its own: it keeps Python busy while it decodes.

Messages are lines of JSON on standard input and output; where one has ``bytes: N``, N bytes of sound follow, 16-bit
mono at 16 kHz. ``{"words": {word: [phones, ..]}, "arcs": [[from, to, probability, word], ..]}`` is what to listen for,
from state 0 to state 1, and is answered by ``{"ready": true}``. ``{"decode": id}`` with a sound is answered by what was
understood of it, and how it looks beside a loop over all phones; each of its words also beside the common words of
English. It ends with its input.
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

from perception.hearing.acoustic_model import AcousticModel, Contest, Entry
from perception.hearing.features import FRAME
from perception.hearing.sound import Samples, dithered

LOG = 1e4
"""Scores come as exp of logarithms to the base 1.0001, which are shifted right by 10 bits: this undoes the exp."""

WIDE = {"beam": 1e-80, "wbeam": 1e-60, "pbeam": 1e-80}
"""How far a path may fall behind: grammars are small, so that hardly any need be given up early."""

NARROW = {"beam": 1e-20, "wbeam": 1e-15, "pbeam": 1e-20}
"""The same for the loop over phones, which has no end of paths."""

HISS, FAINT = 40.0, 20.0
"""Steps of noise under everything for pocketsphinx, and for the contest: the weak ends of words decide between them."""

COMMON, SHORT = 1000, 6
"""How many of the commonest words may be decoys, and how many phones those have at most."""

CONNECTED = 1.6
"""By how much less well words fit within a phrase, as they run into each other: a logarithm for each frame."""

LEAST = 5
"""Frames of 10 ms over which a margin is spread at least."""

Segments = list[tuple[str, int, int, float]]
"""Name, first frame (of 10 ms), how many, and the score of all."""


def decoder(**settings: Any) -> pocketsphinx.Decoder:
    """Return a decoder with the English model and no words."""
    folder = pocketsphinx.get_model_path("en-us/en-us")
    return pocketsphinx.Decoder(hmm=folder, dict=None, lm=None, bestpath=False, cmn="batch", **settings)


def run(engine: pocketsphinx.Decoder, sound: bytes) -> None:
    """Decode a whole sound."""
    engine.start_utt()
    engine.process_raw(sound, no_search=False, full_utt=True)
    engine.end_utt()


def log(score: float) -> float:
    """Return a score as a logarithm."""
    return math.log(max(score, 1e-300)) * LOG


def segments(engine: pocketsphinx.Decoder) -> Segments:
    """Return what the newest decoding took each stretch of sound for."""
    return [
        (each.word, each.start_frame, each.end_frame - each.start_frame + 1, log(each.ascore)) for each in engine.seg()
    ]


def search(engine: pocketsphinx.Decoder, name: str, words: dict[str, list[str]], arcs: list[tuple[Any, ...]]) -> None:
    """Have a decoder look for a network of words, and tell it how they are said."""
    for word, ways in words.items():
        for number, phones in enumerate(ways, 1):
            engine.add_word(word if number == 1 else f"{word}({number})", phones, False)
    engine.add_fsg(name, engine.create_fsg(name, 0, 1, arcs))


def decoys(words: dict[str, list[str]]) -> dict[str, list[str]]:
    """Return the common words that nobody should take for one of ``words``, and how they are said: none sounds so."""
    model = pocketsphinx.NGramModel.readfile(pocketsphinx.get_model_path("en-us/en-us.lm.bin"))
    plain = (word for word, _ in dictionary() if word.isalpha())
    ways: dict[str, list[str]] = {
        word: [] for word in heapq.nlargest(COMMON, plain, key=lambda word: model.prob([word]))
    }
    for entry, phones in dictionary():
        if (word := entry.partition("(")[0]) in ways:
            ways[word].append(phones)
    own = {phones for said in words.values() for phones in said}
    return {
        word: said
        for word, said in ways.items()
        if word not in words and own.isdisjoint(said) and len(said[0].split()) <= SHORT
    }


def dictionary() -> Iterator[tuple[str, str]]:
    """Yield the entries of the dictionary: a word, ``word(2)`` for another way to say it, and its phones."""
    with Path(pocketsphinx.get_model_path("en-us/cmudict-en-us.dict")).open(encoding="utf-8") as lines:
        for line in lines:
            entry, _, phones = line.strip().partition(" ")
            if entry[1:2].isalnum():
                yield entry, phones


def contest(words: dict[str, list[str]]) -> Contest:
    """Return a contest of words and their decoys. Raises OSError, ValueError, KeyError for another model."""
    model = AcousticModel(Path(pocketsphinx.get_model_path("en-us/en-us")))
    everybody = {**decoys(words), **words}
    return Contest(model, [(word, way.split()) for word, ways in everybody.items() for way in ways])


class Recogniser:
    """A grammar, and a loop over phones beside it: two decoders, since beams hold for all that one does.

    Single words compete with each other and with the decoys, where the acoustic model is one whose files we can read;
    each word of a longer phrase competes with the decoys.
    """

    def __init__(self) -> None:
        self.grammar: pocketsphinx.Decoder | None = None
        self.alone: dict[str, list[str]] = {}
        self.contest: Contest | None = None
        self.loop = decoder(**NARROW)
        self.loop.add_allphone_file("phones", pocketsphinx.get_model_path("en-us/en-us-phone.lm.bin"))
        self.loop.activate_search("phones")

    def listen_for(self, words: dict[str, list[str]], arcs: list[list[Any]]) -> None:
        """Take a new grammar in place of the old."""
        self.grammar = decoder(**WIDE)
        search(self.grammar, "phrases", words, [tuple(arc) for arc in arcs])
        self.alone = {word: words[word] for begin, end, _, word in arcs if (begin, end) == (0, 1)}
        self.contest = None
        for word in self.alone:
            search(self.grammar, only(word), {}, [(0, 1, 1.0, word)])
        with suppress(OSError, ValueError, KeyError):  # another model than that which pocketsphinx brings along
            self.contest = contest(words)

    def decode(self, sound: Samples) -> dict[str, Any]:
        """Return what was said, as far as it was a phrase, with all that tells whether to believe it."""
        engine = self.grammar
        if engine is None:
            return {"phrase": ""}
        loud, faint = dithered(sound, HISS).tobytes(), dithered(sound, FAINT)
        phrase = understood(engine, "phrases", loud)
        entries: list[Entry] = []
        if phrase in self.alone and self.contest is not None:
            entries = self.contest.entries(faint)
            best = next(entry.word for entry in entries if entry.word in self.alone)
            if best != phrase:
                phrase = understood(engine, only(best), loud)
        if not phrase:
            return {"phrase": ""}
        words, frames = segments(engine), engine.n_frames()
        engine.set_alignment()
        run(engine, loud)
        aligned = engine.get_alignment() or ()
        phones = [(phone.name, phone.start, phone.duration, phone.score) for word in aligned for phone in word]
        run(self.loop, loud)
        return {
            "phrase": phrase,
            "frames": frames,
            "words": words,
            "aligned": phones,
            "loop": segments(self.loop),
            "margin": margin(phrase, entries, self.alone) if entries else self.connected(phrase, words, faint),
        }

    def connected(self, phrase: str, words: Segments, sound: Samples) -> float | None:
        """Return the mean margin of the words of a phrase, each by its frames; None without a contest."""
        if self.contest is None:
            return None
        total, frames = 0.0, 0
        for entry, start, length, _ in words:
            word = entry.partition("(")[0]
            if word in phrase.split():
                part = sound[start * FRAME : (start + length) * FRAME]
                total += length * margin(word, self.contest.entries(part), (word,))
                frames += length
        return total / frames + CONNECTED if frames else None


def margin(word: str, entries: list[Entry], own: Container[str]) -> float:
    """Return by how much a word fits better than the best of those that are not ``own``, for each frame of it.

    It is a natural logarithm.
    """
    mine = next(entry for entry in entries if entry.word == word)
    best = next(entry for entry in entries if entry.word not in own)
    return (mine.score - best.score) / max(LEAST, mine.frames)


def only(word: str) -> str:
    """Return the name of the search for one word."""
    return f"only {word}"


def understood(engine: pocketsphinx.Decoder, name: str, sound: bytes) -> str:
    """Return what a search makes of a sound; empty for nothing."""
    engine.activate_search(name)
    run(engine, sound)
    found = engine.hyp()
    return "" if found is None else str(found.hypstr)


def main() -> None:
    """Answer until the input ends."""
    pocketsphinx.set_loglevel("FATAL")
    recogniser = Recogniser()
    for line in sys.stdin.buffer:
        message = json.loads(line)
        sound = np.frombuffer(sys.stdin.buffer.read(message.get("bytes", 0)), np.int16)
        if "arcs" in message:
            recogniser.listen_for(message["words"], message["arcs"])
            answer: dict[str, Any] = {"ready": True}
        else:
            began = time.process_time()
            answer = {"decoded": message["decode"], **recogniser.decode(sound), "spent": time.process_time() - began}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
