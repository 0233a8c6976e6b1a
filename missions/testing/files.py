"""Finding test files: by path, by folder, or by the mission that they test."""

from collections.abc import Iterator
from pathlib import Path

from config.library import UnknownNameError
from missions.library.shipped import TESTS, find_mission, shipped_missions
from missions.testing.suite import beside, is_test_file


def named_tests(name: str) -> list[Path]:
    """Return the test files that ``name`` means: itself, all in a folder and below, or the one of a mission.

    Raises config.library.UnknownNameError where there is none.
    """
    path = Path(name)
    if path.is_dir():
        found = list(_below(path))
        if not found:
            raise UnknownNameError(f"{name}: this folder holds no tests (files that end in {TESTS})")
        return found
    if is_test_file(path):
        if not path.is_file():
            raise UnknownNameError(f"'{name}': no such file")
        return [path]
    here = Path(f"{name}{TESTS}")
    if here.is_file():
        return [here]
    tests = beside(find_mission(name))
    if not tests.is_file():
        raise UnknownNameError(
            f"mission '{name}' has no tests: there is no {tests}\n"
            f"  try: write it, beginning with `tests: {tests.name.removesuffix(TESTS)}` and `cases:` (docs/testing.md)"
        )
    return [tests]


def all_tests() -> list[Path]:
    """Return the test files here and below; those of the library where there are none."""
    return list(_below(Path())) or [tests for path in shipped_missions().values() if (tests := beside(path)).is_file()]


def _below(folder: Path) -> Iterator[Path]:
    """Test files in a folder and below, but not in hidden ones, such as a virtual environment."""
    for path in sorted(folder.rglob(f"*{TESTS}")):
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if path.is_file() and not hidden:
            yield path
