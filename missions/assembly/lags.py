"""What was learnt of a robot's delays, kept for its next run: a small file of JSON a robot."""

import json
import math
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote

from config.reading import read_regular
from missions.folders import state_folder
from perception.delay import GRID, Delay

KNOWN = 0.015
"""Seconds, one sigma, within which a delay must be known to be kept."""

ENOUGH = 30
"""Pairs of pictures from which it must have been learnt."""


def lags_file(robot: str) -> Path:
    """Return where the delays of a robot are kept."""
    return state_folder() / "lags" / f"{quote(robot, safe='')}.json"


def believed(robot: str, told: float) -> float:
    """Return how late the camera of ``robot`` stamps its pictures, in seconds: as learnt before, else as ``told``."""
    try:
        found = json.loads(read_regular(lags_file(robot), 1000))["camera"]
    except (OSError, ValueError, KeyError, TypeError):
        return told
    sound = isinstance(found, float) and math.isfinite(found) and GRID[0] <= found <= GRID[-1]
    return found if sound else told


def keep(robot: str, delay: Delay) -> None:
    """Write down what was learnt, if it is known well by now. Raises OSError where nothing can be written."""
    if delay.pairs < ENOUGH or delay.spread > KNOWN:
        return
    path = lags_file(robot)
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    number, name = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(number, "w", encoding="utf-8") as file:
            json.dump({"camera": round(delay.seconds, 4), "spread": round(delay.spread, 4), "pairs": delay.pairs}, file)
        Path(name).replace(path)
    except OSError:
        with suppress(OSError):
            Path(name).unlink()
        raise
