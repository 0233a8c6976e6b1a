"""What ``perception.api.Hearing`` promises, kept by ears on a recording and by their twin."""

import wave
from abc import abstractmethod
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from drivers.api import Health
from drivers.clock import ManualClock, SystemClock
from drivers.microphone.twin import HearingTwin
from drivers.microphone.wav_microphone import WavMicrophone
from drivers.sim.person_actions import PersonReply
from drivers.sim.timeline import Timeline
from drivers.transport.worker_process import WorkerProcess
from perception.api import Hearing, Words
from perception.hearing.acceptance import load_acceptance
from perception.hearing.engines import SphinxEngine
from perception.hearing.grammar import PhraseGrammar
from perception.hearing.lexicon import load_english
from perception.hearing.listener import Ears, SpeechListener
from tests.benchmarks.speaking import Speaking
from tests.contract.rigs import simulated
from tests.waiting import wait_until

PHRASES = PhraseGrammar.from_texts(["yes", "hello robot", "turn left"])
STEP = 0.1


class HearingRig:
    """Ears, a clock that is made to pass, and a person before them."""

    hearing: Hearing

    def __init__(self) -> None:
        self.speaking: list[tuple[float, float]] = []

    def deaf(self, start: float, end: float) -> bool:
        return any(start < until and end > since for since, until in self.speaking)

    @abstractmethod
    def people_say(self, *spoken: tuple[float, str]) -> None:
        """Set what is said, and when, from the opening on; at the beginning only."""

    @abstractmethod
    def open(self) -> None: ...

    @abstractmethod
    def close(self) -> None: ...

    @abstractmethod
    def health(self) -> Health: ...

    @abstractmethod
    def run(self, until: float) -> None:
        """Let time pass."""


class RecordedEars(HearingRig):
    def __init__(self, folder: Path) -> None:
        super().__init__()
        lexicon = load_english()
        assert lexicon is not None
        engine = SphinxEngine(PHRASES, lexicon, load_acceptance())
        worker = WorkerProcess("microphone", engine.program, SystemClock())
        self.clock = ManualClock()
        self.path = folder / "people.wav"
        self.microphone = WavMicrophone(self.path, self.clock)
        self.listener = SpeechListener(worker, engine, is_deaf=self.deaf)
        self.hearing = self.listener
        self.ears = Ears(self.microphone, self.listener, worker)

    def people_say(self, *spoken: tuple[float, str]) -> None:
        sound = np.random.default_rng(0).normal(0, 25, 16000 * 20)
        with Speaking() as speaking:
            for when, text in spoken:
                said = speaking.say(text, "en-us", 150)
                sound[round(when * 16000) : round(when * 16000) + len(said)] += said * 0.4
        with wave.open(str(self.path), "wb") as file:
            file.setnchannels(1)
            file.setsampwidth(2)
            file.setframerate(16000)
            file.writeframes(np.clip(sound, -32768, 32767).astype("<i2").tobytes())

    def open(self) -> None:
        self.ears.open()
        wait_until(lambda: self.listener.is_ready)
        self.microphone.open()

    def close(self) -> None:
        self.ears.close()
        self.microphone.close()

    def health(self) -> Health:
        return self.microphone.health()

    def run(self, until: float) -> None:
        while self.clock.now() < until:
            self.clock.advance(STEP)
            wait_until(self._caught_up)

    def _caught_up(self) -> bool:
        return (self.hearing.listened() or 0.0) > self.clock.now() - STEP and not self.listener.is_pending


class TwinEars(HearingRig):
    def __init__(self, folder: Path) -> None:  # noqa: ARG002 - all rigs are made alike
        super().__init__()
        self.timeline = Timeline()
        self.twin = HearingTwin(self.timeline.clock, PHRASES, Words, is_deaf=self.deaf)
        self.hearing = self.twin
        self.timeline.call_every(self.twin.STEP_INTERVAL, self.twin.step)

    def people_say(self, *spoken: tuple[float, str]) -> None:
        for when, text in spoken:
            self.timeline.call_at(when, partial(self.twin.on_reply, PersonReply("ann", text, when)))

    def open(self) -> None:
        self.twin.open()

    def close(self) -> None:
        self.twin.close()

    def health(self) -> Health:
        return self.twin.health()

    def run(self, until: float) -> None:
        self.timeline.run_until(until)


@pytest.fixture(params=[pytest.param(RecordedEars, id="recorded"), simulated(TwinEars, "twin")])
def rig(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[HearingRig]:
    if request.param is RecordedEars:
        pytest.importorskip("pocketsphinx")
        pytest.importorskip("espeakng_loader")
    rig: HearingRig = request.param(tmp_path)
    yield rig
    rig.close()


def test_unopened_hearing_is_offline_and_has_no_phrases(rig: HearingRig) -> None:
    hearing = rig.hearing
    assert (hearing.words(), hearing.refused(), hearing.listened(), hearing.level()) == ((), (), None, -90)
    health = rig.health()
    assert (health.online, health.detail != "") == (False, True)
    rig.close()


def test_phrases_are_understood_in_their_order_and_other_speech_is_refused(rig: HearingRig) -> None:
    rig.people_say((1.0, "hello robot"), (4.0, "the children are asleep upstairs"), (8.0, "yes"))
    rig.open()
    rig.run(11.0)
    newest, before = rig.hearing.words()
    assert (before.phrase, newest.phrase) == ("hello robot", "yes")
    assert [before.start, newest.start] == pytest.approx([1.0, 8.0], abs=0.2)
    (refused,) = rig.hearing.refused()
    assert before.id < refused.id < newest.id
    assert refused.start == pytest.approx(4.0, abs=0.2)
    assert refused.score < 0 < min(before.score, newest.score)
    for words in (before, refused, newest):
        assert words.start < words.stamp < (rig.hearing.listened() or 0.0)
    assert rig.hearing.listened() == pytest.approx(11.0, abs=0.2)


def test_phrases_during_own_speech_are_ignored(rig: HearingRig) -> None:
    rig.speaking = [(1.05, 2.9)]
    rig.people_say((1.0, "turn left"), (4.0, "yes"))
    rig.open()
    rig.run(7.0)
    assert [words.phrase for words in rig.hearing.words()] == ["yes"]


def test_sound_level_rises_with_speech(rig: HearingRig) -> None:
    rig.people_say((1.0, "hello robot"))
    rig.open()
    rig.run(0.8)
    quiet = rig.hearing.level()
    rig.run(1.4)
    assert -90 <= quiet < rig.hearing.level() - 20 < 0


def test_closed_in_any_state_and_more_than_once(rig: HearingRig) -> None:
    rig.close()
    rig.people_say((1.0, "hello robot"))
    rig.open()
    rig.run(1.2)
    rig.close()
    rig.close()
    assert rig.hearing.words() == ()
    assert not rig.health().online
