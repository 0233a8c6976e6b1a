"""The installed MissionTree: its version, and which of its extras are there."""

import os
import platform
from collections.abc import Iterator
from importlib.metadata import version

from config.defaults import config_folder
from drivers.api.findings import Finding, wrong
from drivers.extras import OURS, extras, lacking
from missions.library.folders import data_folder, state_folder


def own_folders() -> Iterator[Finding]:
    """Say which of the user's folders cannot be written: records, answers and defaults are kept there."""
    for what, folder in (("configuration", config_folder()), ("state", state_folder()), ("data", data_folder())):
        there = next(each for each in (folder, *folder.parents) if os.path.lexists(each))
        if not there.is_dir():
            yield wrong("folders", f"{folder}, of the {what}: {there} is not a folder", f"ls -ld {there}")
        elif not os.access(there, os.W_OK | os.X_OK):
            yield wrong(
                "folders", f"{folder}, of the {what}: {there} cannot be written", f"ls -ld {there}; df -h {there}"
            )


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
