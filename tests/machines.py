"""State machines whose transition table is a dict at the head of a module: rules that all of them keep, and walks."""

import random
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import TypeVar

import pytest

Table = Mapping[tuple[Enum, Enum], Enum]
T = TypeVar("T")

ROOT = Path(__file__).parents[1]
PACKAGES = "missions", "behaviours", "drivers", "perception", "config"


class RecordingTable(dict[tuple[Enum, Enum], Enum]):
    """A transition table that notes which entries were looked up, and which pairs it lacks."""

    def __init__(self, table: Table) -> None:
        super().__init__(table)
        self.visited: set[tuple[Enum, Enum]] = set()
        self.missing: set[tuple[Enum, Enum]] = set()

    def __getitem__(self, pair: tuple[Enum, Enum]) -> Enum:
        (self.visited if pair in self else self.missing).add(pair)
        return super().__getitem__(pair)

    def get(self, pair: tuple[Enum, Enum], default: Enum | None = None) -> Enum | None:  # type: ignore[override]
        (self.visited if pair in self else self.missing).add(pair)
        return super().get(pair, default)


def tables() -> dict[str, Table]:
    """Return every transition table of the product by "module.NAME"."""
    found: dict[str, Table] = {}
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        if "TRANSITIONS: Final" in path.read_text():
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            names = vars(import_module(module))
            found |= {f"{module}.{name}": names[name] for name in names if name.endswith("TRANSITIONS")}
    return found


def reachable(table: Table, initial: Enum) -> set[Enum]:
    """Return the states that events lead to from ``initial``."""
    found = {initial}
    while more := {after for (before, _), after in table.items() if before in found} - found:
        found |= more
    return found


def walk(
    patch: pytest.MonkeyPatch,
    name: str,
    make: Callable[[], T],
    actions: Sequence[Callable[[T, random.Random], object]],
    *,
    walks: int = 200,
    steps: int = 30,
) -> RecordingTable:
    """Do random ``actions`` on objects that ``make`` returns; return the table ``name`` with the visited entries."""
    module, _, attribute = name.rpartition(".")
    table = RecordingTable(tables()[name])
    patch.setattr(import_module(module), attribute, table)
    for seed in range(walks):
        rng = random.Random(seed)  # noqa: S311 - a test
        subject = make()
        for _ in range(steps):
            rng.choice(actions)(subject, rng)
    return table
