"""How a robot in simulated time deals with the people in its world: the twins of its voice, its ears and its face."""

from collections.abc import Iterable
from functools import partial
from math import inf
from typing import Any

from config.world import WorldConfig
from drivers.api import Device, Mood
from drivers.api.sections import ScreenKeys, VoiceKeys
from drivers.sim.acts import Reply
from drivers.sim.twins.ears import HearingTwin
from drivers.sim.twins.screen import ScreenTwin
from drivers.sim.twins.voice import VoiceTwin
from missions.assembly.duplex import HalfDuplex
from missions.assembly.face import FRAME, Lips
from missions.assembly.together import Hooks
from missions.assembly.twins import Twins
from perception.api import Words
from perception.hearing.grammar import Grammar


class Conversation:
    """Gives ``twins`` a voice, ears and a face, and lets the people in the ``world`` answer in their own time.

    People and robot hear each other where they are near enough, with no inner wall between. ``phrases`` are what the
    robot listens for.
    """

    def __init__(self, twins: Twins, world: WorldConfig, audience: Hooks, phrases: tuple[str, ...], seed: int) -> None:
        self._twins = twins
        self._world = world
        self._audience = audience
        self._phrases = phrases
        self._seed = seed

    def twin(self, kind: str, keys: Any) -> Device | None:
        """Return the twin of a part that takes part in it; None for others."""
        match kind:
            case "voice":
                return self._voice(keys)
            case "microphone":
                return self._microphone()
            case "screen":
                return self._screen(keys)
        return None

    def begin(self) -> None:
        """Let the people say what they say unasked."""
        self._expect(self._twins.world.said(-1.0, inf))

    def _voice(self, keys: VoiceKeys) -> VoiceTwin:
        clock, audience = self._twins.timeline.clock, self._audience
        return VoiceTwin(clock, self._say, usual=keys.manner, report=audience.report, changed=audience.changed)

    def _microphone(self) -> HearingTwin[Words]:
        clock, audience = self._twins.timeline.clock, self._audience
        return HearingTwin(
            clock,
            Grammar.of(self._phrases),
            Words,
            deaf=HalfDuplex(self._twins.parts.get("voice"), clock).deaf,
            mishearing=self._world.physics.mishearing,
            seed=self._seed,
            report=audience.report,
            changed=audience.changed,
        )

    def _screen(self, keys: ScreenKeys) -> ScreenTwin:
        timeline, voice = self._twins.timeline, self._twins.parts.get("voice")
        screen = ScreenTwin(timeline.clock, awake=Mood(keys.mood), report=self._audience.report)
        if voice is not None:
            timeline.every(FRAME, Lips(voice, screen, timeline.clock).step)
        return screen

    def _say(self, text: str) -> None:
        """Say something aloud."""
        twins = self._twins
        self._audience.out(text)
        self._expect(twins.world.hear(text, twins.timeline.clock.now(), self._stand()))

    def _expect(self, replies: Iterable[Reply]) -> None:
        """Have what people say told, and heard, when they say it."""
        for reply in replies:
            self._twins.timeline.at(reply.when, partial(self._spoken, reply))

    def _spoken(self, reply: Reply) -> None:
        twins = self._twins
        self._audience.answered(reply.who, reply.text)
        if twins.microphone is not None and twins.world.audible(reply.who, twins.timeline.clock.now(), self._stand()):
            twins.microphone.hear(reply)

    def _stand(self) -> tuple[float, float]:
        """Return where the robot truly is."""
        pose = self._twins.pose()
        return pose.x, pose.y
