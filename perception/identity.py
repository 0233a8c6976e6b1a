"""Names of tracked faces: several looks at one face decide on a name, or on unknown."""

from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from typing import Protocol

from drivers.api.fast_dataclass import dataclass
from perception.api import UNKNOWN, Box, Face, Frame, Gaze, Image
from perception.geometry import Pinhole
from perception.senses import FrameSkipper, Sense

LOOK_INTERVAL = 0.15
"""Seconds between two looks at a face (comparisons with known people), since consecutive pictures are too similar."""

MAX_FACES = 3
"""Largest number of faces per picture that are compared with known people: the largest ones."""

MAX_KEPT_LOOKS = 8
"""Number of newest looks (comparisons with known people) at a face that decide on its name."""

MIN_CLEAR_LOOKS, MIN_LOOKS = 3, 5
"""Looks that decide on a name if they are clear, and otherwise."""

MIN_CLEAR_MARGIN = 0.4
"""Smallest absolute mean margin at which a few looks at a face are enough to decide on its name."""

MAX_CONTRARY_LOOKS = 5
"""Number of consecutive looks with another result after which the name of a face is dropped."""


@dataclass(frozen=True, slots=True)
class FaceMatch:
    """Result of one look at a face, which is its comparison with the known people in one picture.

    ``name`` is that of the most similar person, empty if there is none. ``margin`` is the distance of the score from
    that person's threshold, in standard deviations of scores of strangers: above zero it is that person, below zero a
    stranger.
    """

    name: str
    margin: float

    @property
    def verdict(self) -> str:
        """Name of the person by this look alone, or ``UNKNOWN``."""
        return self.name if self.margin > 0 else UNKNOWN


def combine_matches(matches: Collection[FaceMatch]) -> FaceMatch:
    """Return the combined result of one or more looks at one face: the name that was nearest most often.

    The margin is the mean of the margins of all looks. For a look with another name, its margin counts as negative.
    """
    name = Counter(look.name for look in matches).most_common(1)[0][0]
    margins = [look.margin if look.name == name else -abs(look.margin) for look in matches]
    return FaceMatch(name, sum(margins) / len(margins))


class FaceRecogniser(Protocol):
    """Recognises known people by their faces. For one thread at a time."""

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        """Return the nearest person for the face in a box; None if the face cannot be judged."""
        ...


class NullRecogniser:
    """A ``FaceRecogniser`` for which all people are strangers."""

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        del image, face
        return FaceMatch("", -1.0)


class _Ballot:
    """Looks at one face, which are comparisons with the known people, and the resulting name."""

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
    """Decides on the name of each face from several looks at it.

    ``id`` is the id of the face's track, which is never reused.
    """

    def __init__(self) -> None:
        self._ballots: dict[int, _Ballot] = {}

    def start_look(self, id: int, stamp: float, interval: float) -> bool:  # noqa: A002 - as percepts have it
        """Return whether a face is due for recognition in the picture of ``stamp``; if so, record that time.

        It is due ``interval`` seconds after its last recognition.
        """
        ballot = self._ballots.setdefault(id, _Ballot())
        if ballot.last_look_at is not None and stamp - ballot.last_look_at < interval - 1e-6:
            return False
        ballot.last_look_at = stamp
        return True

    def vote(self, id: int, match: FaceMatch) -> None:  # noqa: A002
        """Count the result of a look at the face ``id``."""
        self._ballots.setdefault(id, _Ballot()).vote(match)

    def name(self, id: int) -> str:  # noqa: A002
        """Return the name of a face: a person's, ``UNKNOWN``, or an empty text while undecided."""
        ballot = self._ballots.get(id)
        return "" if ballot is None else ballot.name

    def keep_only(self, ids: Iterable[int]) -> None:
        """Forget the looks and names of all faces except those with ``ids``."""
        kept = set(ids)
        self._ballots = {id_: ballot for id_, ballot in self._ballots.items() if id_ in kept}


class FaceNamer:
    """Gives tracked faces the names of known people. For one thread at a time."""

    def __init__(self, interval: float = LOOK_INTERVAL) -> None:
        self._interval = interval
        self._votes = NameVotes()

    def name(self, faces: Sequence[Face], stamp: float, match: Callable[[Box], FaceMatch | None]) -> tuple[Face, ...]:
        """Return ``faces``, largest first, with their names as far as decided.

        Faces that the picture of ``stamp`` shows are looked at with ``match``, which gets the face's box in it.
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
    """Sense for faces with names: a ``perception.senses.Sense[Face]`` that adds names to the results of ``faces``."""

    def __init__(self, faces: Sense[Face], recogniser: FaceRecogniser, interval: float = LOOK_INTERVAL) -> None:
        self._faces = faces
        self._recogniser = recogniser
        self._naming = FaceNamer(interval)

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[Face, ...]:
        faces = self._faces.sense(frame, camera, gaze)
        return self._naming.name(faces, frame.stamp, lambda box: self._recogniser.match(frame.image, box))

    def skip_frames(self, limit: int) -> int:
        return self._faces.skip_frames(limit) if isinstance(self._faces, FrameSkipper) else 0
