"""Nodes to scans: what came of one turn, sorted into beams of the base."""

from math import tau

import numpy as np
import numpy.typing as npt

from drivers.api import Ranges, RangeScan
from drivers.rplidar.models import SAMPLES, Model
from drivers.rplidar.mounting import BEAMS, START, STEP, Mounting, beam
from drivers.rplidar.nodes import TURN, Nodes, Words

SECTOR = 10
"""Degrees: every sector of this width must have been measured in a turn, but for ``LOST`` of them."""

LOST = 4
"""Sectors that a turn may lack, lost on the wire; with more it is not a whole turn."""

MAX_NODES = 8000
"""Nodes kept at most while no turn ends, as when the first node of each is lost: four seconds of them."""

METRES = 0.00025
"""Metres of one step of a distance."""


class Turns:
    """Collects nodes until a turn is whole. ``partial`` counts those that were not. For one thread."""

    def __init__(self, model: Model, mounting: Mounting) -> None:
        self.partial = 0
        self.samples = SAMPLES
        """Measurements a second."""
        self._model = model
        self._mounting = mounting
        self._number = 0
        self._kept: list[tuple[Words, Words, float]] = []  # angles, distances, when the first of them came
        self._count = 0

    def restart(self) -> None:
        """Forget the turn that has begun; the numbers go on."""
        self._kept.clear()
        self._count = 0

    def add(self, nodes: Nodes, now: float) -> RangeScan | None:
        """Take nodes, the last of them ``now`` (seconds); return the newest turn that they complete, if any."""
        scan, start = None, 0
        for end in map(int, np.flatnonzero(nodes.new)):
            self._keep(nodes, start, end, now)
            scan = self._finish(self._came(nodes, end, now)) or scan
            start = end
        self._keep(nodes, start, len(nodes), now)
        return scan

    def _keep(self, nodes: Nodes, start: int, end: int, now: float) -> None:
        if self._count > MAX_NODES:
            self.restart()
        if start < end:
            self._kept.append((nodes.angle[start:end], nodes.distance[start:end], self._came(nodes, start, now)))
            self._count += end - start

    def _finish(self, now: float) -> RangeScan | None:
        """Return the turn that has ended; None if too little of it came."""
        if not self._kept:
            return None
        angle = np.concatenate([part[0] for part in self._kept]).astype(np.float64)
        distance = np.concatenate([part[1] for part in self._kept])
        came = np.concatenate([np.full(len(part[0]), part[2]) for part in self._kept])
        self.restart()
        # Where the node that begins a turn was lost there are two turns: only the newer one counts.
        onward = np.unwrap(angle, period=TURN)
        newest = onward > onward[-1] - TURN
        place = beam(self._mounting.bearing(angle[newest] * (tau / TURN)))
        if len(np.unique(place // SECTOR)) < BEAMS // SECTOR - LOST:
            self.partial += 1
            return None
        ranges = self._sorted(place, distance[newest])
        begun = float(came[newest][0])
        self._number += 1
        model = self._model
        return RangeScan(ranges, START, STEP, (begun + now) / 2, self._number - 1, model.least, model.most)

    def _sorted(self, place: npt.NDArray[np.intp], distance: Words) -> Ranges:
        """Return the least distance of each beam; a beam between two measurements takes the lesser of both."""
        metres = (distance * METRES).astype(np.float32)
        metres[(metres < self._model.least) | (metres > self._model.most)] = np.inf
        ranges = np.full(BEAMS, np.inf, dtype=np.float32)
        np.minimum.at(ranges, place, metres)
        measured = np.bincount(place, minlength=BEAMS) > 0
        beside = np.minimum(np.roll(ranges, 1), np.roll(ranges, -1))
        ranges[~measured] = beside[~measured]
        ranges[np.isinf(ranges) | self._mounting.hidden] = np.nan
        return ranges

    def _came(self, nodes: Nodes, number: int, now: float) -> float:
        """Return when one of several nodes came, the last of them ``now``: they wait for each other on their way."""
        return now - (len(nodes) - 1 - number) / self.samples
