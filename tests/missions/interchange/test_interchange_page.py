"""The page on imports shows what an import writes."""

import re
from pathlib import Path

from behaviours.catalogue import LEAVES
from missions.plugins.interchange.importer import import_trees

PAGE = (Path(__file__).parents[3] / "docs" / "interchange.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found = re.search(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert found is not None
    return found[1]


def test_the_example_is_imported_as_the_page_shows(tmp_path: Path) -> None:
    (tmp_path / "deliver.xml").write_text(block("xml"))
    imported = import_trees(tmp_path / "deliver.xml", LEAVES)
    assert imported.files["deliver.yaml"] == block("yaml")
    assert imported.files["behaviours/deliver.py"] == block("python")
    assert all(line in PAGE for line in imported.report.lines())
