"""Drawing of a mission's tree: plain values from which all pictures and texts are made."""

from collections.abc import Iterator, Mapping
from dataclasses import field
from typing import Annotated, Any, ClassVar, Literal

from drivers.api.fast_dataclass import dataclass
from missions.codec import Bound, CodecError, JsonName, Rules, decode, definitions, encode, object_schema

Status = Literal["idle", "running", "suspended", "success", "skipped", "failure"]
"""Status of a node, in the words of run events."""

ACTIVE: frozenset[str] = frozenset({"running", "suspended"})
"""Statuses of a node that has started and not ended."""

SIGNS: Mapping[Status, str] = {
    "idle": "○",
    "running": "▶",
    "suspended": "‖",
    "success": "✓",
    "skipped": "»",
    "failure": "✗",
}
"""Sign of each node status, so that pictures do not depend on colour alone."""

ASCII_SIGNS: Mapping[Status, str] = {
    "idle": "o",
    "running": ">",
    "suspended": "=",
    "success": "+",
    "skipped": "/",
    "failure": "x",
}
"""Sign of each node status, without Unicode."""


@dataclass(frozen=True, slots=True)
class NodeState:
    """Status of a node, its reason, and its start time (seconds of the run)."""

    status: Status = "idle"
    reason: str = ""
    since: float = 0.0


Key = Annotated[str, "Key of the node: the root is 1, the root's second child 1.2. Modifiers have keys, too."]
Line = Annotated[int, "Line of the file.", Bound(low=1)]
StatusNow = Annotated[Status, "Status at that time; idle if the tree does not run."]
Reason = Annotated[str, "Reason of a failure or a wait; empty otherwise."]


@dataclass(frozen=True, slots=True)
class Badge:
    """Modifier of a mission, drawn on the box of the node that it modifies."""

    key: Key
    kind: Annotated[str, "Tag of the modifier, such as timeout."]
    text: Annotated[str, "Value as in the file."]
    line: Line
    status: StatusNow = "idle"
    reason: Reason = ""


@dataclass(frozen=True, slots=True)
class TreeBox:
    """Box of a drawing: a node of the mission's tree that is not a modifier."""

    derived: ClassVar[Mapping[str, str]] = {"title": "Title for people."}

    key: Key
    kind: Annotated[str, "Tag of the behaviour, such as sequence or drive."]
    name: Annotated[str, "Name in events; by default the tag."]
    symbol: Annotated[str, "Symbol of the kind."]
    file: Annotated[str, "File of the step."]
    line: Line
    said: Annotated[str, "Value after the tag, if it is a single value; it is the only argument, too."] = ""
    arguments: Annotated[Mapping[str, str], "Arguments in the order of the file, without defaults."] = field(
        default_factory=dict
    )
    badges: Annotated[tuple[Badge, ...], JsonName("modifiers"), "Modifiers, the outermost first."] = ()
    keep_as: Annotated[str, JsonName("as"), "Output variable, if any."] = ""
    case: Annotated[str, "Case of the parent switch, `default`, `recover` or `finally`; or empty."] = ""
    mission: Annotated[str, "Mission that the node runs; empty if it is not a sub-mission."] = ""
    status: StatusNow = "idle"
    reason: Reason = ""
    since: Annotated[float | None, "Time of the last change of status: seconds from the start of the run."] = None
    children: Annotated[
        tuple["TreeBox", ...], "Child nodes in the order of the file, then `recover` and `finally`."
    ] = ()
    folded: Annotated[int, "Number of nodes below that are left out.", Bound(low=0)] = 0

    def walk(self) -> Iterator["TreeBox"]:
        """Yield this box and all boxes below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def nodes(self) -> int:
        """Number of nodes in this box and all boxes below it, including modifiers and folded nodes."""
        return 1 + len(self.badges) + self.folded + sum(child.nodes for child in self.children)

    @property
    def title(self) -> str:
        """Name of the node, or its step as in the file ("gesture: hello")."""
        return (
            f"{self.kind}: {self.name}" if self._has_name else f"{self.kind}: {self.mission or self.said}".rstrip(": ")
        )

    @property
    def untitled_arguments(self) -> Mapping[str, str]:
        """Arguments of the node that its title does not show already."""
        return {} if self.said and not self._has_name else self.arguments

    @property
    def _has_name(self) -> bool:
        return self.name not in (self.kind, self.mission)

    @property
    def outer_status(self) -> Status:
        """Status that the parent sees: that of the outermost modifier, else the node's own."""
        return self.badges[0].status if self.badges else self.status


