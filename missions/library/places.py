"""Where the places of a robot are kept, by name."""

from collections.abc import Mapping
from pathlib import Path

from config.places import PlaceKeys, load_places
from config.robot import RobotConfig
from drivers.api.sections import Ros2Keys
from missions.library.folders import data_folder


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
