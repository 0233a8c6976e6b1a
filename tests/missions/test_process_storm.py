"""A storm of processes: a run on real drivers, who records it, the studio and who drives by it, struck by chance.

A seed stands for who is struck, when and how. The base lives in a process of its own, behind its pseudo-terminal, and
times itself by its own clock: when it heard anything last, and when it came to rest. ``TRIES=200`` plays as many seeds.
"""

import os
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random
from subprocess import DEVNULL
from threading import Event

import pytest
from websockets.exceptions import WebSocketException

from drivers.clock import SystemClock
from missions.control.pilot import MAX_STATE_AGE
from missions.control.sockets import open_connection, socket_path
from tests.forked import Forked
from tests.missions.left import MARK, left_of, marked, nobody_left, readable, writer_of
from tests.missions.lone_base import LONE_ROBOT, LoneBase, lone_base
from tests.missions.studio.running import DRIVING, REST, WAITING
from tests.missions.studio.serving import Client, Served, studio
from tests.tries import tries
from tests.waiting import wait_until

pytestmark = [pytest.mark.real_time, pytest.mark.long]

WITHIN = 0.7
"""Seconds from the last that a base hears to its rest."""

RENEWED = 0.05
STRIKES = (
    "run killed", "run frozen", "run told to end", "recorder killed", "stopped", "another one stops",
    "studio killed", "studio frozen", "driver gone", "driver silent", "driver hears nothing",
)  # fmt: skip
"""What may happen; that of the studio and of a driver only where a mission waits and somebody drives by the page."""

OF_DRIVER = frozenset(each for each in STRIKES if each.startswith(("studio", "driver")))
ENDS = {"killed": signal.SIGKILL, "told to end": signal.SIGTERM, "interrupted": signal.SIGINT}


@dataclass
class Play:
    """What happens to one run: ``wrong`` is what must not be, ``struck`` what happened."""

    base: LoneBase
    process: Forked
    record: Path
    mark: str
    chance: Random
    served: Served | None = None
    client: Client | None = None
    stamp: int | None = None  # by which a driver who hears nothing drives on
    latched: bool = False
    alone: bool = False  # who drives has been lost, and nobody else drives
    wrong: list[str] = field(default_factory=list)
    struck: Counter[str] = field(default_factory=Counter)
    pause: Event = field(default_factory=Event)

    def run(self) -> None:
        """Strike a few times while it drives, then end it."""
        mine = [each for each in STRIKES if self.client is not None or each not in OF_DRIVER]
        for _ in range(self.chance.randint(1, 3)):
            self._drive(self.chance.uniform(0.1, 1.0))
            if self.process.poll() is not None:
                break
            strike = self.chance.choice(mine)
            self.struck[strike] += 1
            self._strike(strike)
        self._drive(0.2)
        if self.process.poll() is None:
            end = self.chance.choice(list(ENDS))
            self.struck[f"at last {end}"] += 1
            self.process.send_signal(ENDS[end])
        self.process.wait(60.0)
        self._comes_to_rest("its end")

    def _strike(self, strike: str) -> None:
        match strike:
            case "run killed":
                self.process.kill()
                self.process.wait()
                self._comes_to_rest(strike)
            case "run frozen":
                self._freeze(self.process.pid)
            case "run told to end":
                self.process.terminate()
            case "recorder killed":
                self._signal(writer_of(self.mark, self.record))
            case "stopped" | "another one stops":
                self._stop(strike)
            case "studio killed" | "studio frozen":
                self._lose_studio(strike)
            case _:
                self._lose_driver(strike)

    def _freeze(self, process: int) -> None:
        """Stop a process as a debugger or a full swap does; the base comes to rest meanwhile. Let it go on."""
        os.kill(process, signal.SIGSTOP)
        try:
            self.pause.wait(self.chance.uniform(0.8, 2.0))
            self._comes_to_rest("a freeze")
        finally:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGCONT)

    def _stop(self, strike: str) -> None:
        """Stop it as `mission stop` does, once or by two at the same time; it stands, and stays so."""
        with suppress(OSError), open_connection(socket_path(str(self.process.pid))) as link:
            told = [
                link.request({"do": "stop", "press": f"{strike} {number}"}) for number in range(1 + ("one" in strike))
            ]
            self.latched = all(each["ok"] for each in told)
            if self.latched:
                self._rests_since_now(strike)

    def _lose_studio(self, strike: str) -> None:
        if self.served is None:
            return
        process = self.served.process.process
        if strike == "studio killed":
            process.kill()
            process.wait()
            self.served = self.client = None
        else:
            os.kill(process.pid, signal.SIGSTOP)
        self.alone = True
        self._rests_since_now(strike)
        if strike == "studio frozen":
            os.kill(process.pid, signal.SIGCONT)

    def _lose_driver(self, strike: str) -> None:
        if self.client is None:
            return
        if strike == "driver hears nothing":
            self.stamp = self.client.stamps.get(str(self.process.pid), 0)
            self._drive(MAX_STATE_AGE)
            self._rests_since_now(strike)
            return
        self.alone = True
        if strike == "driver gone":
            self.client.socket.socket.close()  # without a word, as one whose battery is empty
            self.client = None
        self._rests_since_now(strike)

    def _signal(self, process: int | None) -> None:
        if process is not None:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def _drive(self, seconds: float) -> None:
        """Let time pass, in which somebody drives by the page if they can."""
        clock = SystemClock()
        while clock.now() < seconds:
            if self.client is not None and not self.alone:
                with suppress(OSError, WebSocketException, TimeoutError):
                    self.client.drive(str(self.process.pid), left=0.3, stamp=self.stamp)
            self.pause.wait(RENEWED)
            if self.latched or self.alone:
                self._stands()

    def _stands(self) -> None:
        if self.base.seen().moving and self.process.poll() is None:
            self.wrong.append(f"moves although it was {'stopped' if self.latched else 'left'}: {dict(self.struck)}")

    def _comes_to_rest(self, after: str) -> None:
        """See it come to rest, 0.7 s after it has heard anything last."""
        wait_until(lambda: not self.base.seen().moving)
        seen = self.base.seen()
        if seen.rest_at - seen.heard_at > WITHIN:
            self.wrong.append(f"after {after}: at rest {seen.rest_at - seen.heard_at:.2f} s after it heard anything")

    def _rests_since_now(self, after: str) -> None:
        """See it come to rest soon, by its own clock: it hears something 20 times a second, or nothing any more."""
        since = self.base.seen().heard_at
        wait_until(lambda: not self.base.seen().moving)
        took = self.base.seen().rest_at - since
        if took > max(REST, WITHIN):
            self.wrong.append(f"after {after}: at rest only {took:.2f} s later")


