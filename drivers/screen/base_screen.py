"""Common state of all screens: mood, text and mouth opening."""

from dataclasses import replace
from math import isnan
from threading import Lock

from drivers.api import Mood, ScreenContent
from drivers.clock import Clock

MOUTH_TIMEOUT = 0.3
"""Seconds without a new mouth opening after which the mouth of the face shuts."""


class BaseScreen:
    """Base class of screens (``drivers.api.Screen``): stores mood, text and mouth opening. Thread-safe.

    The face has the mood ``awake`` until ``rest`` is called, and again after ``open``. After ``rest`` it has the mood
    ``rest``.
    """

    name = "screen"

    def __init__(self, clock: Clock, *, rest: Mood, awake: Mood) -> None:
        self._clock = clock
        self._resting = ScreenContent(rest)
        self._awake = ScreenContent(awake)
        self._state = self._awake
        self._mouth_moved_at = 0.0  # time of the last mouth position
        self._lock = Lock()

    def open(self) -> None:
        """Show the face awake if it is resting."""
        with self._lock:
            if self._state == self._resting:
                self._state = self._awake

    def rest(self) -> None:
        """Show the resting face without text."""
        with self._lock:
            self._state = self._resting

    def mood(self, mood: Mood) -> None:
        """Set the mood."""
        with self._lock:
            self._state = replace(self._state, mood=mood)

    def show(self, text: str) -> None:
        """Set the text below the face; an empty text removes it."""
        with self._lock:
            self._state = replace(self._state, text=text)

    def mouth(self, opening: float) -> None:
        """Set the mouth opening, clamped to 0..1; 0 if it is not a number."""
        kept = 0.0 if isnan(opening) else min(max(opening, 0.0), 1.0)
        with self._lock:
            self._state = replace(self._state, mouth=kept)
            self._mouth_moved_at = self._clock.now()

    def content(self) -> ScreenContent:
        """Return the current content, also while the screen is offline."""
        with self._lock:
            if self._state.mouth and self._clock.now() - self._mouth_moved_at > MOUTH_TIMEOUT:
                self._state = replace(self._state, mouth=0.0)
            return self._state
