"""What ``drivers.api.Voice`` promises, kept by espeak-ng and a player, by a program, by printed words and the twin."""

import sys
import wave
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.api import Priority, SpeechStyle, Voice
from drivers.errors import BadRequest, NotConnected
from drivers.sound.engines import EspeakEngine
from drivers.sound.player import SoundPlayer
from drivers.sound.printed_voice import PrintedVoice
from drivers.sound.speech_programs import ProgramEngine, Synthesiser
from drivers.voice.speech import SpeechVoice
from drivers.voice.twin import VoiceTwin
from tests.contract.rigs import InRealTime, InSimulatedTime, Rig, simulated

PROGRAM = "import sys, threading; threading.Event().wait(0.2 * len(sys.stdin.read().split()))"
"""Stands in for a synthesiser: it takes 0.2 s for a word."""


class VoiceRig(Rig):
    device: Voice

    def unplug(self) -> None:
        raise NotImplementedError("words have no plug")

    def plug_in(self) -> None:
        raise NotImplementedError("words have no plug")

    def close(self) -> None:
        self.device.close()


class SpokenVoice(InRealTime, VoiceRig):
    def __init__(self) -> None:
        super().__init__()
        engine = ProgramEngine(Synthesiser(sys.executable, ("-S", "-c", PROGRAM)), self.clock)
        self.device = SpeechVoice(
            self.clock, engine, SoundPlayer(self.clock, backend="null"), print, changed=self.changed
        )


class EspeakVoice(InRealTime, VoiceRig):
    """Plays into nothing, in real time."""

    def __init__(self) -> None:
        super().__init__()
        engine = EspeakEngine(self.clock, default_manner=SpeechStyle())
        self.device = SpeechVoice(
            self.clock, engine, SoundPlayer(self.clock, backend="null"), print, changed=self.changed
        )


class PrintedWordsVoice(InSimulatedTime, VoiceRig):
    def __init__(self) -> None:
        super().__init__()
        self.device = PrintedVoice(self.clock, print, changed=self.changed)


class TwinVoice(InSimulatedTime, VoiceRig):
    def __init__(self) -> None:
        super().__init__()
        twin = VoiceTwin(self.clock, print, report=self.notices.append, changed=self.changed)
        self.device = twin
        self.timeline.call_every(twin.STEP_INTERVAL, twin.step)


@pytest.fixture(
    params=[
        pytest.param(EspeakVoice, id="espeak"),
        pytest.param(SpokenVoice, id="program"),
        pytest.param(PrintedWordsVoice, id="printed"),
        simulated(TwinVoice, "twin"),
    ]
)
def rig(request: pytest.FixtureRequest) -> Iterator[VoiceRig]:
    rig: VoiceRig = request.param()
    yield rig
    rig.close()


@pytest.fixture
def voice(rig: VoiceRig) -> VoiceRig:
    """A rig whose voice is ready."""
    rig.device.open()
    return rig


def test_unopened_voice_is_offline_and_refuses_speech(rig: VoiceRig) -> None:
    health = rig.device.health()
    assert (health.online, health.detail != "") == (False, True)
    with pytest.raises(NotConnected, match="voice"):
        rig.device.say("hello")
    rig.device.rest()
    rig.device.close()


def test_speech_is_queued_and_takes_its_time(voice: VoiceRig) -> None:
    began = voice.clock.now()
    first, second = voice.device.say("hello there"), voice.device.say("you")
    assert not first.done()
    voice.until(first.done)
    assert voice.clock.now() - began >= 0.35
    assert not second.done()
    voice.until(second.done)
    assert voice.clock.now() - began >= 0.55
    first.cancel()
    assert not first.cancelled
    voice.until(lambda: voice.changes == 2)
    health = voice.device.health()
    assert (health.online, health.detail, health.hint, health.counters["said"]) == (True, "", "", 2)


@pytest.mark.parametrize("nothing", ["", "   "])
def test_empty_speech_ends_at_once(voice: VoiceRig, nothing: str) -> None:
    assert voice.device.say(nothing).done()


