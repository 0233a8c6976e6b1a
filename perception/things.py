"""The sense for coloured shapes: a red ball, a blue box, looked for by name and followed over time."""

from collections.abc import Iterator, Mapping, Sequence
from math import isnan

from perception.api import ANY, Frame, Gaze, Thing, Wanted
from perception.colour import Colour
from perception.geometry import Pinhole
from perception.spots import SpotFinder
from perception.tracks import Spot, ThingSighting, Tracker

NEAREST, FARTHEST = 0.1, 8.0
"""Metres. What would have to be nearer or farther away to be of the size that is looked for is something else."""


class ThingSense:
    """Things, found by colour and shape and followed by name: a ``perception.senses.Sense[Thing]``.

    ``colours`` are all that there is a name for, as red, green and blue; those of ``wanted`` among them.
    """

    def __init__(self, wanted: Sequence[Wanted], colours: Mapping[str, Colour]) -> None:
        self._wanted = tuple(dict.fromkeys(wanted))
        self._finder = SpotFinder(colours, [one.colour for one in self._wanted])
        self._tracker = Tracker[Thing]()

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[Thing, ...]:
        """Return the things followed now, largest first."""
        spots = self._finder.find(frame.image) if self._wanted else ()
        sightings = [sighting for spot in spots for sighting in self._fitting(spot, camera)]
        return self._tracker.update(sightings, camera=camera, gaze=gaze, stamp=frame.stamp)

    def _fitting(self, spot: Spot, camera: Pinhole) -> Iterator[ThingSighting]:
        """Yield all that a spot can be."""
        for wanted in self._wanted:
            if wanted.colour == spot.colour and wanted.shape in (ANY, spot.shape):
                sighting = ThingSighting(spot, wanted)
                away = sighting.distance(camera)
                if isnan(away) or NEAREST <= away <= FARTHEST:
                    yield sighting
