"""A virtual base in a process of its own, which lives on whatever becomes of the program that drives it.

As a program it tells its port, answers each line on its stdin with what its witness has seen so far, and ends with it.
All times are those of the base's own clock, on which its body rolls: how long this machine makes anybody wait does not
count.
"""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from subprocess import PIPE

from drivers.clock import SystemClock
from drivers.kobuki.virtual import VirtualKobuki
from drivers.virtual.terminal import PseudoTerminal
from tests.forked import Forked

LONE_ROBOT = str(Path(__file__).with_name("lone_turtlebot2.yaml"))
"""The file of a robot `turtlebot2` that has no other device to wait for."""


@dataclass
class Seen:
    """When the base last heard anything, and since when it has been at rest; ``moving`` says that it is not.

    ``gap`` is the longest time for which it heard nothing, since ``top`` (the greatest speed of a wheel, m/s) began.
    """

    heard_at: float = 0.0
    rest_at: float = 0.0
    moving: bool = False
    gap: float = 0.0
    top: float = 0.0


class Witness:
    """A ``WireDevice`` that passes everything on to a base, and looks at it 1000 times a second while it moves."""

    STEP = 0.001

    def __init__(self, base: VirtualKobuki | None = None) -> None:
        self.base = base or VirtualKobuki()
        self.seen = Seen()
        self._looked_at = 0.0

    @property
    def baud(self) -> int:
        return self.base.baud

    def feed(self, data: bytes, now: float) -> bytes:
        self._look(now)
        if self.seen.moving:
            self.seen.gap = max(self.seen.gap, now - self.seen.heard_at)
        self.seen.heard_at = now
        return self.base.feed(data, now)

    def poll(self, now: float) -> bytes:
        self._look(now)
        return self.base.poll(now)

    def next_poll_time(self) -> float | None:
        return self.base.next_poll_time()

    def forget(self) -> None:
        """Begin anew with what was greatest."""
        self.seen.gap = self.seen.top = 0.0

    def _look(self, now: float) -> None:
        """Let the body roll on to ``now`` in small steps, and see when it comes to rest."""
        while self._looked_at < now:
            self._looked_at = min(now, max(self._looked_at + self.STEP, now - 1.0))
            self.base.pose(self._looked_at)
            speed = max(map(abs, self.base.wheels.speeds))
            if self.seen.moving and speed == 0.0:
                self.seen.rest_at = self._looked_at
            self.seen.moving = speed > 0.0
            self.seen.top = max(self.seen.top, speed)


class LoneBase:
    """The process, as the test sees it."""

    def __init__(self, process: Forked) -> None:
        self._process = process
        self.port = self._line()

    def seen(self, *, forget: bool = False) -> Seen:
        """Ask what the witness has seen; with ``forget`` it begins anew then."""
        if self._process.stdin is None:
            raise RuntimeError("the base cannot be asked")
        self._process.stdin.write("forget\n" if forget else "\n")
        self._process.stdin.flush()
        return Seen(**json.loads(self._line()))

    def _line(self) -> str:
        return "" if self._process.stdout is None else self._process.stdout.readline().strip()


@contextmanager
def lone_base() -> Iterator[LoneBase]:
    """Run a base in another process."""
    with Forked("tests.missions.lone_base", stdin=PIPE, stdout=PIPE) as process:
        yield LoneBase(process)  # its input is closed next, and so it ends


def main() -> None:
    """Be the base until the input ends; tell its port first."""
    witness = Witness()
    terminal = PseudoTerminal("kobuki", witness, SystemClock())
    terminal.open()
    try:
        print(terminal.path, flush=True)  # noqa: T201 - what the test reads
        for line in sys.stdin:
            seen = terminal.call_paused(lambda: asdict(witness.seen))
            if line.strip():
                terminal.call_paused(witness.forget)
            print(json.dumps(seen), flush=True)  # noqa: T201
    finally:
        terminal.close()


if __name__ == "__main__":
    main()
