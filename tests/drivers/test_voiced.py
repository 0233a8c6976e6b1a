"""People in a simulated world who are heard: what goes wrong with one silences none of the others."""

import pytest

from drivers.api import DeviceStatus, SpeechStyle
from drivers.clock import SystemClock
from drivers.errors import NoReply
from drivers.microphone.virtual import VoicedMicrophone
from drivers.sim.person_actions import PersonReply
from drivers.sound.cancel_token import CancelToken
from drivers.sound.speech_programs import Speech
from tests.waiting import wait_until

pytestmark = pytest.mark.real_time


class Moody:
    """An engine that speaks some texts, and fails with others."""

    plays_sound = False
    failure_reason = ""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def open(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def speak(self, text: str, manner: SpeechStyle, token: CancelToken) -> Speech:
        del manner, token
        self.texts.append(text)
        if text == "hm":
            raise NoReply("espeak-ng hangs", hint="try again")
        if text == "oh":
            raise ValueError("not a rate: 0")
        return Speech(b"\x00\x40" * 1600, 16_000)


def test_failed_reply_does_not_prevent_the_next() -> None:
    engine, notices = Moody(), list[DeviceStatus]()
    microphone = VoicedMicrophone(SystemClock(), engine, lambda _: SpeechStyle(), report=notices.append)
    microphone.open()
    for text in ("hm", "oh", "yes"):
        microphone.on_reply(PersonReply("Anna", text, 0.0))
    wait_until(lambda: any(abs(piece.samples).max() > 5000 for piece in microphone.read(-1)))
    microphone.close()
    assert engine.texts == ["hm", "oh", "yes"]
    assert [(notice.message, notice.hint) for notice in notices] == [
        ("Anna cannot be heard: espeak-ng hangs", "try again"),
        ("Anna cannot be heard: not a rate: 0", ""),
    ]
