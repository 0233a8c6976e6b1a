"""How long the base moves after a person has let go or pressed STOP, whatever the delay of the link to the studio.

First in simulated time: the page, a network in both directions, and the run's side with a simulated base, at chance
delays. The press itself is lost in each of them, so nothing but the age of states stops the base.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from math import inf
from pathlib import Path
from random import Random
from threading import Event

import pytest

from drivers.base.twin import BaseTwin
from drivers.clock import SystemClock
from drivers.sim.timeline import Timeline
from missions.control.clients import MOVING_STATE_INTERVAL
from missions.control.commands import BadMessage, DriveCommand
from missions.control.pilot import MAX_STATE_AGE
from missions.control.wheels import WheelArbiter
from tests.missions.studio.lossy import lossy
from tests.missions.studio.running import run_of, seconds_to_rest
from tests.missions.studio.serving import Client, Served
from tests.tries import tries
from tests.waiting import wait_until

SENT_EVERY = 0.06
"""Seconds from one command of the page to the next."""

PRESSED_AT = 6.0
BRAKING = 0.2
"""Seconds that the simulated base takes to stand, at most: it has a dead time."""

Delay = Callable[[float], float]
"""Returns how long what is sent at a time is on its way, in seconds."""


@dataclass
class Way:
    """One direction of a link, which keeps the order."""

    timeline: Timeline
    delay: Delay
    last: float = 0.0

    def send(self, come: Callable[[], object]) -> None:
        now = self.timeline.clock.now()
        self.last = max(self.last, now + self.delay(now))
        self.timeline.call_at(self.last, come)


@dataclass
class RemoteDrive:
    """A person who holds the stick until ``PRESSED_AT``, and what becomes of it."""

    up: Delay
    down: Delay
    paused: tuple[float, float] = (inf, inf)  # no states are sent meanwhile
    timeline: Timeline = field(default_factory=Timeline)
    errors: set[str] = field(default_factory=set)
    moved: list[float] = field(default_factory=list)
    number: int = 0
    stamp: int | None = None

    def __post_init__(self) -> None:
        self.base = BaseTwin(self.timeline.clock)
        self.base.open()
        self.wheels = WheelArbiter(self.base, None, self.timeline.clock)
        self.wheels.take("Ada", "Ada")
        ways = Way(self.timeline, self.down), Way(self.timeline, self.up)
        self.timeline.call_every(BaseTwin.STEP_INTERVAL, self._step)
        self.timeline.call_every(MOVING_STATE_INTERVAL, partial(self._tell, ways[0]))
        self.timeline.call_every(SENT_EVERY, partial(self._push, ways[1]))

    def run(self) -> float:
        """Return for how many seconds the base moves after the press."""
        self.timeline.run_until(PRESSED_AT + 12.0)
        return max((at - PRESSED_AT for at in self.moved), default=0.0)

    def _step(self) -> None:
        self.base.step()
        if self.base.body.velocity.linear:
            self.moved.append(self.timeline.clock.now())

    def _tell(self, way: Way) -> None:
        if not self.paused[0] <= self.timeline.clock.now() < self.paused[1]:
            way.send(partial(setattr, self, "stamp", self.wheels.stamp()))

    def _push(self, way: Way) -> None:
        if self.stamp is not None and self.timeline.clock.now() < PRESSED_AT:
            self.number += 1
            way.send(partial(self._hear, DriveCommand(n=self.number, stamp=self.stamp, ahead=1.0, left=0.0, pace=1.0)))

    def _hear(self, command: DriveCommand) -> None:
        try:
            self.wheels.drive("Ada", command)
        except BadMessage as error:
            self.errors.add(error.error)
        self.timeline.call_at(self.wheels.ends_at, lambda: self.wheels.check(self.timeline.clock.now()))


def constant(delay: float) -> Delay:
    return lambda _: delay


def growing(rate: float) -> Delay:
    return lambda now: rate * now


def sudden(delay: float, at: float) -> Delay:
    return lambda now: delay if now >= at else 0.01


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("delay", [0.6, 1.0, 2.0, 5.0])
def test_with_a_constant_delay_either_way_or_both_the_base_never_moves(delay: float, share: float) -> None:
    remote = RemoteDrive(constant(share * delay), constant((1 - share) * delay))
    remote.run()
    assert remote.moved == []
    assert "stale" in remote.errors


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3])
def test_with_a_short_delay_the_base_drives(delay: float) -> None:
    remote = RemoteDrive(constant(delay / 2), constant(delay / 2))
    assert remote.run() <= MAX_STATE_AGE + BRAKING
    assert remote.moved
    assert remote.errors == set()


CHANGES: dict[str, tuple[Delay, Delay]] = {
    "grows on the way up": (growing(0.2), constant(0.01)),
    "grows on the way down": (constant(0.01), growing(0.2)),
    "grows quicker than the time": (growing(1.5), growing(1.5)),
    "is there suddenly on the way up": (sudden(5.0, PRESSED_AT - 0.1), constant(0.01)),
    "is there suddenly on the way down": (constant(0.01), sudden(5.0, PRESSED_AT - 0.1)),
    "is there at the press": (sudden(5.0, PRESSED_AT - 0.01), sudden(5.0, PRESSED_AT - 0.01)),
    "ends before the press": (lambda now: 3.0 if now < 2.0 else 0.01, constant(0.01)),
}


@pytest.mark.parametrize("change", list(CHANGES))
def test_base_rests_soon_after_stop_with_a_changing_delay(change: str) -> None:
    assert RemoteDrive(*CHANGES[change]).run() <= MAX_STATE_AGE + BRAKING


def test_page_without_new_states_cannot_keep_driving() -> None:
    remote = RemoteDrive(constant(0.01), constant(0.01), paused=(2.0, 3.0))
    remote.run()
    assert max(remote.moved) <= 2.0 + MAX_STATE_AGE + BRAKING  # nor after the pause: the stick was not let go
    assert {"stale", "let_go"} <= remote.errors


def drawn(chance: Random) -> Delay:
    """Return a delay that jumps now and then, up to 5 s."""
    jumps = sorted(chance.uniform(0.0, PRESSED_AT + 1.0) for _ in range(chance.randint(0, 6)))
    values = [
        chance.choice((0.0, 0.02, 0.1, 0.25, chance.uniform(0.0, 0.6), chance.uniform(0.0, 5.0))) for _ in "1234567"
    ]
    jitter = chance.choice((0.0, 0.02, 0.2))
    return lambda now: values[sum(now >= jump for jump in jumps)] + chance.uniform(0.0, jitter)


def test_base_rests_within_half_a_second_and_braking_for_any_delay(
    record_property: Callable[[str, object], None],
) -> None:
    runs = dict[int, float]()
    drove = 0
    for seed in range(tries(50, most=10_000)):
        chance = Random(f"delays {seed}")  # noqa: S311 - a draw is no secret
        remote = RemoteDrive(drawn(chance), drawn(chance))
        runs[seed] = remote.run()
        drove += bool(remote.moved)
    record_property("figure", f"{len(runs)} seeds, {drove} drove: rest {max(runs.values()):.2f} s after STOP at most")
    assert drove > len(runs) / 4
    assert {seed: rest for seed, rest in runs.items() if rest > MAX_STATE_AGE + BRAKING} == {}


# --- in real time: a run of its own, the studio, and a network of this computer in between --------------------------


def never(number: int, up: bool) -> bool:
    """Lose nothing."""
    del number, up
    return False


@dataclass(frozen=True)
class Trouble:
    """What becomes of the network while somebody drives: delays (s), bytes a second, and how long before the press."""

    up: float
    down: float
    before: float
    rate: float = inf


TROUBLES: dict[str, Trouble] = {
    "2 s there and back, at the press": Trouble(1.0, 1.0, 0.0),
    "5 s on the way up": Trouble(5.0, 0.0, 0.1),
    "5 s on the way down": Trouble(0.0, 5.0, 0.1),
    "5 s both ways": Trouble(5.0, 5.0, 0.3),
    "0.45 s there and back": Trouble(0.2, 0.25, 0.5),
    "a queue that fills": Trouble(0.0, 0.0, 0.4, rate=500.0),
}


def drive_on(client: Client, run: str, seconds: float) -> None:
    """Send what a page sends while the stick is held."""
    clock, pause = SystemClock(), Event()
    while clock.now() < seconds:
        client.drive(run)
        pause.wait(SENT_EVERY)


@pytest.mark.real_time
def test_base_rests_within_half_a_second_and_braking_over_a_real_network(
    served: Served, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    rests = dict[str, float]()
    with run_of(tmp_path) as (process, base):
        run = str(process.process.pid)
        for what, trouble in TROUBLES.items():
            with lossy(served.port, 0.0, never) as network, served.client(served.operator, port=network.port) as client:
                client.hear_of(run)
                wait_until(lambda: client.ask("take", run=run)["result"]["yours"])

                def moves() -> bool:
                    client.drive(run)
                    return base.seen().moving

                wait_until(moves, pause=0.02)
                network.up, network.down, network.rate = trouble.up, trouble.down, trouble.rate
                drive_on(client, run, trouble.before)
                rests[what] = max(0.0, seconds_to_rest(base, base.seen().heard_at))
    record_property("figure", f"at rest after STOP: {max(rests.values()):.2f} s at most; {rests}")
    assert {what: rest for what, rest in rests.items() if rest > MAX_STATE_AGE + BRAKING} == {}


@pytest.mark.real_time
def test_driving_is_refused_with_2_s_round_trip_but_stop_latches(served: Served, tmp_path: Path) -> None:
    with run_of(tmp_path) as (process, base), lossy(served.port, 0.0, never) as network:
        run = str(process.process.pid)
        with served.client(served.operator, port=network.port) as client:
            client.hear_of(run)
            assert client.ask("take", run=run)["result"]["yours"]
            client.drive(run, ahead=0.0)
            network.up = network.down = 1.0
            base.seen(forget=True)
            drive_on(client, run, 4.0)
            refused = client.hear(lambda told: told["say"] == "answer")
            assert (refused["error"], "s old: the base stops" in refused["message"]) == ("stale", True)
            assert base.seen().top == 0.0
            client.hear(lambda told: told["say"] == "state" and 1.9 < told["round_trip"] < 3.0)
            assert client.ask("stop")["result"]["stopped"][run]["parts"] == ["base"]
            network.up = network.down = 0.0
            assert client.ask("release", run=run, stop=1)["ok"]
