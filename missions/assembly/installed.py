"""The installed MissionTree: its version, and which of its extras are there."""

import platform
import re
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageNotFoundError, requires, version

from drivers.api.findings import Finding, wrong

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
    return [name for name in names if not _there(name)]


def installation() -> Iterator[Finding]:
    """Say what is installed, and what is broken in it."""
    wanted = extras()
    yield Finding("program", f"MissionTree {version(OURS)}, Python {platform.python_version()}")
    if missing := lacking(wanted.pop("", ())):
        cure = f"pip install {' '.join(missing)}"
        yield wrong("packages", f"{', '.join(missing)}: asked for by MissionTree, and not installed", cure)
    there = {extra: not lacking(names) for extra, names in wanted.items()}
    have = ", ".join(extra for extra, whole in there.items() if whole) or "none"
    rest = ", ".join(extra for extra, whole in there.items() if not whole)
    cure = f"pip install 'missiontree[{rest.split(', ')[0]}]'  (and so on, where you need it)" if rest else ""
    yield Finding("extras", f"{have}" + (f"; not installed: {rest}" if rest else ""), cure=cure)


def _there(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True
