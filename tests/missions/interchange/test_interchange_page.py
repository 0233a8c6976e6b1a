"""The page on imports shows what an import writes."""

import re
from pathlib import Path

import pytest

from behaviours.catalogue import LEAVES
from missions.library.shipped import load_mission
from missions.plugins.interchange.exporter import export_mission
from missions.plugins.interchange.importer import import_python_tree, import_trees

PAGE = (Path(__file__).parents[3] / "docs" / "interchange.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


def block(language: str, number: int = 0) -> str:
    return blocks(language)[number]


def test_the_example_is_imported_as_the_page_shows(tmp_path: Path) -> None:
    (tmp_path / "deliver.xml").write_text(block("xml"))
    imported = import_trees(tmp_path / "deliver.xml", LEAVES)
    assert imported.files["deliver.yaml"] == block("yaml")
    assert imported.files["behaviours/deliver.py"] == next(text for text in blocks("python") if "Stub leaves" in text)
    assert all(line in PAGE for line in imported.report.lines())


def test_the_tree_from_python_is_imported_as_the_page_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("trees.py").write_text(next(text for text in blocks("python") if "def patrol" in text))
    imported = import_python_tree("trees.py:patrol", LEAVES)
    assert all(line in PAGE for line in imported.report.lines())


def test_the_example_is_exported_as_the_page_shows(tmp_path: Path) -> None:
    (tmp_path / "fetch.yaml").write_text(block("yaml", 1))
    exported = export_mission(load_mission(str(tmp_path / "fetch.yaml")))
    assert block("xml", 1) in exported.text
    assert all(line in PAGE for line in exported.lines())
