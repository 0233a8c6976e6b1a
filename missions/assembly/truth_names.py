"""Names for eyes that know the world: what a recogniser would say of each face, mistakes now and then included."""

from collections.abc import Iterable, Sequence
from random import Random

from config.people import PersonConfig
from perception.api import Box
from perception.identity import Look
from perception.sighting import Sighting

SURE = 1.0
"""The margin of each look, either way."""


class TrueNames:
    """Says of each face whose it is, as far as that person is known; of a share ``mistaken`` of looks, the contrary."""

    def __init__(self, people: Iterable[PersonConfig], mistaken: float, random: Random) -> None:
        self._known = frozenset(person.name for person in people if person.known)
        self._mistaken = mistaken
        self._random = random

    def look(self, face: Box, sightings: Sequence[Sighting]) -> Look | None:
        """Return what one look at the face in a box says; None where none of the ``sightings`` is there."""
        who = next((sighting.who for sighting in sightings if sighting.box == face), "")
        if not who:
            return None
        wrong = self._random.random() < self._mistaken
        return Look(who, SURE if (who in self._known) is not wrong else -SURE)
