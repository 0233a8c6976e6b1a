"""Ears that do not hear their own robot."""

import pytest

from drivers.clock import ManualClock
from drivers.sound.printed_voice import PrintedVoice
from missions.assembly.half_duplex import ECHO_TIME, HalfDuplex
from missions.plugins.testing.recorders import LeafTestBench


def test_own_speech_lasts_until_its_echo_has_ended() -> None:
    bench = LeafTestBench()
    duplex = HalfDuplex(bench.voice, bench.clock)
    began = bench.clock.now()
    assert not duplex.may_be_own_speech(began - 0.1, began)
    words = bench.voice.say("Hello")
    bench.clock.advance(0.1)
    assert duplex.may_be_own_speech(began, began + 0.1)
    assert not duplex.may_be_own_speech(began - 0.2, began)  # of before, that comes late
    bench.clock.advance(1.0)
    assert duplex.may_be_own_speech(began + 1.0, began + 1.1)
    words.ended = True
    now = bench.clock.now()
    assert duplex.may_be_own_speech(now - 0.02, now)
    bench.clock.advance(ECHO_TIME)
    assert duplex.may_be_own_speech(now, now + ECHO_TIME)
    assert not duplex.may_be_own_speech(now + ECHO_TIME, now + ECHO_TIME + 0.02)


def test_a_pause_shorter_than_an_echo_is_none() -> None:
    bench = LeafTestBench()
    duplex = HalfDuplex(bench.voice, bench.clock)
    began = bench.clock.now()
    first = bench.voice.say("One")
    bench.clock.advance(1.0)
    assert duplex.may_be_own_speech(began, began + 1.0)
    first.ended = True
    assert duplex.may_be_own_speech(began, began + 1.0)
    bench.clock.advance(0.1)
    bench.voice.say("Two")
    bench.clock.advance(0.1)
    assert duplex.may_be_own_speech(began + 1.0, began + 1.05)


def test_queued_utterance_is_not_own_speech_yet() -> None:
    bench = LeafTestBench()
    bench.voice.say("Hello").started = None
    assert not HalfDuplex(bench.voice, bench.clock).may_be_own_speech(0.0, bench.clock.now() + 1.0)


@pytest.mark.parametrize("text", ["Hello", ""])
def test_half_duplex_ends_with_an_instant_voice_or_no_voice(text: str) -> None:
    clock = ManualClock()
    voice = PrintedVoice(clock, lambda _: None)
    voice.open()
    duplex = HalfDuplex(voice, clock)
    voice.say(text)
    for _ in range(100):
        clock.advance(0.05)
        deaf = duplex.may_be_own_speech(clock.now() - 0.05, clock.now())
    assert not deaf
    assert not HalfDuplex(None, clock).may_be_own_speech(0.0, 1.0)
