"""Where what is kept for the user has its folder, as the XDG base directory specification says."""

import os
from collections.abc import Mapping
from pathlib import Path

from config.defaults import home_folder


def data_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return where the user's data are kept: models, pictures of people."""
    return _folder(environment.get("XDG_DATA_HOME", ""), ".local/share")


def state_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return where is kept what happened, to go on from there: the queue of tasks."""
    return _folder(environment.get("XDG_STATE_HOME", ""), ".local/state")


def runtime_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return where is kept what ends with the session: the sockets of runs. Without such a folder, that of the state.

    The system makes XDG_RUNTIME_DIR for this user alone, and empties it at the last log-out.
    """
    named = environment.get("XDG_RUNTIME_DIR", "")
    return Path(named) / "missiontree" if Path(named).is_absolute() else state_folder(environment) / "run"


def checkup_file(environment: Mapping[str, str] = os.environ) -> Path:
    """Return where the last check-up of `mission doctor` is kept, for the studio."""
    return state_folder(environment) / "doctor.json"


def _folder(named: str, otherwise: str) -> Path:
    """Return ours in the folder ``named``; what is no absolute path counts as not set, says the specification."""
    return (Path(named) if Path(named).is_absolute() else home_folder() / otherwise) / "missiontree"
