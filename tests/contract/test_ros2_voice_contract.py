"""What ``drivers.api.Voice`` promises, but for sounds, kept by a voice whose words go to a topic of ROS 2."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.errors import BadRequest, NotConnected
from drivers.ros2.make import Ros2Voice
from tests.contract.rigs import InSimulatedTime
from tests.contract.test_voice_contract import (  # noqa: F401 - what holds of words
    VoiceRig,
    test_cancelled_speech_ends_at_once_and_the_next_starts,
    test_empty_speech_ends_at_once,
    test_high_priority_speech_preempts_and_the_other_is_repeated,
    test_preempted_speech_can_be_cancelled_in_the_queue,
    test_queued_speech_can_be_cancelled_alone,
    test_resting_voice_is_silent_and_can_speak_again,
    test_speaking_returns_the_current_speech_with_its_start,
    test_unopened_voice_is_offline_and_refuses_speech,
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


def test_speech_is_published_in_order(voice: TopicVoice) -> None:
    first, second = voice.device.say("hello there"), voice.device.say("Grüße")
    assert voice.ear.said == ["hello there"]
    voice.until(first.done)
    voice.until(lambda: voice.ear.said == ["hello there", "Grüße"])
    voice.until(second.done)
    assert voice.device.health().counters["said"] == 2


def test_closed_voice_is_silent_and_speaks_again_once_opened(voice: TopicVoice) -> None:
    words, later = voice.device.say("much " * 300), voice.device.say("later")
    voice.device.close()
    assert words.done()
    assert later.cancelled
    voice.start()
    voice.device.say("yes")
    assert voice.ear.said[1:] == ["yes"]


def test_missing_speech_subscriber_and_lost_link_are_reported(voice: TopicVoice) -> None:
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
