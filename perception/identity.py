"""Whose face it is: many looks at one face make a name, or leave it unknown. Nobody is forced to a name."""

from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from typing import Protocol

from drivers.api.fast_dataclass import dataclass
from perception.api import UNKNOWN, Box, Face, Frame, Gaze, Image
from perception.geometry import Pinhole
from perception.senses import FrameSkipper, Sense

LOOK_INTERVAL = 0.15
"""Seconds from one look at a face to the next: pictures that follow each other closely say the same."""

MAX_FACES = 3
"""Faces of one picture that are looked at: the largest."""

MAX_KEPT_LOOKS = 8
"""Looks at a face that count: the newest."""

MIN_CLEAR_LOOKS, MIN_LOOKS = 3, 5
"""Looks from which on a name is decided where they are clear, and where they are not."""

MIN_CLEAR_MARGIN = 0.4
"""Mean margin, either way, that is clear."""

MAX_CONTRARY_LOOKS = 5
"""Looks in a row that speak against a name before it is taken back."""


@dataclass(frozen=True, slots=True)
class FaceMatch:
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


def combine_matches(matches: Collection[FaceMatch]) -> FaceMatch:
    """Return what looks at one face say together, one at least: the name that was nearest most often.

    The margin is the mean of theirs, where a look at somebody else speaks against.
    """
    name = Counter(look.name for look in matches).most_common(1)[0][0]
    margins = [look.margin if look.name == name else -abs(look.margin) for look in matches]
    return FaceMatch(name, sum(margins) / len(margins))


class FaceRecogniser(Protocol):
    """Knows some people by their faces. For one thread at a time."""

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        """Return what the face in a box looks like; None where it cannot be judged."""
        ...


class NullRecogniser:
    """Knows nobody: everybody is a stranger. A ``FaceRecogniser``."""

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        """Return that it is a stranger."""
        del image, face
        return FaceMatch("", -1.0)


class _Ballot:
    """The looks at one face, and the name that they have made."""

    def __init__(self) -> None:
        self.name = ""
        self.last_look_at: float | None = None
        self._matches: deque[FaceMatch] = deque(maxlen=MAX_KEPT_LOOKS)
        self._contrary_count = 0

    def vote(self, match: FaceMatch) -> None:
        self._matches.append(match)
        if not self.name:
            found = combine_matches(self._matches)
            if len(self._matches) >= MIN_LOOKS or (
                len(self._matches) >= MIN_CLEAR_LOOKS and abs(found.margin) > MIN_CLEAR_MARGIN
            ):
                self.name = found.verdict
        elif match.verdict == self.name:
            self._contrary_count = 0
        else:
            self._contrary_count += 1
            if self._contrary_count >= MAX_CONTRARY_LOOKS:
                self._matches = deque(list(self._matches)[-MAX_CONTRARY_LOOKS:], maxlen=MAX_KEPT_LOOKS)
                self.name, self._contrary_count = combine_matches(self._matches).verdict, 0


class NameVotes:
    """Makes names of looks, face by face; ``id`` is that of the track, which no other face ever has."""

    def __init__(self) -> None:
        self._ballots: dict[int, _Ballot] = {}

    def start_look(self, id: int, stamp: float, interval: float) -> bool:  # noqa: A002 - as percepts have it
        """Say whether a face should be looked at in the picture of ``stamp``, and take it that it is."""
        ballot = self._ballots.setdefault(id, _Ballot())
        if ballot.last_look_at is not None and stamp - ballot.last_look_at < interval - 1e-6:
            return False
        ballot.last_look_at = stamp
        return True

    def vote(self, id: int, match: FaceMatch) -> None:  # noqa: A002
        """Count a look at a face."""
        self._ballots.setdefault(id, _Ballot()).vote(match)

    def name(self, id: int) -> str:  # noqa: A002
        """Return whose face it is: a name, ``UNKNOWN``, or an empty text while that is not decided."""
        ballot = self._ballots.get(id)
        return "" if ballot is None else ballot.name

    def keep_only(self, ids: Iterable[int]) -> None:
        """Forget all faces but these."""
        kept = set(ids)
        self._ballots = {id_: ballot for id_, ballot in self._ballots.items() if id_ in kept}


class FaceNamer:
    """Puts names on the faces that are followed. For one thread at a time."""

    def __init__(self, interval: float = LOOK_INTERVAL) -> None:
        self._interval = interval
        self._votes = NameVotes()

    def name(self, faces: Sequence[Face], stamp: float, match: Callable[[Box], FaceMatch | None]) -> tuple[Face, ...]:
        """Return ``faces``, largest first, each with its name as far as that is decided.

        Those that the picture of ``stamp`` itself shows are looked at with ``match``, which gets the face's box in it.
        """
        votes = self._votes
        votes.keep_only(face.id for face in faces)
        shown = [face for face in faces if face.stamp == stamp]
        for face in shown[:MAX_FACES]:
            if votes.start_look(face.id, stamp, self._interval):
                found = match(face.box)
                if found is not None:
                    votes.vote(face.id, found)
        return tuple(replace(face, name=votes.name(face.id)) for face in faces)


class NamedFaceSense:
    """The sense for faces, with names on them: a ``perception.senses.Sense[Face]`` around another."""

    def __init__(self, faces: Sense[Face], recogniser: FaceRecogniser, interval: float = LOOK_INTERVAL) -> None:
        self._faces = faces
        self._recogniser = recogniser
        self._naming = FaceNamer(interval)

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[Face, ...]:
        """Return the faces followed now, largest first."""
        faces = self._faces.sense(frame, camera, gaze)
        return self._naming.name(faces, frame.stamp, lambda box: self._recogniser.match(frame.image, box))

    def skip_frames(self, limit: int) -> int:
        """Return how many of the next frames it can do without: see ``perception.senses.FrameSkipper``."""
        return self._faces.skip_frames(limit) if isinstance(self._faces, FrameSkipper) else 0
