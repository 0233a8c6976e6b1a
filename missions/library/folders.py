"""Folders for data of the user, by the XDG base directory specification."""

import os
from collections.abc import Mapping
from pathlib import Path

from config.defaults import home_folder
from config.places import PlaceKeys, load_places
from config.robot import RobotConfig
from drivers.api.sections import Ros2Keys


def data_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for the user's data: trained models, pictures of people."""
    return _folder(environment.get("XDG_DATA_HOME", ""), ".local/share")


def state_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for persistent state: the queue of tasks."""
    return _folder(environment.get("XDG_STATE_HOME", ""), ".local/state")


def runtime_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for data of a session, such as sockets; without XDG_RUNTIME_DIR, a state folder.

    The system creates XDG_RUNTIME_DIR for this user only, and empties it at the last logout.
    """
    folder = environment.get("XDG_RUNTIME_DIR", "")
    return Path(folder) / "missiontree" if Path(folder).is_absolute() else state_folder(environment) / "run"


def checkup_file(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the file with the last results of `mission doctor`, for the studio."""
    return state_folder(environment) / "doctor.json"


def _folder(named: str, otherwise: str) -> Path:
    """Return the folder ``missiontree`` in the folder ``named``, which comes from an environment variable.

    If that is not an absolute path, it is in ``otherwise``, a folder relative to the home folder.
    """
    return (Path(named) if Path(named).is_absolute() else home_folder() / otherwise) / "missiontree"


# Files with the named places of robots.


def places_file(config: RobotConfig) -> Path:
    """Return the file with the named places of a robot's map: from its robot file, or in the user's data folder."""
    keys = config.keys(Ros2Keys)
    file_name = "" if keys is None else keys.places
    if not file_name:
        return data_folder() / "places" / f"{config.name}.yaml"
    path = Path(file_name).expanduser()
    return path if config.path is None else config.path.parent / path


def places_of(config: RobotConfig) -> Mapping[str, PlaceKeys]:
    """Return the places of a robot's map by name; empty for a robot without ROS 2. Raises InvalidFileError."""
    return load_places(places_file(config)) if "ros2" in config.sections else {}
