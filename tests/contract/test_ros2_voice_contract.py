"""What ``drivers.api.Voice`` promises, but for sounds, kept by a voice whose words go to a topic of ROS 2."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.errors import BadRequest, NotConnected
from drivers.ros2.make import Ros2Voice
from tests.contract.rigs import InSimulatedTime
from tests.contract.test_voice_contract import (  # noqa: F401 - what holds of words
    VoiceRig,
    test_at_rest_it_is_silent_and_may_speak_again,
    test_before_it_is_opened_it_says_so_and_nothing_else,
    test_cancelled_it_is_done_at_once_and_the_next_has_its_turn,
    test_it_says_what_is_heard_now_and_since_when,
    test_nothing_is_said_at_once,
    test_one_that_waits_may_be_cancelled_without_touching_the_other,
    test_what_is_more_important_is_heard_at_once_and_the_other_again_afterwards,
    test_what_was_broken_off_can_be_cancelled_while_it_waits,
)
from tests.drivers.cranked import HandWire
from tests.drivers.ros2.ear import VirtualEar


class TopicVoice(InSimulatedTime, VoiceRig):
    def __init__(self) -> None:
        super().__init__()
        self.ear = VirtualEar("/say")
        self.wire = HandWire(self.ear, self.timeline)
        self.device = Ros2Voice(self.wire.link("voice"), self.clock, self.ear.channels[0], changed=self.changed)

    def start(self) -> None:
        self.device.open()
        self.until(lambda: self.device.health().online)


@pytest.fixture
def rig() -> Iterator[TopicVoice]:
    rig = TopicVoice()
    yield rig
    rig.close()


@pytest.fixture
def voice(rig: TopicVoice) -> TopicVoice:
    """A rig whose voice somebody listens to."""
    rig.start()
    return rig


def test_what_is_said_is_sent_in_its_turn(voice: TopicVoice) -> None:
    first, second = voice.device.say("hello there"), voice.device.say("Grüße")
    assert voice.ear.said == ["hello there"]
    voice.until(first.done)
    voice.until(lambda: voice.ear.said == ["hello there", "Grüße"])
    voice.until(second.done)
    assert voice.device.health().counters["said"] == 2


def test_closed_it_is_silent_and_opened_again_it_speaks(voice: TopicVoice) -> None:
    words, later = voice.device.say("much " * 300), voice.device.say("later")
    voice.device.close()
    assert words.done()
    assert later.cancelled
    voice.start()
    voice.device.say("yes")
    assert voice.ear.said[1:] == ["yes"]


def test_nobody_listening_is_said_and_so_is_a_line_that_has_gone(voice: TopicVoice) -> None:
    voice.wire.unplug()
    voice.until(lambda: not voice.device.health().online)
    with pytest.raises(NotConnected) as caught:
        voice.device.say("hello")
    assert caught.value.hint
    voice.ear._kind = lambda channel: ""  # type: ignore[method-assign]  # noqa: ARG005
    voice.wire.plug_in()
    voice.until(lambda: "no subscriber of /say (std_msgs/msg/String)" in voice.device.health().detail)


def test_a_sound_is_refused(voice: TopicVoice) -> None:
    with pytest.raises(BadRequest, match="accepts only text") as caught:
        voice.device.play(Path("bell.wav"))
    assert caught.value.hint
