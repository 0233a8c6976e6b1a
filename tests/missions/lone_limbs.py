"""A virtual arm or head in a process of its own, which lives on whatever becomes of the program that moves it.

As a program (``arm`` or ``head``) it tells its port, answers each line on its stdin with what its witness has seen so
far, and ends with it. All times are those of the device's own clock, on which its joints turn: how long this machine
makes anybody wait does not count. Somebody turns those joints of the arm to and fro that are limp.
"""

import json
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from math import radians, sin
from subprocess import PIPE

from drivers.arduino.virtual import VirtualRodney
from drivers.clock import SystemClock
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.terminal import PseudoTerminal, WireDevice
from tests.forked import Forked

JOINTS = {
    "shoulder": "AX-12A",
    "elbow": "AX-12A",
    "wrist": "AX-12A",
    "hip": "MX-28",
    "knee": "XL430-W250",
    "ankle": "XM430-W350",
}
"""The joints of the arm, with their servos: of both protocols, and read in all three ways."""

FEETECH = dict.fromkeys(JOINTS, "STS3215")
"""The joints of an arm of Feetech servos."""

SPEED = radians(170)
"""rad/s at most, of each joint of the arm."""

STILL = 1e-9
"""A change of an angle by less is none."""

JUST_NOW = 0.1
"""Seconds for which a joint counts as moving after it has moved."""


@dataclass
class Seen:
    """When the device last heard anything, when a joint last moved, and what time it is ``now``, in seconds.

    ``fastest`` is the greatest speed of a joint (rad/s, or degrees a second of the head's servos), and ``step`` the
    longest way that a servo was sent at once (degrees, of the head alone), since ``forget``. ``limp`` counts joints
    without torque.
    """

    heard_at: float = 0.0
    moved_at: float = 0.0
    now: float = 0.0
    fastest: float = 0.0
    step: float = 0.0
    limp: int = 0
    places: list[float] = field(default_factory=list)

    @property
    def moving(self) -> bool:
        """Whether a joint moves: a hobby servo does so in small steps, with a rest after each."""
        return self.moved_at > 0 and self.now - self.moved_at < JUST_NOW


class Witness(ABC):
    """A ``WireDevice`` that passes everything on to another, and looks at it 500 times a second."""

    STEP = 0.002

    def __init__(self, device: WireDevice) -> None:
        self.seen = Seen()
        self.device = device
        self._looked_at = 0.0

    @property
    def baud(self) -> int:
        return self.device.baud

    def feed(self, data: bytes, now: float) -> bytes:
        self._look(now)
        self.seen.heard_at = now
        return self.device.feed(data, now)

    def poll(self, now: float) -> bytes:
        self._look(now)
        return self.device.poll(now)

    def forget(self) -> None:
        """Begin anew with what was greatest."""
        self.seen.fastest = self.seen.step = 0.0

    @abstractmethod
    def places(self, now: float) -> list[tuple[float, bool]]:
        """Return where the joints are, and which of them turn by themselves: nobody turns them by hand."""

    def _look(self, now: float) -> None:
        """Let the joints turn on to ``now`` in small steps, and see when they come to rest."""
        before, seen = self.seen.places, self.seen
        while self._looked_at < now:
            then, self._looked_at = self._looked_at, min(now, max(self._looked_at + self.STEP, now - 1.0))
            places = self.places(self._looked_at)
            both = zip(places, before or [place for place, _ in places], strict=True)
            way = max((abs(place - earlier) for (place, by_itself), earlier in both if by_itself), default=0.0)
            seen.fastest = max(seen.fastest, way / (self._looked_at - then))
            if way > STILL:
                seen.moved_at = self._looked_at
            before = seen.places = [place for place, _ in places]
        seen.now = now


class ArmWitness(Witness):
    def __init__(self, models: Iterable[str]) -> None:
        servos = [VirtualServo(number, model=model) for number, model in enumerate(models, 1)]
        super().__init__(VirtualServoBus(servos))
        self._servos = servos

    def places(self, now: float) -> list[tuple[float, bool]]:
        for servo in self._servos:
            servo.advance(now)
            if servo.limp:
                servo.turn_by_hand(0.8 * sin(2.0 * now))
        self.seen.limp = sum(servo.limp for servo in self._servos)
        return [(servo.angle, not servo.limp) for servo in self._servos]


class HeadWitness(Witness):
    def __init__(self) -> None:
        self._rodney = VirtualRodney()
        super().__init__(self._rodney)
        self._goals: dict[int, int] = {}

    def places(self, now: float) -> list[tuple[float, bool]]:
        for index, angle in self._rodney.commands:
            self.seen.step = max(self.seen.step, abs(angle - self._goals.get(index, angle)))
            self._goals[index] = angle
        self._rodney.commands.clear()
        return [(self._rodney.angle(index, now), True) for index in (0, 1)]


class LoneLimbs:
    """The process, as the test sees it."""

    def __init__(self, process: Forked) -> None:
        self._process = process
        self.port = self._line()

    def seen(self, *, forget: bool = False) -> Seen:
        """Ask what the witness has seen; with ``forget`` it begins anew then."""
        if self._process.stdin is None:
            raise RuntimeError("the limbs cannot be asked")
        self._process.stdin.write("forget\n" if forget else "\n")
        self._process.stdin.flush()
        return Seen(**json.loads(self._line()))

    def _line(self) -> str:
        return "" if self._process.stdout is None else self._process.stdout.readline().strip()


@contextmanager
def lone_limbs(kind: str) -> Iterator[LoneLimbs]:
    """Run an ``arm``, a ``feetech`` arm or a ``head`` in another process."""
    with Forked("tests.missions.lone_limbs", kind, stdin=PIPE, stdout=PIPE) as process:
        yield LoneLimbs(process)  # its input is closed next, and so it ends


def main(kind: str) -> None:
    """Be the device until the input ends; tell its port first."""
    arms = {"arm": JOINTS, "feetech": FEETECH}
    witness: Witness = ArmWitness(arms[kind].values()) if kind in arms else HeadWitness()
    terminal = PseudoTerminal(kind, witness, SystemClock())
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
    main(sys.argv[1])
