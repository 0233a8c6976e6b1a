"""Plays one run of the storm: a weather in, what struck and what does not hold out."""

import threading
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory

from config.file_io import collect_read_files
from drivers.api import ignore
from drivers.clock import SystemClock
from drivers.errors import DriverError
from missions.executive.executive import Result
from missions.executive.watchdog import WatchdogLimits
from missions.plugins.testing.fault_injector import FaultInjector
from missions.plugins.testing.fault_specs import FaultSpec
from missions.plugins.testing.live_faults import read_live_fault
from missions.request import RunRequest
from missions.runner import Runner
from tests.storm.invariants import ALL_REST, broken
from tests.storm.record import StormRecord
from tests.storm.weather import LEAVES, Weather, draw
from tests.storm.witness import Witness

AGAIN = 4
"""Of so many seeds, one is run twice: all must happen again, to the byte."""

PATIENT = WatchdogLimits(slow=inf, stall=inf, fail=60.0, lost=inf)
"""A machine that is busy must not make two runs differ."""

RECORD = "storm.mcap"

IN_TICK = " in a command"

STILL_TIME = 0.2
"""Seconds over which all is looked at once it must be at rest."""

GONE = 5.0
"""Seconds that threads have to end which a stop has begun."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a run: plain data.

    ``struck`` counts what went wrong by its words, ``broken`` says what does not hold by the name of the invariant.
    ``wall`` is how long it took in truth, ``seconds`` how long it was.
    """

    weather: Weather
    struck: Mapping[str, int] = field(default_factory=dict)
    broken: Mapping[str, str] = field(default_factory=dict)
    result: str = ""
    reason: str = ""
    seconds: float = 0.0
    wall: float = 0.0
    digest: str = ""


def play_seed(seed: int) -> Outcome:
    """Play what a seed stands for; every few, twice."""
    weather = draw(seed)
    return played_twice(weather) if seed % AGAIN == 0 else play(weather)


def played_twice(weather: Weather) -> Outcome:
    """Play a weather twice, and see whether all happens again."""
    first, second = play(weather), play(weather)
    if first.digest == second.digest:
        return first
    return replace(first, broken={**first.broken, "same_again": f"{first.digest[:12]} is then {second.digest[:12]}"})


def play(weather: Weather) -> Outcome:
    """Play a weather once. Whatever is raised is what does not hold."""
    clock, witness = SystemClock(), Witness(seed=weather.seed, lag=weather.physics.get("lag", 0.0))
    threads, files = set(threading.enumerate()), _open_files()
    with TemporaryDirectory(prefix="mission-storm-") as folder:
        there: set[str] = set()
        try:
            runner = _runner(weather, Path(folder), witness)
            there = _names(folder)
            try:
                _run(weather, runner, witness)
            finally:
                if witness.record is not None:
                    witness.record.end()
        except Exception:  # of whatever kind: no mission and no fault may raise out of a run
            return Outcome(weather, broken={"raises": traceback.format_exc()}, wall=clock.now())
        witness.left += [f"the file {name}" for name in sorted(_names(folder) - there - {RECORD})]
        digest = witness.digest(folder)
        for thread in set(threading.enumerate()) - threads:
            thread.join(GONE)
        witness.left += [f"the thread {thread.name}" for thread in set(threading.enumerate()) - threads]
        witness.left += [f"{more} open files" for more in [_open_files() - files] if more > 0]
        wrong = broken(witness)
    result = witness.history.result or Result("", "error", "", 0.0, 0)
    struck: dict[str, int] = {}
    for mishap in witness.struck:
        kind = witness.kind(mishap.part)
        part = kind if kind == mishap.part else f"second {kind}"
        words = f"{part} {mishap.state}{mishap.detail if mishap.detail == IN_TICK else ''}"
        struck[words] = struck.get(words, 0) + 1
    if witness.record is not None and witness.record.struck:
        struck[witness.record.struck] = 1
    return Outcome(weather, struck, wrong, result.result, result.reason, result.seconds, clock.now(), digest)


def _runner(weather: Weather, folder: Path, witness: Witness) -> Runner:
    """Return the run, which nothing has happened to yet."""
    robot, mission = folder / "storm.robot.yaml", weather.mission
    robot.write_text(weather.robot_text(), encoding="utf-8")
    if "\n" in mission:
        path = folder / "storm.yaml"
        path.write_text(mission, encoding="utf-8")
        mission = str(path)
    order = RunRequest(
        mission,
        robot=str(robot),
        simulate="fast",
        world=weather.world_config(),
        seed=weather.seed,
        behaviours=(LEAVES,),
        eyes=weather.eyes,
    )
    with collect_read_files() as files:
        runner = Runner(order, listeners=[witness], limits=PATIENT)
        runner.observe(witness.moment)
    witness.watch(runner)
    if weather.record:
        witness.record = record = StormRecord(folder / RECORD)
        record.begin(order, runner, files)
        strike = {"killed": record.kill, "full": record.fill}.get(weather.record)
        if strike is not None:
            witness.twins.timeline.call_at(weather.seconds / 2, strike)
    return runner


def _run(weather: Weather, runner: Runner, witness: Witness) -> None:
    """Let it happen, and the robot come to rest."""
    trouble = FaultInjector(runner, witness.history)
    trouble.schedule([read_live_fault(words, runner) for words in weather.faults])
    witness.struck = trouble.started_faults
    if weather.stop_at:
        countdown = count(weather.stop_at, -1)
        stop = FaultSpec("run", "stopped", IN_TICK, seconds=weather.stop_for)

        def strike() -> None:
            if next(countdown) == 1:
                trouble.start(stop)
                timeline.run_until(timeline.clock.now() + weather.hangs)

        witness.at_command = strike
    if weather.alone:
        runner.latch.hold = ignore
    timeline = witness.twins.timeline
    timeline.call_at(weather.seconds, lambda: runner.executive.stop("the storm is over"))
    try:
        witness.history.result = runner.run()
    except DriverError as error:  # a robot that is not complete at its start
        witness.history.result = Result(runner.plan.mission, "error", str(error), timeline.clock.now(), 0)
    witness.ended = timeline.clock.now()
    if runner.stream.failed_listeners:
        witness.left.append(f"events that were not heard: {', '.join(runner.stream.failed_listeners)}")
    timeline.run_until(witness.ended + ALL_REST + STILL_TIME)


def _names(folder: str) -> set[str]:
    return {path.name for path in Path(folder).iterdir()}


def _open_files() -> int:
    """Return how many files this process has open; 0 where the system does not say."""
    listed = Path("/proc/self/fd")
    return len(list(listed.iterdir())) if listed.is_dir() else 0
