"""Driver of the RPLIDAR: starts the scan when the device is online, and keeps the latest complete turn."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf, tau

import numpy as np
import numpy.typing as npt

from drivers.api import DeviceStatus, Health, Quality, Ranges, RangeScan, Reading, StatusCallback, ignore
from drivers.api.driver import DriverContext
from drivers.base.scan_mounting import BEAMS, START, STEP, Mounting, Place, Sector, beam
from drivers.clock import Clock
from drivers.errors import DeviceFault, DriverError, NoReply
from drivers.rplidar import capsules
from drivers.rplidar.capsules import CapsuleFinder
from drivers.rplidar.declared import RPLidarKeys
from drivers.rplidar.models import MODELS, SAMPLE_RATE, RPLidarModel
from drivers.rplidar.nodes import STEPS_PER_TURN, NodeFinder, Nodes, Words
from drivers.rplidar.session import RPLidarSession
from drivers.rplidar.wire import RPLidarInfo
from drivers.transport.link import SerialLink
from drivers.transport.loop import guard_callback

# Assembly of nodes into scans with the beams of the base.

SECTOR_WIDTH = 10
"""Degrees: a complete turn has a measurement in every sector of this width, except for ``MAX_LOST_SECTORS``."""

MAX_LOST_SECTORS = 4
"""Maximum number of sectors without a measurement in a turn that counts as complete; bytes may be lost on the wire."""

MAX_NODES = 8000
"""Maximum number of buffered nodes (four seconds) if the nodes that mark the start of a turn are lost."""

METRES_PER_STEP = 0.00025
"""Metres per unit of the distances on the wire."""


class ScanAssembler:
    """Assembles nodes into scans of one turn. ``partial_scans`` counts incomplete turns. Not thread-safe."""

    def __init__(self, model: RPLidarModel, mounting: Mounting) -> None:
        self.partial_scans = 0
        self.sample_rate = SAMPLE_RATE
        """Measurements per second of the current scan, from which arrival times are computed."""
        self._model = model
        self._mounting = mounting
        self._number = 0
        self._parts: list[tuple[Words, Words, float]] = []  # angles, distances, arrival time of the first of them
        self._count = 0

    def restart(self) -> None:
        """Drop the incomplete turn; the scan numbers continue."""
        self._parts.clear()
        self._count = 0

    def add(self, nodes: Nodes, now: float) -> RangeScan | None:
        """Add nodes, of which the last arrived at ``now`` (seconds); return the latest complete turn, if any."""
        scan, start = None, 0
        for end in map(int, np.flatnonzero(nodes.new)):
            self._keep(nodes, start, end, now)
            scan = self._finish(self._arrival_time(nodes, end, now)) or scan
            start = end
        self._keep(nodes, start, len(nodes), now)
        return scan

    def _keep(self, nodes: Nodes, start: int, end: int, now: float) -> None:
        if self._count > MAX_NODES:
            self.restart()
        if start < end:
            self._parts.append(
                (nodes.angle[start:end], nodes.distance[start:end], self._arrival_time(nodes, start, now))
            )
            self._count += end - start

    def _finish(self, now: float) -> RangeScan | None:
        """Return the turn that has ended as a scan; None if too many sectors have no measurement."""
        if not self._parts:
            return None
        angle = np.concatenate([part[0] for part in self._parts]).astype(np.float64)
        distance = np.concatenate([part[1] for part in self._parts])
        arrival_times = np.concatenate([np.full(len(part[0]), part[2]) for part in self._parts])
        self.restart()
        # If the first node of a turn was lost, there are two turns: only the newer one counts.
        onward = np.unwrap(angle, period=STEPS_PER_TURN)
        newest = onward > onward[-1] - STEPS_PER_TURN
        place = beam(self._mounting.bearing(angle[newest] * (tau / STEPS_PER_TURN)))
        if len(np.unique(place // SECTOR_WIDTH)) < BEAMS // SECTOR_WIDTH - MAX_LOST_SECTORS:
            self.partial_scans += 1
            return None
        ranges = self._beam_ranges(place, distance[newest])
        begun = float(arrival_times[newest][0])
        self._number += 1
        model = self._model
        return RangeScan(ranges, START, STEP, (begun + now) / 2, self._number - 1, model.min_range, model.max_range)

    def _beam_ranges(self, place: npt.NDArray[np.intp], distance: Words) -> Ranges:
        """Return the smallest distance in metres of each beam; NaN without an echo.

        ``place`` are the beam indices of the measurements. A beam without a measurement gets the smaller distance of
        its two neighbours.
        """
        metres = (distance * METRES_PER_STEP).astype(np.float32)
        metres[(metres < self._model.min_range) | (metres > self._model.max_range)] = np.inf
        ranges = np.full(BEAMS, np.inf, dtype=np.float32)
        np.minimum.at(ranges, place, metres)
        measured = np.bincount(place, minlength=BEAMS) > 0
        beside = np.minimum(np.roll(ranges, 1), np.roll(ranges, -1))
        ranges[~measured] = beside[~measured]
        ranges[np.isinf(ranges) | self._mounting.hidden] = np.nan
        return ranges

    def _arrival_time(self, nodes: Nodes, number: int, now: float) -> float:
        """Return the arrival time of a node in a chunk whose last node arrived at ``now``, by the sample rate."""
        return now - (len(nodes) - 1 - number) / self.sample_rate


STALE_AFTER = 0.5
"""Seconds without another turn after which the latest is stale: two missed turns at 5.5 turns per second."""

EXPRESS_TIMEOUT = 1.0
"""Seconds without a complete turn after which an express scan with lost bytes is replaced by a plain scan."""

SCAN_TIMEOUT = 3.0
"""Seconds without a complete turn after which the scan is restarted: a motor needs 2 s to reach its speed."""

RETRY_INTERVAL = 1.0
"""Seconds from a fault, such as a missing reply, to the next start; the motor is stopped in between."""

GATHER_TIME = 0.02
"""Seconds for which the link collects bytes before they are handled, since 4000 nodes per second arrive.

