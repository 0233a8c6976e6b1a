"""Where what is kept for the user has its folder, as the XDG base directory specification says."""

import os
from collections.abc import Mapping
from pathlib import Path

from config.defaults import home_folder
from config.places import PlaceKeys, load_places
from config.robot import RobotConfig
from drivers.api.sections import Ros2Keys


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


# Where the places of a robot are kept, by name.


def places_file(config: RobotConfig) -> Path:
    """Return the file of a robot's places: the one that its file names, beside it, or one among the user's data."""
    keys = config.keys(Ros2Keys)
    named = "" if keys is None else keys.places
    if not named:
        return data_folder() / "places" / f"{config.name}.yaml"
    path = Path(named).expanduser()
    return path if config.path is None else config.path.parent / path


def places_of(config: RobotConfig) -> Mapping[str, PlaceKeys]:
    """Return the places of a robot; none for one that knows no map. Raises InvalidFileError."""
    return load_places(places_file(config)) if "ros2" in config.sections else {}
