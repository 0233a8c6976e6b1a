"""Clips of real people, which are no part of the repository: tests that need them skip where there are none."""

import os
from pathlib import Path

_NAMED = os.environ.get("MISSIONTREE_FOOTAGE")
_BESIDE = sorted(Path(__file__).parents[2].glob("*/data/faces/truth.json"))

FOOTAGE = Path(_NAMED) if _NAMED else _BESIDE[0].parent if _BESIDE else Path("no footage")
"""The folder that the environment names, else one that lies beside the repository: clips, and the faces in them."""