Without it the thread would wake a thousand times per second.
"""


class RPLidar:
    """Driver of an RPLIDAR over a serial link, which it owns: a ``drivers.api.Ranger``.

    ``model`` is a key of ``MODELS``. ``place`` is the mounting pose on the base: x forward and y left in metres, yaw in
    radians. ``blind`` are the sectors that the robot itself blocks; measurements there are dropped. A sector is two
    bearings in the frame of the base, in radians, and extends anticlockwise from the first to the second. The motor
    turns from ``open`` to ``close``. ``changed`` is called from the link's thread with each turn; it must return at
    once. Raises ValueError for an unknown model, and for a place that is not finite.
    """

    name = "range"

    def __init__(
        self,
        link: SerialLink,
        clock: Clock,
        *,
        model: str = "a1",
        place: Place = (0.0, 0.0, 0.0),
        blind: Sequence[Sector] = (),
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        if model not in MODELS:
            raise ValueError(f"{self.name}: unknown model '{model}' (known: {', '.join(MODELS)})")
        self._model = MODELS[model]
        self._mounting = Mounting(place, tuple(blind))
        self._link = link
        self._clock = clock
        self._report = guard_callback(report)
        self._changed = guard_callback(changed)
        self._assembler = ScanAssembler(self._model, self._mounting)
        # Written by the link's thread alone, and replaced, never altered: any thread may read them.
        self._session = self._new_session()
        self._finders: dict[bool, NodeFinder | CapsuleFinder] = {False: NodeFinder(), True: CapsuleFinder()}
        self._finder = self._finders[False]
        self._latest: Reading[RangeScan] = Reading(None, -inf, Quality.NONE)
        self._resyncs = 0
        self._scanned_at = -inf
        self._trouble: DriverError | None = None

    @property
    def place(self) -> Place:
        """Mounting pose on the base: x forward and y left in metres, yaw in radians."""
        return self._mounting.place

    @property
    def info(self) -> RPLidarInfo | None:
        """Model and firmware of the device; None before its reply on this connection."""
        return self._session.info

    def scan(self) -> Reading[RangeScan]:
        """Return the latest complete turn; stale ``STALE_AFTER`` seconds after its arrival."""
        latest, turned_at, now = self._latest, self._scanned_at, self._clock.now()
        if latest.value is None:
            return replace(latest, stamp=now)
        return latest if now - turned_at <= STALE_AFTER else replace(latest, quality=Quality.STALE)

    def open(self) -> None:
        """Start the search for the device; returns at once, with or without hardware."""
        self._link.open(self)

    def rest(self) -> None:
        """Do nothing: a range finder has no actuator, and continues to measure."""

    def close(self) -> None:
        """Stop the motor, end the thread and release the port. Safe from any state, more than once."""
        self._link.close()

    def health(self) -> Health:
        """Return whether complete turns arrive, and the counters of the wire."""
        link, finder = self._link.health(), self._finder
        counters = {
            **link.counters,
            "nodes": finder.nodes,
            "skipped bytes": finder.skipped_bytes,
            "slips": finder.resyncs,
            "partial turns": self._assembler.partial_scans,
        }
        trouble = self._trouble
        if not link.online:
            return Health(False, link.detail, link.hint, counters)
        if trouble is not None:
            return Health(False, str(trouble), trouble.hint, counters)
        if self._scanned_at == -inf:
            return Health(False, f"{self.name}: {self._link.port}: waiting for the first complete turn", "", counters)
        return Health(True, counters=counters)

    # What follows is drivers.transport.link.LinkHandler, called from the link's thread.

    def on_connected(self) -> None:
        """Start a new session on a port that was just opened."""
        self._session = self._new_session()
        self._trouble = None
        self._scanned_at = -inf

    def on_data(self, data: bytes) -> None:
        """Buffer received bytes; the next poll handles them."""
        self._session.on_data(data)

    def on_poll(self) -> None:
        """Start the scan, handle received nodes, and detect missing ones."""
        begun = self._session.scanning_since < inf
        try:
            data = self._session.poll()
            self._require_scans()
        except (NoReply, DeviceFault) as error:
            self._fail(error)
            return
        if not begun:
            express = self._session.is_express
            self._finder = self._finders[express]
            self._finder.restart()
            self._assembler.restart()
            self._resyncs = self._finder.resyncs
            self._assembler.sample_rate = capsules.EXPRESS_SAMPLE_RATE if express else SAMPLE_RATE
        if data:
            self._handle_nodes(data)

    def on_closing(self) -> None:
        """Stop the motor, although the thread may have been interrupted at any point."""
        self._session.stop()

    def _handle_nodes(self, data: bytes) -> None:
        now = self._clock.now()
        scan = self._assembler.add(self._finder.feed(data), now - self._finder.delay)
        if scan is None:
            return
        self._latest = Reading(scan, scan.stamp, Quality.GOOD)
        self._resyncs = self._finder.resyncs
        self._scanned_at = now  # last: a thread that sees it fresh also sees the scan
        if self._trouble is not None:
            self._trouble = None
            self._report(DeviceStatus(self.name, "online", f"{self._link.port}: complete turns arrive again"))
        self._changed()

    def _require_scans(self) -> None:
        """Raise NoReply if no complete turn has arrived for ``SCAN_TIMEOUT`` seconds during a scan.

        An express scan with lost bytes is replaced by a plain one after ``EXPRESS_TIMEOUT``. A lost byte costs one or
        two capsules of 32 measurements in an express scan, but only one measurement in a plain one.
        """
        elapsed = self._clock.now() - max(self._session.scanning_since, self._scanned_at)
        if self._session.is_express and elapsed > EXPRESS_TIMEOUT and self._finder.resyncs > self._resyncs:
            self._session.avoids_express = True
            self._session.restart(0.0)
        elif elapsed > SCAN_TIMEOUT:
            message = f"{self.name}: {self._link.port}: no complete turn for {SCAN_TIMEOUT:g} s"
            raise NoReply(message, hint="does its head turn? check its belt, and the power of its USB port")

    def _fail(self, error: DriverError) -> None:
        """Report a fault if it differs from the last one, and restart the session after ``RETRY_INTERVAL``."""
        if str(error) != str(self._trouble):
            kind = "fault" if isinstance(error, DeviceFault) else "offline"
            self._report(DeviceStatus(self.name, kind, str(error), error.hint))
        self._trouble = error
        self._session.restart(RETRY_INTERVAL)

    def _new_session(self) -> RPLidarSession:
        return RPLidarSession(self.name, self._model, self._link, self._clock, self._report)


def make(keys: RPLidarKeys, context: DriverContext) -> RPLidar:
    """Return the driver of an RPLIDAR."""
    link = SerialLink("range", context.port, keys.baud, gather_time=GATHER_TIME, report=context.report)
    return RPLidar(link, context.clock, model=keys.model, place=keys.place, blind=keys.blind, report=context.report)
