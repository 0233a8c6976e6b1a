"""What a screen is to show, kept for whoever draws it: what all screens have in common."""

from dataclasses import replace
from math import isnan
from threading import Lock

from drivers.api import Mood, ScreenContent
from drivers.clock import Clock

MOUTH_TIMEOUT = 0.3
"""Seconds after which a mouth shuts that nobody moves any more."""


class BaseScreen:
    """The part of a ``drivers.api.Screen`` that is the same on all: told from any thread, it keeps the newest.

    It is ``awake`` until it rests, and again when it is opened after that.
    """

    name = "screen"

    def __init__(self, clock: Clock, *, rest: Mood, awake: Mood) -> None:
        self._clock = clock
        self._resting = ScreenContent(rest)
        self._awake = ScreenContent(awake)
        self._state = self._awake
        self._mouth_moved_at = 0.0  # when the mouth was told last
        self._lock = Lock()

    def open(self) -> None:
        """Wake up, if it is at rest."""
        with self._lock:
            if self._state == self._resting:
                self._state = self._awake

    def rest(self) -> None:
        """Look as it does at rest, with no words and the mouth at rest."""
        with self._lock:
            self._state = self._resting

    def mood(self, mood: Mood) -> None:
        """Look like this from now on."""
        with self._lock:
            self._state = replace(self._state, mood=mood)

    def show(self, text: str) -> None:
        """Show words below the face; an empty text takes them away."""
        with self._lock:
            self._state = replace(self._state, text=text)

    def mouth(self, opening: float) -> None:
        """Open the mouth so far, 0..1; what lies beyond is as much as there is, and what is not a number none."""
        kept = 0.0 if isnan(opening) else min(max(opening, 0.0), 1.0)
        with self._lock:
            self._state = replace(self._state, mouth=kept)
            self._mouth_moved_at = self._clock.now()

    def content(self) -> ScreenContent:
        """Return what is to be seen now, or would be if it were there."""
        with self._lock:
            if self._state.mouth and self._clock.now() - self._mouth_moved_at > MOUTH_TIMEOUT:
                self._state = replace(self._state, mouth=0.0)
            return self._state
