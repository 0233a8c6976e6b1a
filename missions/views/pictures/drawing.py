"""A mission's tree as pictures show it: plain values, which every form of picture is made from."""

from collections.abc import Iterator, Mapping
from dataclasses import field
from typing import Literal

from drivers.api.quick import dataclass

Status = Literal["idle", "running", "suspended", "success", "skipped", "failure"]
"""What a node is doing, in the words of events."""

ACTIVE: frozenset[str] = frozenset({"running", "suspended"})
"""The statuses of a node that has started and not ended."""

SIGNS: Mapping[Status, str] = {
    "idle": "○",
    "running": "▶",
    "suspended": "‖",
    "success": "✓",
    "skipped": "»",
    "failure": "✗",
}
"""A sign for each status: no picture tells them apart by colour alone."""

ASCII_SIGNS: Mapping[Status, str] = {
    "idle": "o",
    "running": ">",
    "suspended": "=",
    "success": "+",
    "skipped": "/",
    "failure": "x",
}
"""The same where there is no Unicode."""


@dataclass(frozen=True, slots=True)
class Now:
    """What a node is doing, why, and since when (seconds of the run)."""

    status: Status = "idle"
    reason: str = ""
    since: float = 0.0


@dataclass(frozen=True, slots=True)
class Badge:
    """A modifier, drawn on the node that it modifies: ``kind`` ("timeout"), ``text`` ("5 s"), and how it stands."""

    key: str
    kind: str
    text: str
    line: int
    status: Status = "idle"
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Box:
    """A node that is no modifier. ``symbol`` is the sign of its kind, ``arguments`` are as the file has them.

    ``said`` is what stands behind the word in the file where that is one value: then it is the one argument too.
    ``badges`` are its modifiers, outermost first. ``mission`` is the name of the mission that a sub-mission runs, empty
    for all others; ``case`` the value for which a switch chooses it ("else" for the default). ``since`` says when it
    took on its status, in seconds of the run. ``folded`` counts the nodes that are hidden below it.
    """

    key: str
    kind: str
    name: str
    symbol: str
    file: str
    line: int
    said: str = ""
    arguments: Mapping[str, str] = field(default_factory=dict)
    badges: tuple[Badge, ...] = ()
    keep_as: str = ""
    case: str = ""
    mission: str = ""
    status: Status = "idle"
    reason: str = ""
    since: float | None = None
    children: tuple["Box", ...] = ()
    folded: int = 0

    def walk(self) -> Iterator["Box"]:
        """Yield it and all below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def nodes(self) -> int:
        """How many nodes there are from it on, as the checker counts: modifiers too, and what is folded."""
        return 1 + len(self.badges) + self.folded + sum(child.nodes for child in self.children)

    @property
    def title(self) -> str:
        """What a person reads first: the name it was given, else what the file says ("gesture: hello")."""
        return f"{self.kind}: {self.name}" if self._named else f"{self.kind}: {self.mission or self.said}".rstrip(": ")

    @property
    def untold(self) -> Mapping[str, str]:
        """The arguments that the title does not say."""
        return {} if self.said and not self._named else self.arguments

    @property
    def _named(self) -> bool:
        return self.name not in (self.kind, self.mission)

    @property
    def outer(self) -> Status:
        """What its parent sees: the status of the outermost modifier, else its own."""
        return self.badges[0].status if self.badges else self.status


@dataclass(frozen=True, slots=True)
class Drawing:
    """A whole tree, and what is told of it; ``time`` is the moment of a record that it shows, in seconds."""

    mission: str
    summary: str
    file: str
    root: Box
    time: float | None = None
