"""The lights and tones that a base with legs, or a plain one, does not have."""

from abc import abstractmethod

from drivers.api import Lamp, Tune
from drivers.base.requests import check_light, check_tone


class Mute:
    """The half of a ``drivers.api.Base`` that is asked for tones and lights, and has none."""

    name = "base"

    @abstractmethod
    def _require(self) -> None:
        """Raise NotConnected where it is not there."""

    def play(self, tune: Tune) -> None:  # noqa: ARG002 - it has nothing to play it on
        """Do nothing: it has no sounder. Raises NotConnected."""
        self._require()

    def tone(self, frequency: float, seconds: float) -> None:
        """Do nothing: it has no sounder. Raises BadRequest, NotConnected."""
        check_tone(self.name, frequency, seconds)
        self._require()

    def light(self, number: int, colour: Lamp) -> None:  # noqa: ARG002 - it has none to show it
        """Do nothing: it has no lights. Raises BadRequest for another number than 1 and 2, NotConnected."""
        check_light(self.name, number)
        self._require()
