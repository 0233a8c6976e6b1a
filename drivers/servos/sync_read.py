"""One round of readings: the state of every servo, in as few exchanges as its model allows."""

from collections.abc import Iterator, Sequence
from types import MappingProxyType

from drivers.clock import Clock
from drivers.errors import BadRequest, NoReply
from drivers.servos.bus import ServoBus
from drivers.servos.codec import CODECS
from drivers.servos.joint import Joint
from drivers.servos.models import ReadMode
from drivers.servos.register import RegisterBlock
from drivers.servos.units import RETURN_DELAY_STEP

GROUP_READ_TIMEOUT = 2.0
"""Seconds after which group reads are disabled, if servos answer none of them, but do answer single reads."""

_REQUEST_BYTES = MappingProxyType({"single": 8, "bulk": 3, "sync": 1})
"""Bytes of a read request for each servo: a packet of its own, or its share of a common packet."""


class GroupReader:
    """Reads the fast block of many servos. Not thread-safe.

    Servos that support group reads are read together by one request. A servo that did not answer the last group read,
    or that was silent before, is read alone, so that it cannot delay the others. Older firmware does not support group
    reads.
    """

    def __init__(self, bus: ServoBus, clock: Clock) -> None:
        self._bus = bus
        self._clock = clock
        self._disabled_modes: set[ReadMode] = set()
        self._failing_since: dict[ReadMode, float] = {}

    def reset(self) -> None:
        """Enable all group reads again, because the servos may have been replaced by ones that support them."""
        self._disabled_modes.clear()
        self._failing_since.clear()

    def read(self, joints: Sequence[Joint]) -> Iterator[tuple[Joint, bool]]:
        """Read each joint once, into its copy of the table; yield each joint and whether it answered.

        Raises NotConnected.
        """
        alone: list[Joint] = []
        groups: dict[ReadMode, list[Joint]] = {"bulk": [], "sync": []}
        for joint in joints:
            reads = joint.model.read_mode
            single = reads == "single" or joint.missed_reads or reads in self._disabled_modes
            (alone if single else groups[reads]).append(joint)
        for reads, members in groups.items():
            if len(members) > 1:
                yield from self._read_group_or_singly(members, reads)
            elif members:
                alone += members
                self._failing_since.pop(reads, None)
        for joint in alone:
            yield joint, self._read_single(joint)

    def _read_group_or_singly(self, members: Sequence[Joint], mode: ReadMode) -> Iterator[tuple[Joint, bool]]:
        """Read a group with one request, then each servo that did not answer with a request of its own.

        Yields each joint, and whether it answered.
        """
        heard = self._read_group(members, mode)
        answered = False
        for joint in members:
            here = joint.name in heard or self._read_single(joint)
            answered = answered or here
            yield joint, here
        if heard:
            self._failing_since.pop(mode, None)
        elif answered:
            now = self._clock.now()
            if now - self._failing_since.setdefault(mode, now) > GROUP_READ_TIMEOUT:
                self._disabled_modes.add(mode)

    def _read_group(self, members: Sequence[Joint], mode: ReadMode) -> set[str]:
        """Read a group at once; return the names of the joints that answered."""
        wanted = {joint.address: joint.model.table.fast_block for joint in members}
        found = self._bus.read_many(wanted, mode="sync" if mode == "sync" else "bulk")
        heard = [joint for joint in members if joint.address in found]
        for joint in heard:
            joint.store(joint.model.table.fast_block, found[joint.address])
        return {joint.name for joint in heard}

    def _read_single(self, joint: Joint) -> bool:
        """Read one servo, once: a missed reading costs less than the time of a second try."""
        fast: RegisterBlock = joint.model.table.fast_block
        try:
            joint.store(fast, self._bus.read_block(joint.address, fast.address, fast.size, tries=1))
        except (NoReply, BadRequest):
            return False
        return True


def round_duration(joints: Sequence[Joint], baud: int) -> tuple[float, float]:
    """Return how long it takes to read ``joints`` once: the seconds on the wire, and the seconds of return delay."""
    size, delay = 0, 0
    for joint in joints:
        asked = _REQUEST_BYTES[joint.model.read_mode]
        size += asked + CODECS[joint.address.protocol].overhead + joint.model.table.fast_block.size
        delay += joint.value("return_delay")
    return size * 10 / baud, delay * RETURN_DELAY_STEP