@contextmanager
def playing(folder: Path, base: LoneBase, seed: int, patch: pytest.MonkeyPatch) -> Iterator[Play]:
    """Start what a seed stands for, and wait until it drives."""
    chance = Random(f"processes {seed}")  # noqa: S311 - a draw is no secret
    driven = chance.random() < 0.5
    mission, record, mark = folder / f"{seed}.yaml", folder / f"{seed}.mcap", f"{folder}-{seed}"
    mission.write_text(WAITING if driven else DRIVING, encoding="utf-8")
    with ExitStack() as ends:
        served = ends.enter_context(studio()) if driven else None
        patch.setenv(MARK, mark)
        words = ("--robot", LONE_ROBOT, "--port", f"base={base.port}", "--record", str(record))
        process = Forked("missions", "run", str(mission), *words, stdin=DEVNULL, stdout=DEVNULL)
        patch.delenv(MARK)
        ends.callback(process.wait)
        ends.callback(process.kill)
        play = Play(base, process, record, mark, chance, served)
        if served is not None:
            play.client = ends.enter_context(driver(served, process))
        else:
            wait_until(lambda: base.seen().moving)
        yield play


@contextmanager
def driver(served: Served, process: Forked) -> Iterator[Client]:
    """Take the wheels of a run, by the studio."""
    run = str(process.pid)
    with ExitStack() as ends:
        client = ends.enter_context(served.client(served.operator))
        ends.callback(client.socket.socket.close)  # whatever became of the studio, a polite end is not waited for
        wait_until(lambda: bool(client.ask("take", run=run)["ok"]))
        yield client


def test_whichever_process_is_struck_the_base_rests_and_nothing_is_left_but_the_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, record_property: Callable[[str, object], None]
) -> None:
    first, struck, wrong = int(os.environ.get("FIRST", "1")), Counter[str](), dict[int, list[str]]()
    with lone_base() as base:
        for seed in range(first, first + tries(4)):
            with playing(tmp_path, base, seed, monkeypatch) as play:
                play.run()
                wait_until(partial(nobody_left, play.mark))
                play.wrong += [f"left: {name}" for name in (*marked(play.mark).values(), *left_of(play.process))]
                play.wrong += [] if readable(play.record, moved=True) else ["no record"]
            struck += play.struck
            if play.wrong:
                wrong[seed] = play.wrong
    record_property("figure", f"{tries(4)} seeds: {', '.join(f'{name} {n}' for name, n in struck.most_common())}")
    assert wrong == {}
