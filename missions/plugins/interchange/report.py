"""Report of an import: every difference between the original trees and their missions, with its place in the XML."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from missions.plugins.interchange.xml_reader import Element

STUB, WRITTEN = "stub", "written"
LOST, DIFFERS, RENAMED, UNUSED = "not carried over", "differs", "renamed", "unused"
"""Kinds of remarks: a stub leaf; a node or an attribute without a counterpart; a similar meaning; another name.

``WRITTEN`` is a leaf that was a stub of an earlier import. ``UNUSED`` is an entry of the user's table of leaves
without effect.
"""

EXPLANATIONS = {
    LOST: "Not carried over",
    STUB: "Stub leaves, which refuse to run until you write them",
    WRITTEN: "Leaves that you have written",
    DIFFERS: "Carried over with a difference",
    RENAMED: "Renamed",
    UNUSED: "Without effect in your table of leaves",
}


@dataclass(frozen=True, slots=True)
class Remark:
    """One line of the report: its kind, the place in the XML file, the node that it is about, and a text."""

    kind: str
    place: str
    subject: str
    text: str

    def __str__(self) -> str:
        return f"{self.place}: {self.subject}: {self.text}" if self.subject else f"{self.place}: {self.text}"


@dataclass(slots=True)
class ImportReport:
    """Remarks about an import, each only once.

    ``carried`` and ``stubbed`` count the nodes of each kind that were translated, or replaced by a stub leaf.
    """

    remarks: dict[Remark, None] = field(default_factory=dict)
    carried: Counter[str] = field(default_factory=Counter)
    stubbed: Counter[str] = field(default_factory=Counter)

    def add(self, kind: str, element: Element, text: str, subject: str = "") -> None:
        """Add a remark of a kind, such as ``LOST``, at the file and line of an element.

        ``subject`` is the kind of node that it is about; by default the element's tag.
        """
        self.remarks[Remark(kind, f"{element.source.name}:{element.line}", subject or element.tag, text)] = None

    def lines(self) -> Iterator[str]:
        """Yield the lines of the report as text for the terminal, grouped by the kind of remark."""
        return grouped_lines(self.remarks, EXPLANATIONS)

    def markdown(self, title: str) -> str:
        """Return the report as a Markdown page with this title."""
        lines = [f"# {title}", ""]
        for heading, found in _grouped(self.remarks, EXPLANATIONS):
            lines += [f"## {heading}", "", *(f"- {_escaped(str(remark))}" for remark in found), ""]
        if not self.remarks:
            lines += ["Everything was carried over.", ""]
        return "\n".join(lines)


def grouped_lines(remarks: Iterable[Remark], headings: Mapping[str, str]) -> Iterator[str]:
    """Yield remarks as lines of text, below the heading of their kind."""
    for heading, found in _grouped(remarks, headings):
        yield f"{heading}:"
        yield from (f"  {remark}" for remark in found)


def _grouped(remarks: Iterable[Remark], headings: Mapping[str, str]) -> Iterator[tuple[str, list[Remark]]]:
    remarks = list(remarks)
    for kind, heading in headings.items():
        if found := [remark for remark in remarks if remark.kind == kind]:
            yield heading, found


def _escaped(text: str) -> str:
    return " ".join(text.split()).replace("<", "\\<").replace("|", "\\|").replace("[", "\\[")
