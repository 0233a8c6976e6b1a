"""Extras of MissionTree: the distributions that each requires, and which of them are installed."""

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
    """Return the distributions that each extra requires on this machine, by name of the extra.

    The empty name has those that MissionTree requires without any extra.
    """
    result: dict[str, list[str]] = {}
    for requirement in _requirements():
        match = _REQUIREMENT.match(requirement)
        is_for_other_machine = "platform_machine" in requirement and platform.machine() not in requirement
        if match is not None and match[2] != DEVELOPER_EXTRA and not is_for_other_machine:
            result.setdefault(match[2] or "", []).append(match[1])
    return result


def missing_distributions(names: Iterable[str]) -> list[str]:
    """Return those of the distributions ``names`` that are not installed."""
    installed = installed_distributions()
    return [name for name in names if _normalized(name) not in installed]


def extra_hint(extra: str, *hints: str) -> str:
    """Return ``hints`` as one line.

    If a distribution that ``extra`` requires is missing, the line begins with the command that installs the extra.
    """
    missing = missing_distributions(extras().get(extra, ()))
    return "; ".join(filter(None, [f"pip install 'missiontree[{extra}]'" if missing else "", *hints]))


def installed_distributions() -> Mapping[str, Path]:
    """Return the metadata folders of all installed distributions by normalized name, ``NAME-VERSION.dist-info``.

    Each start needs them, and importing ``importlib.metadata`` takes longer than listing the folders.
    """
    folders: dict[str, Path] = {}
    for folder in map(Path, sys.path):
        with suppress(OSError):
            for info in folder.glob("*.dist-info"):
                folders.setdefault(_normalized(info.name.partition("-")[0]), info)
    return folders


def _normalized(name: str) -> str:
    """Return the name of a distribution as normalized by PEP 503."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _requirements() -> Iterable[str]:
    """Return the requirements of MissionTree; empty if its metadata cannot be read."""
    info, key = installed_distributions().get(DISTRIBUTION), "Requires-Dist: "
    with suppress(OSError):
        if info is not None:
            lines = Path(info, "METADATA").read_text(encoding="utf-8").partition("\n\n")[0].splitlines()
            return [line.removeprefix(key) for line in lines if line.startswith(key)]
    return ()
