"""One request and the replies to it: what of all that is heard meanwhile answers what was asked."""

from collections.abc import Callable, Collection, Mapping

from drivers.dynamixel.codec import Codec, Reply
from drivers.dynamixel.overdue import Wanted
from drivers.dynamixel.wire import REFUSAL, Fault, Packet


class Exchange:
    """Takes packets as they arrive, and sorts them.

    ``replies`` holds what has been answered or refused, by ID; ``spoilt`` the servos whose reply, or whose request,
    was damaged on its way; ``missing`` those that may still answer. ``garbled`` is True once something came that may
    have been a reply of theirs. ``stray`` is told every sound reply that nobody waits for, and says whether it was
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
            self._stray(reply)
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
