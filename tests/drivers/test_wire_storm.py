"""A storm on the wire of a base: whatever becomes of the bytes, of the plug and of who commands, it comes to rest.

Real driver, virtual base, simulated time; a seed stands for all that happens. ``TRIES=500`` plays as many.
"""

from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from math import inf, nan
from random import Random

from drivers.api import ZERO_VELOCITY, Velocity
from drivers.errors import DriverError
from drivers.kobuki.driver import kobuki_base
from drivers.kobuki.virtual import VirtualKobuki
from drivers.sim.timeline import Timeline
from tests.drivers.cranked import HandWire
from tests.tries import tries

SECONDS = 8.0
TICK, LOOK = 0.05, 0.02

RESTS = 0.7
"""Seconds from the last command that was taken, or the last that came over a wire that is cut, or the end, to rest."""

MISHAPS = ("bytes lost", "bytes bent", "bytes doubled", "silence", "unplugged", "frozen", "stalled", "bumped")
GOALS = (0.2, -0.2, 0.4, 99.0, -99.0, nan, inf)


@dataclass
class Bent:
    """A device whose commands are damaged on their way to it."""

    device: VirtualKobuki
    bend: Callable[[bytes], bytes] = bytes
    heard_at: float = 0.0

    @property
    def baud(self) -> int:
        return self.device.baud

    def feed(self, data: bytes, now: float) -> bytes:
        if heard := self.bend(data):
            self.heard_at = now
        return self.device.feed(heard, now)

    def poll(self, now: float) -> bytes:
        return self.device.poll(now)

    def next_poll_time(self) -> float | None:
        return self.device.next_poll_time()


class Storm:
    """One seed: what happens to whom, and when; ``wrong`` is what must not be."""

    def __init__(self, seed: int) -> None:
        self.chance = Random(f"wire {seed}")  # noqa: S311 - a draw is no secret
        self.timeline = Timeline()
        self.clock = self.timeline.clock
        self.kobuki = VirtualKobuki()
        self.bent = Bent(self.kobuki)
        self.wire = HandWire(self.bent, self.timeline)
        self.base = kobuki_base(self.wire.link("base"), self.clock)
        self.happening: Counter[str] = Counter()
        self.struck: Counter[str] = Counter()
        self.goal = Velocity(0.2, 0.0)
        self.taken_at, self.ended = 0.0, inf
        self.wrong: list[str] = []
        self.wire.distort = self.bent.bend = self._distorted

    def play(self) -> None:
        """Let it all happen."""
        self.base.open()
        for _ in range(self.chance.choice([1, 2, 4, 6])):
            what = self.chance.choice(MISHAPS)
            begin, seconds = self.chance.uniform(0.2, SECONDS), self.chance.choice([0.1, 0.3, 0.8, 2.0, 6.0])
            self.timeline.call_at(begin, partial(self._switch, what, on=True))
            self.timeline.call_at(begin + seconds, partial(self._switch, what, on=False))
        self.timeline.call_every(TICK, self._command)
        self.timeline.call_every(LOOK, self._look)
        end = self.chance.uniform(1.0, SECONDS)
        self.timeline.call_at(end, self._end)
        self.timeline.run_until(end + 2.0)

    def _switch(self, what: str, *, on: bool) -> None:
        self.happening[what] += 1 if on else -1
        self.struck[what] += on
        lasts = self.happening[what] > 0
        match what:
            case "unplugged":
                if lasts:
                    self.wire.unplug()
                elif self.wire.holder is None:
                    self.wire.plug_in()
            case "frozen":
                self.kobuki.frozen = lasts
            case "bumped":
                self.kobuki.bumper = type(self.kobuki.bumper)(left=lasts)

    def _command(self) -> None:
        """Ask for something, as a mission does at each tick; nothing while it is stalled."""
        if self.clock.now() >= self.ended or self.happening["stalled"] > 0:
            return
        if self.chance.random() < 0.1:
            self.goal = Velocity(self.chance.choice(GOALS), self.chance.choice([0.0, 1.0, -30.0]))
        with suppress(DriverError):
            self.base.drive(self.goal)
            self.taken_at = self.clock.now()

    def _end(self) -> None:
        self.ended = self.clock.now()
        self.base.close()

    def _look(self) -> None:
        """See how it truly moves."""
        now = self.clock.now()
        velocity, limits = self.kobuki.body.velocity, self.base.limits
        self.kobuki.pose(now)
        if abs(velocity.linear) > limits.speed * 1.05 + 0.01 or abs(velocity.angular) > limits.turn * 1.05 + 0.01:
            self.wrong.append(f"at {now:.2f} s it moves at {velocity}, and may {limits}")
        cut = self.wire.holder is None or self.happening["silence"] > 0
        if self.base.steering().source == "safety" and not cut and now < self.ended:
            self.taken_at = now  # it backs off, by itself
        # The driver renews a command for as long as that lives: of a wire that is cut, what came last counts.
        since = now - min(max(self.taken_at, self.bent.heard_at if cut else 0.0), self.ended)
        if velocity != ZERO_VELOCITY and since > RESTS:
            self.wrong.append(f"at {now:.2f} s it moves at {velocity}, {since:.2f} s after it was last commanded")

    def _distorted(self, data: bytes) -> bytes:
        """Return what arrives of some bytes, either way."""
        chance, happening = self.chance, self.happening
        if happening["silence"] > 0:
            return b""
        found = bytearray()
        for byte in data:
            if happening["bytes lost"] > 0 and chance.random() < 0.02:
                continue
            bent = happening["bytes bent"] > 0 and chance.random() < 0.02
            found.append(byte ^ 1 << chance.randrange(8) if bent else byte)
            if happening["bytes doubled"] > 0 and chance.random() < 0.02:
                found.append(byte)
        return bytes(found)


def test_base_stops_and_keeps_its_limits_under_wire_faults(
    record_property: Callable[[str, object], None],
) -> None:
    struck: Counter[str] = Counter()
    wrong: dict[int, str] = {}
    for seed in range(tries(25)):
        storm = Storm(seed)
        storm.play()
        struck += storm.struck
        if storm.wrong:
            wrong[seed] = storm.wrong[0]
    assert wrong == {}
    assert set(struck) == set(MISHAPS)
    record_property("figure", f"{tries(25)} seeds, {struck.total()} mishaps")
