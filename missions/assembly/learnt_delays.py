"""The learnt delays of a robot, kept for its next run: a small file of JSON a robot.

It holds for the robot file from which it was learnt: with another port, lens or ramp, it is learnt anew.
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
"""Seconds, one sigma, within which the lag of a base must be known to be kept; see ``Delay.known`` for the camera."""

MIN_SAMPLES = 30
"""Pairs of pictures, or reports of the base, from which it must have been learnt."""

MAX_FILE_SIZE = 1000
"""Bytes that such a file has at most."""

CAMERA, BASE = "camera", "base"
"""The keys of the two delays, in seconds."""

MIN_LAGS = {CAMERA: MIN_DELAY, BASE: lag.LAG_GRID[0]}
MAX_LAGS = {CAMERA: MAX_DELAY, BASE: lag.LAG_GRID[-1]}
"""Seconds that each can be."""


def delays_file(robot: str) -> Path:
    """Return where the delays of a robot are kept."""
    return state_folder() / "lags" / f"{quote(robot, safe='')}.json"


class LearntDelays:
    """The delays of a robot: ``delay`` of its camera, with the lag of its head, and ``lag`` of its base.

    Both begin with what earlier runs have kept, where its file is still the same, and learn on. A ``simulated`` robot
    neither takes from earlier runs nor keeps: its delays are those of its world. With ``other_camera``, a source other
    than that of the robot file, only the lag of the base is taken and kept.
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
        """The delay of the camera. A robot whose pictures are not searched never asks, and loads no numpy for it."""
        from perception.delay import CameraDelay  # noqa: PLC0415

        return CameraDelay(0.0 if self._other_camera else self._stored.get(CAMERA, self._told))

    def save(self) -> None:
        """Write down what is known well by now, and drop what has proved wrong.

        Raises OSError where nothing can be written.
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
    """Return what tells a robot file from any other; nothing for one that is no file, or no longer there."""
    try:
        return "" if config.path is None else hashlib.sha256(config.path.read_bytes()).hexdigest()
    except OSError:
        return ""


def load_delays(config: RobotConfig) -> dict[str, float]:
    """Return the delays in seconds that earlier runs have kept of a robot, by ``CAMERA`` and ``BASE``.

    What is not sound, or was learnt from another robot file, counts as none.
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
