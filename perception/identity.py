"""Whose face it is: many looks at one face make a name, or leave it unknown. Nobody is forced to a name."""

from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from typing import Protocol

from drivers.api.quick import dataclass
from perception.api import UNKNOWN, Box, Face, Frame, Gaze, Image
from perception.geometry import Pinhole
from perception.senses import Sense, Sparing

EVERY = 0.15
"""Seconds from one look at a face to the next: pictures that follow each other closely say the same."""

MAX_FACES = 3
"""Faces of one picture that are looked at: the largest."""

LOOKS = 8
"""Looks at a face that count: the newest."""

ENOUGH, LATEST = 3, 5
"""Looks from which on a name is decided where they are clear, and where they are not."""

CLEAR = 0.4
"""Mean margin, either way, that is clear."""

CONTRARY = 5
"""Looks in a row that speak against a name before it is taken back."""


@dataclass(frozen=True, slots=True)
class Look:
    """What one look at a face says: the ``name`` of the nearest person, empty where there are none.

    ``margin`` is above zero for somebody who is near enough to be that person, below for a stranger: how far that is
    from the threshold, in standard deviations of looks at strangers.
    """

    name: str
    margin: float

    @property
    def verdict(self) -> str:
        """What it would be if it were the only look."""
        return self.name if self.margin > 0 else UNKNOWN


def agreed(looks: Collection[Look]) -> Look:
    """Return what looks at one face say together, one at least: the name that was nearest most often.

    The margin is the mean of theirs, where a look at somebody else speaks against.
    """
    name = Counter(look.name for look in looks).most_common(1)[0][0]
    margins = [look.margin if look.name == name else -abs(look.margin) for look in looks]
    return Look(name, sum(margins) / len(margins))


class Recogniser(Protocol):
    """Knows some people by their faces. For one thread at a time."""

    def look(self, image: Image, face: Box) -> Look | None:
        """Return what the face in a box looks like; None where it cannot be judged."""
        ...


class Nobody:
    """Knows nobody: everybody is a stranger. A ``Recogniser``."""

    def look(self, image: Image, face: Box) -> Look | None:
        """Return that it is a stranger."""
        del image, face
        return Look("", -1.0)


class _Ballot:
    """The looks at one face, and the name that they have made."""

    def __init__(self) -> None:
        self.name = ""
        self.asked: float | None = None
        self._looks: deque[Look] = deque(maxlen=LOOKS)
        self._contrary = 0

    def vote(self, look: Look) -> None:
        self._looks.append(look)
        if not self.name:
            found = agreed(self._looks)
            if len(self._looks) >= LATEST or (len(self._looks) >= ENOUGH and abs(found.margin) > CLEAR):
                self.name = found.verdict
        elif look.verdict == self.name:
            self._contrary = 0
        else:
            self._contrary += 1
            if self._contrary >= CONTRARY:
                self._looks = deque(list(self._looks)[-CONTRARY:], maxlen=LOOKS)
                self.name, self._contrary = agreed(self._looks).verdict, 0


class Votes:
    """Makes names of looks, face by face; ``id`` is that of the track, which no other face ever has."""

    def __init__(self) -> None:
        self._ballots: dict[int, _Ballot] = {}

    def due(self, id: int, stamp: float, every: float) -> bool:  # noqa: A002 - as percepts have it
        """Say whether a face should be looked at in the picture of ``stamp``, and take it that it is."""
        ballot = self._ballots.setdefault(id, _Ballot())
        if ballot.asked is not None and stamp - ballot.asked < every - 1e-6:
            return False
        ballot.asked = stamp
        return True

    def vote(self, id: int, look: Look) -> None:  # noqa: A002
        """Count a look at a face."""
        self._ballots.setdefault(id, _Ballot()).vote(look)

    def name(self, id: int) -> str:  # noqa: A002
        """Return whose face it is: a name, ``UNKNOWN``, or an empty text while that is not decided."""
        ballot = self._ballots.get(id)
        return "" if ballot is None else ballot.name

    def keep(self, ids: Iterable[int]) -> None:
        """Forget all faces but these."""
        kept = set(ids)
        self._ballots = {id_: ballot for id_, ballot in self._ballots.items() if id_ in kept}


class Naming:
    """Puts names on the faces that are followed. For one thread at a time."""

    def __init__(self, every: float = EVERY) -> None:
        self._every = every
        self._votes = Votes()

    def name(self, faces: Sequence[Face], stamp: float, look: Callable[[Box], Look | None]) -> tuple[Face, ...]:
        """Return ``faces``, largest first, each with its name as far as that is decided.

        Those that the picture of ``stamp`` itself shows are looked at with ``look``, which gets the face's box in it.
        """
        votes = self._votes
        votes.keep(face.id for face in faces)
        shown = [face for face in faces if face.stamp == stamp]
        for face in shown[:MAX_FACES]:
            if votes.due(face.id, stamp, self._every):
                found = look(face.box)
                if found is not None:
                    votes.vote(face.id, found)
        return tuple(replace(face, name=votes.name(face.id)) for face in faces)


class NamedFaces:
    """The sense for faces, with names on them: a ``perception.senses.Sense[Face]`` around another."""

    def __init__(self, faces: Sense[Face], recogniser: Recogniser, every: float = EVERY) -> None:
        self._faces = faces
        self._recogniser = recogniser
        self._naming = Naming(every)

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[Face, ...]:
        """Return the faces followed now, largest first."""
        faces = self._faces.sense(frame, camera, gaze)
        return self._naming.name(faces, frame.stamp, lambda box: self._recogniser.look(frame.image, box))

    def spare(self, most: int) -> int:
        """Return how many of the next frames it can do without: see ``perception.senses.Sparing``."""
        return self._faces.spare(most) if isinstance(self._faces, Sparing) else 0
