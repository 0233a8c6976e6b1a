"""Replies that did not come in time. They may still come, and must not be taken for the answer to something else.

A reply says who sends it, but not what it answers: all replies of a servo with the same number of bytes look alike. So
what a servo still owes is remembered by size, and nothing else of that size is asked of it meanwhile: a read is widened
to another size, a write, whose reply has no data, has to wait.
"""

from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

from drivers.servos.codec import Codec, Reply
from drivers.servos.register import Block
from drivers.servos.wire import REFUSAL, Fault, Packet

LATE = 0.05
"""Seconds by which a reply can be late, and be overtaken by another. No adapter holds bytes back for longer."""

MARGIN = 2
"""Bytes by which a reply can look longer than it is: where its length is wrong by so much, in protocol 1.0, the header
of the next packet makes its checksum right."""

FORGOTTEN = 1.0
"""Seconds after which a reply will not come any more, from a servo that has not answered anything else either."""


class Wanted(NamedTuple):
    """What a servo is asked for: a reply with ``size`` bytes of data.

    Replies to equal questions are as good as each other: those to the tries of one read, which ``began`` at one time,
    and those to equal writes.
    """

    question: object
    size: int
    began: float


class _Owed(NamedTuple):
    wanted: Wanted
    since: float


class Overdue:
    """What the servos of a bus owe, by ID. Times are those of the bus's clock."""

    def __init__(self) -> None:
        self._owed: dict[int, list[_Owed]] = {}

    def add(self, servo: int, wanted: Wanted, now: float) -> None:
        """Remember that ``servo`` has not answered."""
        kept = [owed for owed in self._owed.get(servo, ()) if now - owed.since < FORGOTTEN]
        self._owed[servo] = [*kept, _Owed(wanted, now)]

    def came(self, servo: int, size: int) -> bool:
        """Strike off a reply that has come after all; return whether one of that size was owed."""
        for owed in self._owed.get(servo, ()):
            if owed.wanted.size == size:
                self._owed[servo].remove(owed)
                return True
        return False

    def answered(self, servo: int, wanted: Wanted) -> None:
        """Strike off what will not come any more, for the servo has answered what it was asked long after that."""
        if owed := self._owed.get(servo):
            self._owed[servo] = [o for o in owed if o.since > wanted.began - LATE]

    def until(self, servo: int, wanted: Wanted, seconds: float = LATE) -> float:
        """Return when the last reply that could be mistaken for the one ``wanted`` is ``seconds`` overdue."""
        if not self._owed.get(servo):
            return 0.0
        return max(
            (
                owed.since + seconds
                for owed in self._owed[servo]
                if 0 <= wanted.size - owed.wanted.size <= MARGIN and owed.wanted.question != wanted.question
            ),
            default=0.0,
        )

    def clear(self, servo: int, wanted: Wanted, now: float) -> bool:
        """Return whether nothing that is owed could be mistaken for the reply that is ``wanted``."""
        return now >= self.until(servo, wanted, FORGOTTEN)

    def widened(self, servo: int, block: Block, question: object, now: float) -> Block:
        """Return the smallest block that contains ``block`` and whose reply cannot be mistaken for one that is owed."""
        wide = block
        while self._owed.get(servo) and not self.clear(servo, Wanted(question, wide.size, now), now):
            wide = Block(max(0, wide.address - 1), wide.size + 1)
        return wide

    def forget(self) -> None:
        """Forget everything: nothing of what was asked can be answered any more."""
        self._owed.clear()


class Exchange:
    """Takes packets as they arrive, and sorts them.

    ``replies`` holds what has been answered or refused, by ID; ``spoilt`` the servos whose reply, or whose request,
    was damaged on its way; ``missing`` those that may still answer. ``garbled`` is True once something came that may
    have been a reply of theirs. ``doubles`` holds the IDs of replies beyond the one that was requested. ``stray`` is
    told every sound reply that nobody waits for, and says whether it was
    owed from before; what equals one of ``sent`` is the adapter's echo of our own request.
    """

    def __init__(
        self,
        codec: Codec,
        wanted: Mapping[int, Wanted],
        stray: Callable[[Reply], bool],
        sent: Collection[Packet] = (),
    ) -> None:
        self.codec = codec
        self.replies: dict[int, Reply] = {}
        self.spoilt: set[int] = set()
        self.doubles: list[int] = []
        self.missing = dict(wanted)
        self.garbled = False
        self._stray = stray
        self._sent = sent

    def take(self, packet: Packet) -> None:
        """Take one packet; a reply counts only if it is whole, from a servo that is asked, and of the right size."""
        reply = self.codec.reply(packet)
        if reply is None or (reply.faults and packet in self._sent):  # as a reply, any echo has error bits
            return
        wanted = self.missing.get(reply.id)
        size = len(reply.data)
        if not packet.intact:
            self.garbled = True
            if wanted and size == wanted.size:
                self._spoil(reply.id)
        elif wanted is None:
            if not self._stray(reply):
                self.doubles.append(reply.id)
        elif not size and reply.faults & Fault.CHECKSUM:  # what the servo has heard was damaged
            self._spoil(reply.id)
        elif size == wanted.size or (not size and reply.faults & REFUSAL and not self._stray(reply)):
            self.replies[reply.id] = reply
            del self.missing[reply.id]
        elif size and not self._stray(reply):
            self.garbled = True

    def _spoil(self, servo: int) -> None:
        self.spoilt.add(servo)
        del self.missing[servo]
