"""Stand-ins for what the ears talk with."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from perception.hearing.engines import Judgement
from perception.hearing.listener import RecogniserHandler
from perception.hearing.sound import RATE, Clip, Piece, Samples


class Bit:
    """A piece of sound."""

    def __init__(self, number: int, stamp: float, samples: Samples) -> None:
        self.number, self.stamp, self.samples = number, stamp, samples
        self.end = stamp + len(samples) / RATE


def bits(sound: Samples, *, first: int = 0, start: float = 0.0) -> list[Piece]:
    """Cut a sound into pieces of 20 ms."""
    count = len(sound) // 320
    return [Bit(first + each, start + each * 0.02, sound[each * 320 : each * 320 + 320]) for each in range(count)]


def talk(*spoken: tuple[float, float], seconds: float) -> Samples:
    """A quiet room in which there is something loud from .. to."""
    rng = np.random.default_rng(0)
    sound = rng.standard_normal(round(seconds * RATE)) * 50
    for start, end in spoken:
        sound[round(start * RATE) : round(end * RATE)] *= 60
    return np.asarray(sound, np.int16)


class ScriptedWorker:
    """A worker that keeps what it is told, and answers when the test says so."""

    def __init__(self) -> None:
        self.sent: list[tuple[Mapping[str, Any], bytes]] = []
        self.talker: RecogniserHandler | None = None
        self.broken = False
        self.kills = 0

    def kill(self) -> None:
        self.kills += 1

    def open(self, handler: RecogniserHandler) -> None:
        self.talker = handler

    def close(self) -> None:
        self.talker = None

    def send(self, message: Mapping[str, Any], body: bytes = b"", *, timeout: float = 1.0) -> None:
        assert timeout > 0
        if self.broken:
            raise BrokenPipeError("gone")
        self.sent.append((message, body))


class LengthEngine:
    """Understands "yes" of what is answered so, as surely as the answer says."""

    def setup_message(self) -> Mapping[str, Any]:
        return {"phrases": ["yes"]}

    def prepare_sound(self, clip: Clip) -> bytes:
        return clip.samples.tobytes()

    def judge(self, clip: Clip, answer: Mapping[str, Any]) -> Judgement:
        assert len(clip.samples)
        return answer["phrase"], answer["score"]
