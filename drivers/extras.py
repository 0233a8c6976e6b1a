"""The extras of MissionTree: which distributions each one asks for, and which of these are installed."""

import platform
import re
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, requires, version

OURS = "missiontree"

_NEED = re.compile(r"^([\w.-]+)[^;]*(?:;.*extra == ['\"]([\w-]+)['\"])?")

FOR_DEVELOPERS = "dev"


def extras() -> dict[str, list[str]]:
    """Return the distributions that each extra asks for on this machine; those always needed under an empty name."""
    found: dict[str, list[str]] = {}
    for need in requires(OURS) or ():
        match = _NEED.match(need)
        elsewhere = "platform_machine" in need and platform.machine() not in need
        if match is not None and match[2] != FOR_DEVELOPERS and not elsewhere:
            found.setdefault(match[2] or "", []).append(match[1])
    return found


def lacking(names: Iterable[str]) -> list[str]:
    """Return those of some distributions that are not installed."""
    return [name for name in names if not _is_installed(name)]


def extra_hint(extra: str, *hints: str) -> str:
    """Return ``hints`` in one line, behind the command that installs an extra where a part of it is missing."""
    missing = lacking(extras().get(extra, ()))
    return "; ".join(filter(None, [f"pip install 'missiontree[{extra}]'" if missing else "", *hints]))


def _is_installed(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True
