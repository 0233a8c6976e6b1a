"""The extras of MissionTree: which distributions each one asks for, and which of these are installed."""

import platform
import re
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

DISTRIBUTION = "missiontree"

_REQUIREMENT = re.compile(r"^([\w.-]+)[^;]*(?:;.*extra == ['\"]([\w-]+)['\"])?")

DEVELOPER_EXTRA = "dev"


def extras() -> dict[str, list[str]]:
    """Return the distributions that each extra asks for on this machine; those always needed under an empty name."""
    found: dict[str, list[str]] = {}
    for need in _requirements():
        match = _REQUIREMENT.match(need)
        elsewhere = "platform_machine" in need and platform.machine() not in need
        if match is not None and match[2] != DEVELOPER_EXTRA and not elsewhere:
            found.setdefault(match[2] or "", []).append(match[1])
    return found


def missing_distributions(names: Iterable[str]) -> list[str]:
    """Return those of some distributions that are not installed."""
    found = installed_distributions()
    return [name for name in names if _normalized(name) not in found]


def extra_hint(extra: str, *hints: str) -> str:
    """Return ``hints`` in one line, behind the command that installs an extra where a part of it is missing."""
    missing = missing_distributions(extras().get(extra, ()))
    return "; ".join(filter(None, [f"pip install 'missiontree[{extra}]'" if missing else "", *hints]))


def installed_distributions() -> Mapping[str, Path]:
    """Return the metadata folders of all installed distributions by normalized name, ``NAME-VERSION.dist-info``.

    Each start asks for them; to import ``importlib.metadata`` takes longer than to list the folders.
    """
    found: dict[str, Path] = {}
    for folder in map(Path, sys.path):
        with suppress(OSError):
            for info in folder.glob("*.dist-info"):
                found.setdefault(_normalized(info.name.partition("-")[0]), info)
    return found


def _normalized(name: str) -> str:
    """Return the name of a distribution as PEP 503 compares it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _requirements() -> Iterable[str]:
    """Return the requirements of MissionTree; none if its metadata cannot be read."""
    info, key = installed_distributions().get(DISTRIBUTION), "Requires-Dist: "
    with suppress(OSError):
        if info is not None:
            lines = Path(info, "METADATA").read_text(encoding="utf-8").partition("\n\n")[0].splitlines()
            return [line.removeprefix(key) for line in lines if line.startswith(key)]
    return ()
