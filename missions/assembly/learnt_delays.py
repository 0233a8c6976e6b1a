"""Learnt delays of a robot, stored for its next run in a small JSON file.

A file is valid for the robot file with which it was learnt: with another port, lens or ramp, learning starts again.
"""

import hashlib
import json
import os
import tempfile
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from behaviours.tracking import lag_estimator as lag
from behaviours.tracking.lag_estimator import LagEstimator
from config.file_io import read_regular
from config.robot import RobotConfig
from missions.library.folders import state_folder
from perception.exposure_clock import MAX_DELAY, MIN_DELAY

if TYPE_CHECKING:
    from perception.delay import CameraDelay

MAX_LAG_SIGMA = 0.015
"""Maximum standard deviation in seconds with which the measured lag of a base is precise enough to be stored."""

MIN_SAMPLES = 30
"""Minimum number of measurements behind a stored delay: pairs of pictures for the camera, speed reports for the base.
"""

MAX_FILE_SIZE = 1000
"""Maximum size in bytes of a file with learnt delays."""

CAMERA, BASE = "camera", "base"
"""Keys of the two delays, in seconds."""

MIN_LAGS = {CAMERA: MIN_DELAY, BASE: lag.LAG_GRID[0]}
MAX_LAGS = {CAMERA: MAX_DELAY, BASE: lag.LAG_GRID[-1]}
"""Upper bounds in seconds of the stored delays of camera and base."""


def delays_file(robot: str) -> Path:
    """Return the file that stores the learnt delays of the robot with the name ``robot``."""
    return state_folder() / "lags" / f"{quote(robot, safe='')}.json"


class LearntDelays:
    """Learnt delays of a robot: ``delay`` of its camera (with the head's lag), and ``lag`` with which its base moves.

    Both start from the stored values if the robot file is unchanged, and keep learning. A ``simulated`` robot neither
    loads nor stores delays. With ``other_camera``, a source other than that of the robot file, only the lag of the base
    is loaded and stored.
    """

    def __init__(self, config: RobotConfig, *, simulated: bool, other_camera: bool = False) -> None:
        self._name, self._simulated = config.name, simulated
        self._file = "" if simulated else _fingerprint(config)
        self._stored = {} if simulated else load_delays(config)
        self._other_camera = other_camera
        self._told = 0.0 if config.camera is None else config.camera.delay
        self.lag = LagEstimator()
        if BASE in self._stored:
            self.lag.set_prior(self._stored[BASE], learnt=True)

    @cached_property
    def delay(self) -> "CameraDelay":
        """Delay of the camera. Created on first access, so that a run without detection does not load numpy."""
        from perception.delay import CameraDelay  # noqa: PLC0415

        return CameraDelay(0.0 if self._other_camera else self._stored.get(CAMERA, self._told))

    def save(self) -> None:
        """Store the delays that were measured precisely; remove a stored camera delay that has proved wrong.

        Raises OSError if the file cannot be written.
        """
        if self._simulated:
            return
        found, lag = dict(self._stored), self.lag
        if lag.reports >= MIN_SAMPLES and lag.spread <= MAX_LAG_SIGMA:
            found[BASE] = round(lag.seconds, 4)
        if "delay" in vars(self) and not self._other_camera:
            delay = self.delay
            if delay.informative_pairs >= MIN_SAMPLES and delay.is_known:
                found[CAMERA] = round(delay.seconds, 4)
            elif CAMERA in found and delay.contradicts(found[CAMERA]):
                del found[CAMERA]
        if found != self._stored:
            _write(delays_file(self._name), {"robot_file": self._file, **found})


def _fingerprint(config: RobotConfig) -> str:
    """Return the hash of a robot file, or an empty text without a readable file."""
    try:
        return "" if config.path is None else hashlib.sha256(config.path.read_bytes()).hexdigest()
    except OSError:
        return ""


def load_delays(config: RobotConfig) -> dict[str, float]:
    """Return the stored delays of a robot in seconds: a dict with the keys ``CAMERA`` and ``BASE``, as far as known.

    Invalid values, and those learnt with another robot file, are ignored.
    """
    try:
        found = json.loads(read_regular(delays_file(config.name), MAX_FILE_SIZE))
        if found["robot_file"] != _fingerprint(config):
            return {}
        delays = {CAMERA: found.get(CAMERA), BASE: found.get(BASE)}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}
    return {
        key: value
        for key, value in delays.items()
        if isinstance(value, float) and MIN_LAGS[key] <= value <= MAX_LAGS[key]  # and so it is no NaN either
    }


def _write(path: Path, found: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    number, name = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(number, "w", encoding="utf-8") as file:
            json.dump(found, file)
        Path(name).replace(path)
    except OSError:
        with suppress(OSError):
            Path(name).unlink()
        raise
