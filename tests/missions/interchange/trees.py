"""Small trees of BehaviorTree.CPP for tests, and their import."""

from pathlib import Path

from behaviours.catalogue import LEAVES
from missions.plugins.interchange.importer import ImportedProject, import_trees


def tree_text(body: str, *, format: str = ' BTCPP_format="4"', more: str = "") -> str:  # noqa: A002 - as in the file
    """Return a file with one tree, and ``more`` elements beside it."""
    return f'<root{format}><BehaviorTree ID="Patrol">{body}</BehaviorTree>{more}</root>'


def import_text(folder: Path, text: str, name: str = "patrol.xml") -> ImportedProject:
    """Import the text of one file."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return import_trees(path, LEAVES)


def tree_lines(imported: ImportedProject, mission: str = "patrol") -> list[str]:
    """Return the lines below ``tree:`` of a mission, without their common indentation."""
    text = imported.files[f"{mission}.yaml"].split("tree:", 1)[1]
    return [
        line.removeprefix("  ").removeprefix(" ") if number == 0 else line.removeprefix("  ")
        for number, line in enumerate(text.removeprefix("\n").splitlines())
    ]


def remarks(imported: ImportedProject, kind: str = "") -> list[str]:
    """Return the remarks of the report, all or those of one kind."""
    return [str(remark) for remark in imported.report.remarks if kind in ("", remark.kind)]
