"""The installed MissionTree: its version, and which of its extras are there."""

import platform
from collections.abc import Iterator
from importlib.metadata import version

from drivers.api.findings import Finding, wrong
from drivers.extras import OURS, extras, lacking


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
