"""What calibration has found of a camera's lens, as the camera section of a robot file says it, and kept there."""

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

from config.editing import NotEditableError, require_own, rewrite, with_value
from config.faults import InvalidFileError, Source
from config.marked import read_source
from config.robot import RobotConfig
from config.units import written
from drivers.api.senses import CameraKeys, DistortionKeys
from missions.library.drivers import robot_of

COEFFICIENTS = tuple(field.name for field in fields(DistortionKeys))
"""The coefficients by which a lens bends a picture, in the order that OpenCV has."""

AGAIN = "mission camera calibrate SOURCE --board 9x6 --square '25 mm' --keep FILE"


def lens_entries(field_of_view: float, centre: tuple[float, float], distortion: Sequence[float]) -> dict[str, str]:
    """Return the keys of the camera section with their values, as they are written."""
    bent = ", ".join(f"{name}: {value:.5f}" for name, value in zip(COEFFICIENTS, distortion, strict=True))
    return {
        "field_of_view": written(field_of_view, "angle"),
        "centre_x": written(centre[0], "share"),
        "centre_y": written(centre[1], "share"),
        "distortion": f"{{{bent}}}",
    }


def lens_size(path: Path) -> tuple[int, int]:
    """Return the width and height of the pictures for which a robot file is to keep a lens.

    Raises NotEditableError for a file in which no lens will be kept: better before the board is held up.
    Raises InvalidFileError for what is no robot file.
    """
    require_own(path, AGAIN)
    camera = _camera(robot_of(read_source(path)))
    return camera.width, camera.height


def keep_lens(path: Path, entries: dict[str, str]) -> None:
    """Write ``lens_entries`` into a robot file, and nothing else.

    Raises NotEditableError where that cannot be, InvalidFileError for a file that is no robot's, OSError.
    """
    lens_size(path)
    source = read_source(path)
    old = robot_of(source)
    text = source.text
    for key, value in entries.items():
        if key == "distortion" and _camera(old).distortion is not None:
            for pair in value.strip("{}").split(", "):
                name, number = pair.split(": ")
                text = with_value(Source(source.name, text), ("camera", key, name), number)
        else:
            text = with_value(Source(source.name, text), ("camera", key), value)
    if not _differs_by_the_lens(old, Source(source.name, text), entries):
        what = "; ".join(f"{key}: {value}" for key, value in entries.items())
        raise NotEditableError(f"{path}: it is written in a way that cannot be changed here; write {what}")
    rewrite(path, text)


def _camera(robot: RobotConfig) -> CameraKeys:
    if robot.camera is None:
        raise NotEditableError(f"{robot.name} has no camera: add a section 'camera' to its file first")
    return robot.camera


def _differs_by_the_lens(old: RobotConfig, source: Source, entries: dict[str, str]) -> bool:
    """Say whether the new text means the same robot with the lens of ``entries``: an anchor may stand for more."""
    try:
        new = robot_of(source)
    except InvalidFileError:  # the anchor was lost
        return False
    was, is_now = _camera(old), _camera(new)
    told = lens_entries(is_now.field_of_view, is_now.centre, is_now.bent or (0.0,) * len(COEFFICIENTS))
    rest = replace(
        is_now,
        field_of_view=was.field_of_view,
        centre_x=was.centre_x,
        centre_y=was.centre_y,
        distortion=was.distortion,
    )
    return told == entries and new.with_keys("camera", rest) == old