@dataclass(frozen=True, slots=True)
class TreeDrawing:
    """Drawing of a mission's whole tree."""

    mission: Annotated[str, "Name of the mission."]
    summary: Annotated[str, "Description in a line."]
    file: Annotated[str, "File of the mission; for a shipped mission, its path in the package."]
    root: Annotated[TreeBox, JsonName("tree"), "Root of the tree."]
    time: Annotated[float | None, "Time of the statuses: seconds from the start of the run."] = None


# What the pictures that are text say of a node: a few short texts, on one line or below each other.


class NodeLabels:
    """Texts for the nodes of a drawing. If the drawing shows a run, each text begins with the sign of the status.

    ``signs`` are the signs by status.
    """

    def __init__(self, drawing: TreeDrawing, signs: Mapping[Status, str] = SIGNS) -> None:
        self._file = drawing.file
        self._live = drawing.time is not None
        self._signs = signs

    def box(self, box: TreeBox) -> tuple[str, ...]:
        """Return title, arguments, output variable, line of the file, and state of a box."""
        arguments = ", ".join(f"{name}: {text}" for name, text in box.untitled_arguments.items())
        texts = (
            self.sign(box.status) + box.title,
            f"{{{arguments}}}" if arguments else "",
            f"as {box.keep_as}" if box.keep_as else "",
            self._place(box.file, box.line),
            f"and {box.folded} more below" if box.folded else "",
            *self._state(box.status, box.since, box.reason),
        )
        return tuple(filter(None, texts))

    def badge(self, box: TreeBox, badge: Badge) -> tuple[str, ...]:
        """Return title, line and state of a modifier of ``box``."""
        texts = (
            f"{self.sign(badge.status)}{badge.kind}: {badge.text}",
            self._place(box.file, badge.line),
            *self._state(badge.status, None, badge.reason),
        )
        return tuple(filter(None, texts))

    def sign(self, status: Status) -> str:
        """Return the sign of a status and a space; an empty text if the drawing does not show a run."""
        return f"{self._signs[status]} " if self._live else ""

    def _place(self, file: str, line: int) -> str:
        return f"(line {line})" if file == self._file else f"({file}:{line})"

    def _state(self, status: Status, since: float | None, reason: str) -> Iterator[str]:
        if since is not None and status != "idle":
            yield f"since {since:.2f} s"
        if reason:
            yield f"-- {reason}"


# The tree as lines for a terminal, in the symbols of all our pictures; modifiers stand above what they modify.


def outline(drawing: TreeDrawing) -> str:
    """Return the tree as text, a line per node and modifier; in a drawing of a run, mission and time come first."""
    head = [] if drawing.time is None else [f"{drawing.mission} at {drawing.time:.2f} s"]
    return "\n".join([*head, *_lines(drawing.root, NodeLabels(drawing), "", "")]) + "\n"


def _lines(box: TreeBox, labels: NodeLabels, first: str, rest: str) -> Iterator[str]:
    """Yield the lines of a node and all nodes below it.

    ``first`` and ``rest`` are the parts of the tree's branches that come before the first line and before all others.
    """
    said = [_badge(*labels.badge(box, badge)) for badge in box.badges]
    title, *more = labels.box(box)
    said.append(" ".join((box.symbol, title, *more)))
    if box.case:
        said[0] = f"{box.case}: {said[0]}"
    yield first + said[0]
    yield from (rest + line for line in said[1:])
    for place, child in enumerate(box.children, start=1):
        last = place == len(box.children)
        yield from _lines(child, labels, rest + ("└─ " if last else "├─ "), rest + ("   " if last else "│  "))


def _badge(title: str, *more: str) -> str:
    return " ".join((f"[{title}]", *more))


# Drawings as JSON, and back: for other programs, for pages and records, and for a view of a running mission.

FORMAT = "missiontree-tree/1"
"""Format name of tree dumps in JSON; its number grows with each incompatible change."""

RULES = Rules()


def to_json(drawing: TreeDrawing) -> dict[str, object]:
    """Return a drawing as JSON data, as in ``schema``."""
    return {"format": FORMAT, **encode(drawing, RULES)}


def from_json(data: Mapping[str, object]) -> TreeDrawing:
    """Return the drawing that ``to_json`` wrote. Raises ValueError for other data."""
    found = data.get("format")
    if found != FORMAT:
        raise ValueError(f"not a readable tree dump: its format is {found!r}, not {FORMAT!r}")
    try:
        return decode(TreeDrawing, {name: value for name, value in data.items() if name != "format"}, RULES)
    except CodecError as error:
        raise ValueError(f"tree dump: {error}") from error


def schema() -> dict[str, Any]:
    """Return the JSON Schema of tree dumps, with the meaning of each member."""
    form = {"const": FORMAT, "description": "Format of this file."}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Tree of a MissionTree mission",
        **object_schema(TreeDrawing, RULES, format=form),
        "$defs": definitions(TreeDrawing, RULES),
    }
