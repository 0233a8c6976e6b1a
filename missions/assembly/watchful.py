"""What a mission sees, of eyes that rest while nobody asks."""

from collections.abc import Callable, Sequence

from drivers.errors import NotConnected
from perception.api import Face, Marker, Scene, Sight, Thing


class WatchfulSight:
    """A ``Sight`` that says with each question that somebody ``asks``, who says back whether the answer is of now.

    While it is not, as the eyes have rested, each question raises NotConnected: whoever asks waits for a picture or
    three, and nobody is told that a face is not there because nobody has looked. ``unasked`` answers as the eyes are,
    for who only keeps a record: by its questions, which wake nobody, ``awake`` is told.
    """

    def __init__(self, sight: Sight, asks: Callable[[], bool], awake: Callable[[], bool]) -> None:
        self._sight = sight
        self._asks = asks
        self._is_awake = awake

    @property
    def unasked(self) -> "WatchfulSight":
        """What they see, for who does not count as somebody that asks."""
        return WatchfulSight(self._sight, self._is_awake, self._is_awake)

    def faces(self) -> Sequence[Face]:
        """See perception.api.Sight."""
        return self._awake().faces()

    def things(self) -> Sequence[Thing]:
        """See perception.api.Sight."""
        return self._awake().things()

    def markers(self) -> Sequence[Marker]:
        """See perception.api.Sight."""
        return self._awake().markers()

    def looked(self) -> float | None:
        """See perception.api.Sight."""
        return self._awake().looked()

    def scene(self) -> Scene | None:
        """See perception.api.Sight."""
        return self._awake().scene()

    def _awake(self) -> Sight:
        if not self._asks():
            raise NotConnected("camera: its pictures were not searched for a while; the next ones are")
        return self._sight
