"""Report of an import: everything that is not as in the original, with its place."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

from missions.plugins.interchange.xml_reader import Element

STUB, LOST, DIFFERS, RENAMED = "stub", "not carried over", "differs", "renamed"
"""Kinds of remarks: a stub leaf; a node or an attribute without a counterpart; a similar meaning; another name."""

KINDS_IN_ORDER = (LOST, STUB, DIFFERS, RENAMED)

EXPLANATIONS = {
    LOST: "Not carried over",
    STUB: "Stub leaves, which refuse to run until you write them",
    DIFFERS: "Carried over with a difference",
    RENAMED: "Renamed",
}


@dataclass(frozen=True, slots=True)
class Remark:
    """One line of the report."""

    kind: str
    place: str
    subject: str
    text: str

    def __str__(self) -> str:
        return f"{self.place}: {self.subject}: {self.text}" if self.subject else f"{self.place}: {self.text}"


@dataclass(slots=True)
class ImportReport:
    """Remarks of an import, each once, and counts of nodes for statistics."""

    remarks: dict[Remark, None] = field(default_factory=dict)
    carried: Counter[str] = field(default_factory=Counter)
    stubbed: Counter[str] = field(default_factory=Counter)

    def add(self, kind: str, element: Element, text: str, subject: str = "") -> None:
        """Add a remark at the place of an element."""
        self.remarks[Remark(kind, f"{element.source.name}:{element.line}", subject or element.tag, text)] = None

    def lines(self) -> Iterator[str]:
        """Yield the report as text, by kinds of remarks."""
        for kind in KINDS_IN_ORDER:
            found = [remark for remark in self.remarks if remark.kind == kind]
            if found:
                yield f"{EXPLANATIONS[kind]}:"
                yield from (f"  {remark}" for remark in found)

    def markdown(self, title: str) -> str:
        """Return the report as a page."""
        lines = [f"# {title}", ""]
        for kind in KINDS_IN_ORDER:
            found = [remark for remark in self.remarks if remark.kind == kind]
            if found:
                lines += [f"## {EXPLANATIONS[kind]}", "", *(f"- {_escaped(str(remark))}" for remark in found), ""]
        if not self.remarks:
            lines += ["Everything was carried over.", ""]
        return "\n".join(lines)


def _escaped(text: str) -> str:
    return " ".join(text.split()).replace("<", "\\<").replace("|", "\\|")
