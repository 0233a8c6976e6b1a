"""Replies of virtual servos as they meet on the one wire: in turn, or on top of each other."""

from collections.abc import Sequence
from functools import reduce
from itertools import zip_longest
from operator import or_

from drivers.virtual.servo import VirtualServo

Slot = list[tuple[VirtualServo, bytes]]
"""Replies that leave at the same moment: that of one servo, or those of several that share an ID."""


def overlaid(replies: Sequence[bytes]) -> bytes:
    """Return what is read when ``replies`` are sent at the same moment: the wire carries every bit that any sets."""
    return (
        bytes(reduce(or_, column) for column in zip_longest(*replies, fillvalue=0)) if len(replies) > 1 else replies[0]
    )
