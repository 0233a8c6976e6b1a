"""What tests have tried of a mission: which nodes were ticked, how each ended, and why it failed."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from missions.executive.events import plain_status
from missions.testing.history import NodeRecord
from missions.testing.play import Verdict
from missions.testing.suite import shown_path

Place = tuple[str, int, str, str]
"""A node by its file, its line, its word and its name: the same sub-mission counts once, from wherever it is run."""


@dataclass(slots=True)
class NodeCoverage:
    """What is known of one node. ``ends`` are the ways in which it can end, ``statuses`` those that it had."""

    line: int
    kind: str
    name: str
    ends: frozenset[str]
    statuses: set[str] = field(default_factory=set)
    reasons: dict[str, None] = field(default_factory=dict)

    @property
    def ticked(self) -> bool:
        """True where it was ever ticked: a branch of a selector or a switch was taken."""
        return bool(self.statuses - {"idle"})

    @property
    def missed(self) -> list[str]:
        """The ways in which it can end, and never did."""
        return sorted(self.ends - set(map(plain_status, self.statuses)))

    @property
    def tried(self) -> str:
        """``all``, ``part`` or ``nothing``: how much of it was tried."""
        if not self.ticked:
            return "nothing"
        return "part" if self.missed else "all"

    def lacks(self) -> str:
        """Return what was never tried, in a few words; nothing where all was."""
        if not self.ticked:
            return "never reached"
        words = {"success": "succeeded", "failure": "failed"}
        return " or ".join(f"never {words[end]}" for end in self.missed)


@dataclass(slots=True)
class FileCoverage:
    """What is known of the nodes of one mission file, in the order of its lines."""

    file: str
    nodes: list[NodeCoverage]

    @property
    def ticked(self) -> int:
        """How many of its nodes were ticked."""
        return sum(node.ticked for node in self.nodes)

    @property
    def endings(self) -> tuple[int, int]:
        """How many ways of ending were seen, and how many there are."""
        possible = sum(len(node.ends) for node in self.nodes)
        return possible - sum(len(node.missed) for node in self.nodes), possible

    def text(self) -> str | None:
        """Return the file's text, None where it cannot be read any more."""
        try:
            return Path(self.file).read_text(encoding="utf-8")
        except OSError:
            return None


def coverage(verdicts: Iterable[Verdict]) -> list[FileCoverage]:
    """Add up what all cases have tried, by file: whether they passed or not."""
    found: dict[Place, NodeCoverage] = {}
    for verdict in verdicts:
        for record in verdict.nodes:
            place = (record.file, record.line, record.kind, record.name)
            node = found.setdefault(place, NodeCoverage(record.line, record.kind, record.name, frozenset(record.ends)))
            _add(node, record)
    files: dict[str, list[NodeCoverage]] = {}
    for (file, *_), node in found.items():
        files.setdefault(file, []).append(node)
    return [
        FileCoverage(shown_path(Path(file)), sorted(files[file], key=lambda node: node.line)) for file in sorted(files)
    ]


def _add(node: NodeCoverage, record: NodeRecord) -> None:
    node.statuses |= {status for status, count in record.statuses.items() if count}
    node.reasons |= dict.fromkeys(record.reasons)


def lines_of(files: Iterable[FileCoverage]) -> Iterator[str]:
    """Yield the coverage as plain text: a line a file, and one for each node of which something was not tried."""
    for each in files:
        seen, possible = each.endings
        yield f"{each.file}: {each.ticked} of {len(each.nodes)} nodes ticked, {seen} of {possible} endings seen"
        for node in each.nodes:
            if node.lacks():
                name = node.kind if node.kind == node.name else f"{node.kind} '{node.name}'"
                yield f"  {each.file}:{node.line}: {name}: {node.lacks()}"
