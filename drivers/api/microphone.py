"""What perception sees of a microphone."""

from collections.abc import Sequence
from typing import Protocol

from drivers.api.arrays import Samples
from drivers.api.device import Device
from drivers.api.quick import dataclass

SOUND_RATE = 16_000
"""Samples a second that every microphone gives, whatever its hardware does."""


@dataclass(frozen=True, slots=True, eq=False)
class Sound:
    """A piece of sound: ``number`` counts the pieces of a microphone, so that a gap shows.

    ``stamp`` is the time of its first sample, in seconds on the driver's clock.
    """

    number: int
    stamp: float
    samples: Samples

    @property
    def end(self) -> float:
        """The time at which it ends."""
        return self.stamp + len(self.samples) / SOUND_RATE


class Microphone(Device, Protocol):
    """What the robot hears with. It keeps what it has heard for a few seconds, and drops what nobody fetches."""

    def read(self, after: int) -> Sequence[Sound]:
        """Return the pieces with a larger number than ``after``, oldest first; at most the last 5 s are kept."""
        ...
