"""What ``drivers.api.Voice`` promises, kept by a synthesiser's speaker, by printed words and by the twin."""

import sys
from collections.abc import Iterator

import pytest

from drivers.api import Voice
from drivers.errors import NotConnected
from drivers.sim.twins.voice import VoiceTwin
from drivers.voice.printed import PrintedVoice
from drivers.voice.speaker import Speaker
from drivers.voice.synthesiser import Synthesiser
from tests.contract.rigs import InRealTime, InSimulatedTime, Rig, real, twin

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
        synthesiser = Synthesiser(sys.executable, ("-S", "-c", PROGRAM))
        self.device = Speaker(synthesiser, print, report=self.notices.append, changed=self.changed)


class PrintedWordsVoice(InSimulatedTime, VoiceRig):
    def __init__(self) -> None:
        super().__init__()
        self.device = PrintedVoice(self.clock, print, changed=self.changed)


class TwinVoice(InSimulatedTime, VoiceRig):
    def __init__(self) -> None:
        super().__init__()
        twin = VoiceTwin(self.clock, print, report=self.notices.append, changed=self.changed)
        self.device = twin
        self.timeline.every(twin.PERIOD, twin.step)


@pytest.fixture(params=[real(SpokenVoice, "spoken"), pytest.param(PrintedWordsVoice, id="printed"), twin(TwinVoice)])
def rig(request: pytest.FixtureRequest) -> Iterator[VoiceRig]:
    rig: VoiceRig = request.param()
    yield rig
    rig.close()


@pytest.fixture
def voice(rig: VoiceRig) -> VoiceRig:
    """A rig whose voice is ready."""
    rig.device.open()
    return rig


def test_before_it_is_opened_it_says_so_and_nothing_else(rig: VoiceRig) -> None:
    health = rig.device.health()
    assert (health.online, health.detail != "") == (False, True)
    with pytest.raises(NotConnected, match="voice"):
        rig.device.say("hello")
    rig.device.rest()
    rig.device.close()


def test_what_is_said_takes_its_time_one_after_another(voice: VoiceRig) -> None:
    began = voice.clock.now()
    first, second = voice.device.say("hello there"), voice.device.say("you")
    assert not first.done()
    voice.until(first.done)
    assert voice.clock.now() - began >= 0.35
    assert not second.done()
    voice.until(second.done)
    assert voice.clock.now() - began >= 0.55
    voice.until(lambda: voice.changes == 2)
    health = voice.device.health()
    assert (health.online, health.detail, health.hint, health.counters["said"]) == (True, "", "", 2)


@pytest.mark.parametrize("nothing", ["", "   "])
def test_nothing_is_said_at_once(voice: VoiceRig, nothing: str) -> None:
    assert voice.device.say(nothing).done()


def test_cancelled_it_is_done_at_once_and_the_next_has_its_turn(voice: VoiceRig) -> None:
    first, second = voice.device.say("much " * 300), voice.device.say("yes")
    voice.wait(0.1)
    first.cancel()
    first.cancel()
    assert first.done()
    assert not second.done()
    voice.until(second.done)


def test_one_that_waits_may_be_cancelled_without_touching_the_other(voice: VoiceRig) -> None:
    first, second = voice.device.say("hello"), voice.device.say("much " * 300)
    second.cancel()
    assert second.done()
    assert not first.done()
    voice.until(first.done)


def test_at_rest_it_is_silent_and_may_speak_again(voice: VoiceRig) -> None:
    said = [voice.device.say("much " * 300) for _ in range(3)]
    voice.device.rest()
    voice.device.rest()
    assert all(words.done() for words in said)
    voice.until(voice.device.say("yes").done)


def test_closed_it_is_silent_and_opened_again_it_speaks(voice: VoiceRig) -> None:
    words = voice.device.say("much " * 300)
    voice.device.close()
    voice.device.close()
    assert words.done()
    assert not voice.device.health().online
    with pytest.raises(NotConnected):
        voice.device.say("no")
    voice.device.open()
    voice.until(voice.device.say("yes").done)