def test_cancelled_speech_ends_at_once_and_the_next_starts(voice: VoiceRig) -> None:
    first, second = voice.device.say("much " * 300), voice.device.say("yes")
    voice.wait(0.1)
    first.cancel()
    first.cancel()
    assert first.done()
    assert first.cancelled
    assert not second.done()
    voice.until(second.done)


def test_queued_speech_can_be_cancelled_alone(voice: VoiceRig) -> None:
    first, second = voice.device.say("hello"), voice.device.say("much " * 300)
    second.cancel()
    assert second.done()
    assert not first.done()
    voice.until(first.done)


def test_resting_voice_is_silent_and_can_speak_again(voice: VoiceRig) -> None:
    said = [voice.device.say("much " * 300) for _ in range(3)]
    voice.device.rest()
    voice.device.rest()
    assert all(words.done() and words.cancelled for words in said)
    voice.until(voice.device.say("yes").done)


def test_closed_voice_is_silent_and_speaks_again_once_opened(voice: VoiceRig) -> None:
    words = voice.device.say("much " * 300)
    voice.device.close()
    voice.device.close()
    assert words.done()
    assert not voice.device.health().online
    with pytest.raises(NotConnected):
        voice.device.say("no")
    voice.device.open()
    voice.until(voice.device.say("yes").done)


def test_speaking_returns_the_current_speech_with_its_start(voice: VoiceRig) -> None:
    assert voice.device.speaking() is None
    first, second = voice.device.say("hello there"), voice.device.say("you")
    began = voice.clock.now()
    voice.until(lambda: voice.device.speaking() is first)
    assert first.started is not None
    assert began <= first.started <= voice.clock.now()
    assert (second.started, list(second.mouth)) == (None, [])
    voice.until(lambda: voice.device.speaking() is second)
    assert first.done()
    voice.until(lambda: second.done() and voice.device.speaking() is None)


def test_high_priority_speech_preempts_and_the_other_is_repeated(voice: VoiceRig) -> None:
    low, usual = voice.device.say("one two", priority=Priority.LOW), voice.device.say("three four")
    voice.until(lambda: voice.device.speaking() is usual)
    assert low.started is None
    began = usual.started
    high = voice.device.say("stop", priority=Priority.HIGH)
    voice.until(high.done)
    assert not usual.done()
    voice.until(lambda: voice.device.speaking() is usual)
    assert usual.started is not None
    assert began is not None
    assert usual.started > began
    voice.until(low.done)
    assert usual.done()
    voice.until(lambda: voice.changes == 3)


def test_preempted_speech_can_be_cancelled_in_the_queue(voice: VoiceRig) -> None:
    usual = voice.device.say("much " * 300)
    voice.until(lambda: voice.device.speaking() is usual)
    high = voice.device.say("stop", priority=Priority.HIGH)
    voice.until(lambda: voice.device.speaking() is high)
    usual.cancel()
    assert usual.done()
    voice.until(high.done)
    voice.until(lambda: voice.device.speaking() is None)


@pytest.fixture
def bell(tmp_path: Path) -> Path:
    """A sound of 0.4 s."""
    path = tmp_path / "bell.wav"
    with wave.open(str(path), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(bytes(4 * 3200))
    return path


def test_sound_is_played_in_queue_order_for_its_duration(voice: VoiceRig, bell: Path) -> None:
    first, second, third = voice.device.say("you"), voice.device.play(bell), voice.device.say("you")
    voice.until(lambda: voice.device.speaking() is second)
    assert first.done()
    began = second.started
    voice.until(second.done)
    assert began is not None
    assert voice.clock.now() - began >= 0.2  # half of it: the player's word that it has begun may come late
    assert not third.done()
    voice.until(third.done)


def test_cancelled_sound_is_silent(voice: VoiceRig, bell: Path) -> None:
    sound = voice.device.play(bell)
    voice.until(lambda: voice.device.speaking() is sound)
    sound.cancel()
    assert sound.done()
    voice.until(lambda: voice.device.speaking() is None)


def test_invalid_sound_file_is_refused(voice: VoiceRig, tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="no such file") as raised:
        voice.device.play(tmp_path / "none.wav")
    assert raised.value.hint
    (tmp_path / "words.wav").write_text("these are words")
    with pytest.raises(BadRequest, match="not a playable WAV"):
        voice.device.play(tmp_path / "words.wav")
