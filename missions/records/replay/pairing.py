"""Which node of today's tree is which node of the recorded one, where the mission has been changed since."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher

from missions.views.pictures.drawing import Drawing


@dataclass(frozen=True, slots=True)
class Place:
    """A node where it stands: its key in the tree, and its line in the file. A modifier has no name of its own."""

    key: str
    kind: str
    name: str
    file: str
    line: int
    is_leaf: bool = False

    @property
    def word(self) -> tuple[str, str]:
        """What it is known by again, wherever it stands."""
        return self.kind, self.name

    def __str__(self) -> str:
        named = f"{self.kind} '{self.name}'" if self.name not in ("", self.kind) else self.kind
        return f"{named} ({self.key})"


def places_of(drawing: Drawing) -> tuple[Place, ...]:
    """Return the places of a tree, from its root on in the order of the file."""
    found = []
    for box in drawing.root.walk():
        found += [Place(badge.key, badge.kind, "", box.file, badge.line) for badge in box.badges]
        found.append(Place(box.key, box.kind, box.name, box.file, box.line, is_leaf=not box.children))
    return tuple(found)


def paired(then: Sequence[Place], now: Sequence[Place]) -> Mapping[str, str]:
    """Return the keys of nodes of today by the keys that they had then; those that are in one tree only are left out.

    The trees are read from above as two texts, each node a word: so what was put in, taken out or wrapped into
    something shifts no other. A node that has only got another name, in a piece of the same length, is the same.
    """
    pairs: dict[str, str] = {}
    matcher = SequenceMatcher(None, [each.word for each in then], [each.word for each in now], autojunk=False)
    for what, begin, end, start, stop in matcher.get_opcodes():
        if what == "equal" or (what == "replace" and end - begin == stop - start):
            both = zip(then[begin:end], now[start:stop], strict=True)
            pairs.update((old.key, new.key) for old, new in both if old.kind == new.kind)
    return pairs
