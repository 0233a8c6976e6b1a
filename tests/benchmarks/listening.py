"""Streams of speech through the whole listening path: WAV file, microphone, end-pointer, recogniser, judgement."""

import json
import time
import wave
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event
from typing import Any

from drivers.clock import ManualClock, SystemClock
from drivers.microphone.wav_microphone import WavMicrophone
from drivers.transport.worker_process import WorkerProcess
from perception.hearing.acceptance import AcceptanceModel
from perception.hearing.engines import NO_PHRASE, Judgement, SphinxEngine
from perception.hearing.features import Decoding, acceptance_features
from perception.hearing.grammar import PhraseGrammar
from perception.hearing.lexicon import load_english
from perception.hearing.listener import SpeechListener
from perception.hearing.sound import Clip
from tests.benchmarks.spoken import RATE, Samples, Stream

UNTAUGHT = AcceptanceModel((), (), (), (), 0.0)
"""What judges before anything was learned."""


@dataclass(frozen=True, slots=True)
class Take:
    """One clip that was cut out: what it was taken for, and the figures by which that is judged; none for nothing.

    ``margin`` is that of a phrase of one word over the decoys.
    """

    start: float
    end: float
    phrase: str
    figures: Mapping[str, float]
    margin: float | None = None


@dataclass(frozen=True, slots=True)
class Result:
    """What became of a stream: its clips, and the seconds of processor that the recogniser and the robot spent."""

    key: str
    background: str
    voice: str
    seconds: float
    spent: float
    spent_here: float
    said: tuple[Mapping[str, Any], ...]
    takes: tuple[Take, ...]


class NotingSphinx(SphinxEngine):
    """Pocketsphinx that keeps what it is shown."""

    def __init__(self, grammar: PhraseGrammar) -> None:
        lexicon = load_english()
        if lexicon is None:
            raise SystemExit("pocketsphinx is not installed\n  try: pip install 'missiontree[listen]'")
        super().__init__(grammar, lexicon, UNTAUGHT)
        self.takes: list[Take] = []
        self.spent = 0.0

    def judge(self, clip: Clip, answer: Mapping[str, Any]) -> Judgement:
        """Note it, and accept everything."""
        said = Decoding.from_answer(answer)
        figures = {} if said is None else acceptance_features(said, clip)
        phrase, margin = "" if said is None else said.phrase, answer.get("margin")
        self.takes.append(Take(clip.start, clip.end, phrase, figures, margin))
        self.spent += float(answer["spent"])
        return NO_PHRASE if said is None else (said.phrase, 0.0)


def hear(stream: Stream, folder: Path) -> Result:
    """Play one stream to the ears, as fast as they can follow."""
    path = folder / "stream.wav"
    write(path, stream.samples)
    engine, clock, heard = NotingSphinx(PhraseGrammar.from_texts(stream.phrases)), ManualClock(), Event()
    worker = WorkerProcess("ears", engine.program, SystemClock())
    listener = SpeechListener(worker, engine, changed=heard.set)
    microphone = WavMicrophone(path, clock)
    worker.open(listener)
    began = time.process_time()
    try:
        microphone.open()
        newest = -1
        while clock.now() < len(stream.samples) / RATE + 1:
            clock.advance(0.1)
            for piece in microphone.read(newest):
                newest = piece.number
                listener.process(piece)
            while listener.is_pending:
                heard.wait(0.2)
                heard.clear()
    finally:
        worker.close()
        microphone.close()
    return Result(
        stream.key,
        stream.background,
        stream.voice,
        len(stream.samples) / RATE,
        engine.spent,
        time.process_time() - began,
        tuple(asdict(each) for each in stream.said),
        tuple(engine.takes),
    )


def write(path: Path, samples: Samples) -> None:
    """Write a sound as a WAV file."""
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes(samples.astype("<i2").tobytes())


def hear_all(streams: Iterable[Stream], results: Path) -> None:
    """Play all streams that have no result in a file yet, and add theirs to it: one line of JSON each."""
    done = {result.key for result in read(results)}
    with TemporaryDirectory() as folder:
        for stream in streams:
            if stream.key not in done:
                result = hear(stream, Path(folder))
                with results.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(result)) + "\n")
                print(f"{stream.key}: {len(result.said)} said, {len(result.takes)} heard", flush=True)


def read(results: Path) -> Iterator[Result]:
    """Yield the results of a file; none where there is no file."""
    if results.exists():
        for line in results.read_text(encoding="utf-8").splitlines():
            found = json.loads(line)
            yield Result(**{**found, "takes": tuple(Take(**each) for each in found["takes"])})
