"""One round of readings: the state of every servo, in as few exchanges as its model allows."""

from collections.abc import Iterator, Sequence
from types import MappingProxyType

from drivers.clock import Clock
from drivers.errors import BadRequest, NoReply
from drivers.servos.bus import Bus
from drivers.servos.codec import CODECS
from drivers.servos.joint import Joint
from drivers.servos.models import Reads
from drivers.servos.register import Block
from drivers.servos.units import RETURN_DELAY_STEP

IN_VAIN = 2.0
"""Seconds of group reads that bring nothing from servos that do answer, after which none is tried any more."""

_ASKED = MappingProxyType({"single": 8, "bulk": 3, "sync": 1})
"""Bytes of a request that each servo adds to a round: its own packet, or its part in one for all."""


class Gathering:
    """Reads the fast block of many servos. For one thread.

    Servos that can be read by one request are; one that such a read missed, or that was silent before, is asked by
    itself, so that it cannot keep the others from answering. Older firmware does not know the reads of groups.
    """

    def __init__(self, bus: Bus, clock: Clock) -> None:
        self._bus = bus
        self._clock = clock
        self._given_up: set[Reads] = set()
        self._in_vain_since: dict[Reads, float] = {}

    def reset(self) -> None:
        """Forget what the servos can: there may be others now."""
        self._given_up.clear()
        self._in_vain_since.clear()

    def read(self, joints: Sequence[Joint]) -> Iterator[tuple[Joint, bool]]:
        """Read each joint once, into its copy of the table; return with each whether it answered.

        Raises NotConnected.
        """
        alone: list[Joint] = []
        groups: dict[Reads, list[Joint]] = {"bulk": [], "sync": []}
        for joint in joints:
            reads = joint.model.reads
            single = reads == "single" or joint.failures or reads in self._given_up
            (alone if single else groups[reads]).append(joint)
        for reads, members in groups.items():
            if len(members) > 1:
                yield from self._together(members, reads)
            elif members:
                alone += members
                self._in_vain_since.pop(reads, None)
        for joint in alone:
            yield joint, self._alone(joint)

    def _together(self, members: Sequence[Joint], reads: Reads) -> Iterator[tuple[Joint, bool]]:
        """Read a group at once, and those that it missed one by one."""
        heard = self._group(members, reads)
        answered = False
        for joint in members:
            here = joint.name in heard or self._alone(joint)
            answered = answered or here
            yield joint, here
        if heard:
            self._in_vain_since.pop(reads, None)
        elif answered:
            now = self._clock.now()
            if now - self._in_vain_since.setdefault(reads, now) > IN_VAIN:
                self._given_up.add(reads)

    def _group(self, members: Sequence[Joint], reads: Reads) -> set[str]:
        """Read a group at once; return the names of those that answered."""
        wanted = {joint.at: joint.model.table.fast for joint in members}
        found = self._bus.read_many(wanted, how="sync" if reads == "sync" else "bulk")
        heard = [joint for joint in members if joint.at in found]
        for joint in heard:
            joint.take(joint.model.table.fast, found[joint.at])
        return {joint.name for joint in heard}

    def _alone(self, joint: Joint) -> bool:
        """Read one servo, once: a reading that was missed costs less than the time of a second try."""
        fast: Block = joint.model.table.fast
        try:
            joint.take(fast, self._bus.read_block(joint.at, fast.address, fast.size, tries=1))
        except (NoReply, BadRequest):
            return False
        return True


def duration(joints: Sequence[Joint], baud: int) -> tuple[float, float]:
    """Return how long (s) a round is on the wire, and how long the servos wait in it before they answer."""
    size, delay = 0, 0
    for joint in joints:
        asked = _ASKED[joint.model.reads]
        size += asked + CODECS[joint.at.protocol].overhead + joint.model.table.fast.size
        delay += joint.value("return_delay")
    return size * 10 / baud, delay * RETURN_DELAY_STEP
