"""Face of a robot: its screen, with a mouth that moves with the voice."""

from collections.abc import Callable, Mapping
from math import cos, pi
from threading import Event, Thread
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from config.robot import Section
from drivers.api import (
    Device,
    DeviceStatus,
    Health,
    Mood,
    Mouth,
    Screen,
    ScreenContent,
    StatusCallback,
    Utterance,
    Voice,
    ignore,
)
from drivers.clock import Clock

if TYPE_CHECKING:
    from missions.assembly.assemble import RealPartFactory

MOUTH_OPENINGS = {
    Mouth.CLOSED: 0.0,
    Mouth.TEETH: 0.2,
    Mouth.NARROW: 0.25,
    Mouth.WIDE: 0.45,
    Mouth.ROUND: 0.55,
    Mouth.OPEN: 1.0,
}
"""Opening of the mouth on the screen (0..1) for each mouth shape."""

SYLLABLE_RATE = 4.0
"""Rate in Hz at which the mouth on the screen opens, if the voice does not report mouth shapes."""

FRAME_INTERVAL, IDLE_INTERVAL = 1 / 30, 0.1
"""Seconds between two updates of the mouth during speech and without speech."""


def real_face(factory: "RealPartFactory", section: Section, devices: Mapping[str, Any]) -> tuple[Device, Screen]:
    """Return the screen of a robot, as device and part, with a mouth that moves with its voice."""
    face = TalkingScreen(factory.device(section), devices.get("voice"), factory.clock, factory.hooks.report)
    return face, face


@runtime_checkable
class ScreenPage(Protocol):
    """Screen that is a web page."""

    @property
    def address(self) -> str:
        """Address of the page; empty while it is not served."""
        ...


class MouthAnimation:
    """Animation of the mouth on a ``screen`` that follows a ``voice``; call ``step`` repeatedly to update it."""

    def __init__(self, voice: Voice, screen: Screen, clock: Clock) -> None:
        self._voice = voice
        self._screen = screen
        self._clock = clock
        self._moving = False

    def step(self) -> float:
        """Update the mouth, and return the seconds until the next update."""
        utterance = self._voice.speaking()
        opening = self._opening(utterance)
        if opening or self._moving:
            self._screen.mouth(opening)
        self._moving = opening > 0
        return IDLE_INTERVAL if utterance is None else FRAME_INTERVAL

    def _opening(self, said: Utterance | None) -> float:
        started = None if said is None else said.started
        if said is None or started is None:
            return 0.0
        spoken = self._clock.now() - started
        shapes = said.mouth
        if not shapes:
            return 0.3 * (1 - cos(2 * pi * SYLLABLE_RATE * spoken))
        shape = next((each.shape for each in reversed(shapes) if each.at <= spoken), Mouth.CLOSED)
        return MOUTH_OPENINGS[shape]


class TalkingScreen:
    """A ``screen`` whose mouth moves with the ``voice``, on a thread of its own.

    It implements ``drivers.api.Screen``.
    """

    def __init__(self, screen: Screen, voice: Voice | None, clock: Clock, report: StatusCallback = ignore) -> None:
        self.name = screen.name
        self.mood: Callable[[Mood], None] = screen.mood
        self.show: Callable[[str], None] = screen.show
        self.mouth: Callable[[float], None] = screen.mouth
        self.content: Callable[[], ScreenContent] = screen.content
        self.health: Callable[[], Health] = screen.health
        self.rest: Callable[[], None] = screen.rest
        self._screen = screen
        self._report = report
        self._lips = None if voice is None else MouthAnimation(voice, screen, clock)
        self._open = False
        self._ending = Event()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Open the screen and start to move its mouth. Idempotent."""
        if self._open:
            return
        self._open = True
        self._screen.open()
        if isinstance(self._screen, ScreenPage) and self._screen.address:
            self._report(DeviceStatus(self.name, "online", f"the robot's face (screen): {self._screen.address}"))
        if self._lips is not None:
            self._ending.clear()
            self._thread = Thread(target=self._run, args=(self._lips,), name="lips", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Stop and close the screen, in any state. Idempotent."""
        self._open = False
        self._ending.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()
        self._screen.close()

    def _run(self, lips: MouthAnimation) -> None:
        pause = FRAME_INTERVAL
        while not self._ending.wait(pause):
            pause = lips.step()
