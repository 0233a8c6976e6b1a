"""The architecture page agrees with the code: packages, dependencies, names and numbers."""

import re
import tomllib
from dataclasses import fields, is_dataclass
from importlib import import_module
from inspect import isclass
from pathlib import Path
from typing import Any

import pytest

from drivers.table import BUILT_IN_DRIVERS
from tests.benchmarks.house import arrows, cycles

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
DECISIONS = ROOT / "docs" / "decisions"
PACKAGES = ("missions", "behaviours", "drivers", "perception", "config")
DOTTED = re.compile(rf"`((?:{'|'.join(PACKAGES)})(?:\.\w+)+)`")
DEVICES = {f"drivers/{where.split('.')[1]}/" for kind in BUILT_IN_DRIVERS.values() for where in kind.values()}


def resolve(name: str) -> Any:
    """Return the object of a dotted name; for a field of a dataclass, its default."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        try:
            here: Any = import_module(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        for part in parts[end:]:
            kept = {field.name: field.default for field in fields(here)} if isclass(here) and is_dataclass(here) else {}
            here = kept[part] if part in kept else getattr(here, part)
        return here
    raise ModuleNotFoundError(name)


PAGES = {path.name: path.read_text(encoding="utf-8") for path in sorted(DECISIONS.glob("*.md"))}
PAGES["architecture.md"] = PAGE
GLOSSARY = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
PAGES["glossary.md"] = GLOSSARY


@pytest.mark.parametrize("page", PAGES)
def test_every_name_on_a_page_exists(page: str) -> None:
    missing = []
    for name in dict.fromkeys(DOTTED.findall(PAGES[page])):
        if name.endswith((".py", ".yaml", ".md")):
            continue
        try:
            resolve(name)
        except (ModuleNotFoundError, AttributeError) as error:
            missing.append(f"{name}: {error}")
    assert missing == [], page


@pytest.mark.parametrize("page", PAGES)
def test_every_path_on_a_page_exists(page: str) -> None:
    text = PAGES[page]
    paths = re.findall(r"`((?:docs|tests|" + "|".join(PACKAGES) + r")/[\w/.]*)`", text)
    folder = ROOT / "docs" if page in ("architecture.md", "glossary.md") else DECISIONS
    links = re.findall(r"\]\(([^)#:]+)\)", text)
    missing = [path for path in paths if not (ROOT / path).exists() and "DEVICE" not in path]
    assert missing + [link for link in links if not (folder / link).exists()] == []


def test_every_module_file_on_the_page_exists() -> None:
    files = {path.name for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
    assert [name for name in re.findall(r"`([a-z]\w*\.py)`", PAGE) if name not in files] == []


def listed_packages() -> list[str]:
    """Return the packages in the first column of the table on the page."""
    table = PAGE.partition("## Packages")[2].partition("\n## ")[0]
    return re.findall(r"^\| `([^`]+)`", table, re.MULTILINE)


def existing_packages() -> set[str]:
    """Return the packages, their folders, and the modules directly in `missions`."""
    rooms = {f"{package}/" for package in PACKAGES}
    rooms |= {
        f"{path.parent.relative_to(ROOT)}/" for package in PACKAGES for path in ROOT.glob(f"{package}/*/__init__.py")
    }
    rooms |= {str(path.relative_to(ROOT)) for path in ROOT.glob("missions/[!_]*.py")}
    return (rooms - DEVICES) | {"drivers/DEVICE/", "drivers/servos/"}


def test_the_page_lists_exactly_the_packages_of_the_code() -> None:
    assert sorted(listed_packages()) == sorted(existing_packages())


def layers(contract: dict[str, Any]) -> list[set[str]]:
    return [{room.strip() for room in layer.split("|")} for layer in contract["layers"]]


def test_layers_on_the_page_match_import_linter() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    held = [contract for contract in contracts if contract["type"] == "layers"]
    drawn = dict(re.findall(r"^```layers ?(\w*)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE))
    assert {name: layers({"layers": text.splitlines()}) for name, text in drawn.items()} == {
        "".join(contract.get("containers", [])): layers(contract) for contract in held
    }


def test_packages_have_no_dependency_cycle() -> None:
    assert cycles(arrows()) == []


def test_numbers_on_the_page_match_the_constants() -> None:
    table = PAGE.partition("## Numbers and their constants")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (.+?) \| (.+?) \| (.+?) \|$", table, re.MULTILINE)[2:]
    assert len(rows) > 12
    for rule, figures, names in rows:
        meant = [float(figure.removesuffix(" s")) for figure in figures.split(", ")]
        assert [resolve(name) for name in DOTTED.findall(names)] == meant, rule


def test_decision_index_has_every_title() -> None:
    index = (DECISIONS / "README.md").read_text(encoding="utf-8")
    for number, path in enumerate(sorted(DECISIONS.glob("0*.md")), 1):
        title = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
        assert path.name.startswith(f"{number:04d}-")
        assert f"[{title}]({path.name})" in index


def test_every_term_of_the_glossary_is_unique_and_names_a_module_or_a_page() -> None:
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", GLOSSARY, re.MULTILINE)
    rows = [row for row in rows if row[0] != "term" and not row[0].startswith("-")]
    terms = [term for term, _, _ in rows]
    assert len(terms) > 100
    assert len(set(terms)) == len(terms)
    assert [term for term, meaning, _ in rows if not meaning.endswith(".")] == []
    assert [term for term, _, place in rows if not DOTTED.search(place) and "](" not in place] == []
