"""The program that recognises speech with pocketsphinx, in a process of its own: it keeps Python busy while it decodes.

Messages are lines of JSON on standard input and output; where one has ``bytes: N``, N bytes of sound follow, 16-bit
mono at 16 kHz. ``{"words": {word: [phones, ..]}, "arcs": [[from, to, probability, word], ..]}`` is what to listen for,
from state 0 to state 1, and is answered by ``{"ready": true}``. ``{"decode": id}`` with a sound is answered by what was
understood of it, and how it looks beside a loop over all phones; a phrase of one word also beside the common words of
English. It imports nothing of ours, and ends with its input.
"""

import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import pocketsphinx

LOG = 1e4
"""Scores come as exp of logarithms to the base 1.0001, which are shifted right by 10 bits: this undoes the exp."""

WIDE = {"beam": 1e-80, "wbeam": 1e-60, "pbeam": 1e-80}
"""How far a path may fall behind: grammars are small, so that hardly any need be given up early."""

NARROW = {"beam": 1e-20, "wbeam": 1e-15, "pbeam": 1e-20}
"""The same for the loop over phones, which has no end of paths."""

ALIKE = {"beam": 1e-40, "wbeam": 1e-30, "pbeam": 1e-40, "compallsen": True, "topn": 8}
"""Scores are relative to the best sound that a search looks for: only with all sounds in view two searches compare.

Twice as many Gaussians as usual count for a sound, and every frame has its own (``ds`` is 1): words are short.
"""

COMMON, SHORT = 1000, 6
"""How many of the commonest words may be decoys, and how many phones those have at most."""

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


def decoys(alone: dict[str, list[str]]) -> dict[str, list[str]]:
    """Return the common words that nobody should take for one of ``alone``, and how they are said: none sounds so."""
    ways: dict[str, list[str]] = {}
    for line in Path(pocketsphinx.get_model_path("en-us/cmudict-en-us.dict")).read_text(encoding="utf-8").splitlines():
        entry, _, phones = line.partition(" ")
        if entry[1:2].isalnum():
            ways.setdefault(entry.partition("(")[0], []).append(phones)
    model = pocketsphinx.NGramModel.readfile(pocketsphinx.get_model_path("en-us/en-us.lm.bin"))
    common = sorted(filter(str.isalpha, ways), key=lambda word: -model.prob([word]))[:COMMON]
    own = {phones for said in alone.values() for phones in said}
    return {
        word: ways[word]
        for word in common
        if word not in alone and own.isdisjoint(ways[word]) and len(ways[word][0].split()) <= SHORT
    }


class Recogniser:
    """A grammar, and a loop over phones beside it: two decoders, since beams hold for all that one does.

    A third weighs single words against the decoys.
    """

    def __init__(self) -> None:
        self.grammar: pocketsphinx.Decoder | None = None
        self.scales = decoder(**ALIKE)
        self.alone: dict[str, list[str]] = {}
        self.loop = decoder(**NARROW)
        self.loop.add_allphone_file("phones", pocketsphinx.get_model_path("en-us/en-us-phone.lm.bin"))
        self.loop.activate_search("phones")

    def listen_for(self, words: dict[str, list[str]], arcs: list[list[Any]]) -> None:
        """Take a new grammar in place of the old."""
        self.grammar = decoder(**WIDE)
        search(self.grammar, "phrases", words, [tuple(arc) for arc in arcs])
        self.alone = {word: words[word] for begin, end, _, word in arcs if (begin, end) == (0, 1)}
        self.scales = decoder(**ALIKE)
        if self.alone:
            for word, ways in self.alone.items():
                search(self.scales, f"only {word}", {word: ways}, [(0, 1, 1.0, word)])
            common = decoys(self.alone)
            search(self.scales, "decoys", common, [(0, 1, 1 / len(common), word) for word in common])

    def margin(self, word: str, sound: bytes) -> float | None:
        """Return by how much a word fits better than the best decoy, for each frame of it; None for a longer phrase."""
        if word not in self.alone:
            return None
        fits: list[Segments] = []
        for name in (f"only {word}", "decoys"):
            self.scales.activate_search(name)
            run(self.scales, sound)
            fits.append(segments(self.scales) if self.scales.hyp() else [])
        own, decoy = (sum(score for *_, score in fit) if fit else -1e9 for fit in fits)
        return (own - decoy) / max(5, sum(length for name, _, length, _ in fits[0] if not name.startswith("<")))

    def decode(self, sound: bytes) -> dict[str, Any]:
        """Return what was said, as far as it was a phrase, with all that tells whether to believe it."""
        engine = self.grammar
        if engine is None:
            return {"phrase": ""}
        engine.activate_search("phrases")
        run(engine, sound)
        found = engine.hyp()
        if found is None:
            return {"phrase": ""}
        words, frames = segments(engine), engine.n_frames()
        engine.set_alignment()
        run(engine, sound)
        aligned = engine.get_alignment() or ()
        phones = [(phone.name, phone.start, phone.duration, phone.score) for word in aligned for phone in word]
        run(self.loop, sound)
        return {
            "phrase": found.hypstr,
            "frames": frames,
            "words": words,
            "aligned": phones,
            "loop": segments(self.loop),
            "margin": self.margin(found.hypstr, sound),
        }


def main() -> None:
    """Answer until the input ends."""
    pocketsphinx.set_loglevel("FATAL")
    recogniser = Recogniser()
    for line in sys.stdin.buffer:
        message = json.loads(line)
        sound = sys.stdin.buffer.read(message.get("bytes", 0))
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
