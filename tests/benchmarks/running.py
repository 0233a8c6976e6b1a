"""What a run of `greet` on the metal costs its own process: processor time by thread, memory, start, and imports.

    python -m tests.benchmarks.running [SECONDS] [SCENARIO...]
    python -m tests.benchmarks.running --beside FOLDER [ROUNDS]

The second form runs a working tree of another version by turns with this one, and prints the least of each and the
median of the ratios. A busy machine changes the ratios less than the figures; `chrt --rr 1` before it helps most.

Virtual devices and the camera are in a process of their own (``robot_beside``), so that the run's process does what it
does on a robot: drivers on serial lines, pictures from a camera, perception, ticks. Processor time is that of user and
system together, as Linux counts it for each thread; a busy machine changes it little.
"""

import json
import os
import signal
import statistics
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL, Popen
from threading import Event

from drivers.clock import SystemClock
from tests.benchmarks.robot_beside import Beside, robot_beside
from tests.benchmarks.table import Row

SECONDS = 90.0
SHORT = 20.0
"""Seconds of a run, by itself and among all benchmarks."""

STARTED = 10.0
"""Seconds from the start of a run to where counting begins: what a start costs is counted apart."""

STARTS = 5
"""How often what is over at once is measured; its median counts."""

ROOT = Path(__file__).parents[2]

NAMED = """
import ctypes, json, sys, threading
from pathlib import Path
def name(frame, event, argument):
    sys.setprofile(None)
    ctypes.CDLL(None).prctl(15, threading.current_thread().name.encode()[:15], 0, 0, 0)
threading.setprofile(name)
from missions.cli.root import main
sys.argv = ["mission", *sys.argv[2:]]
try:
    main()
finally:
    Path({0!r}).write_text(json.dumps(sorted(sys.modules)))
"""
"""A program that is ``mission``, gives its threads their names for the kernel too, and says what was imported."""

REST = """\
mission: rest
tree:
  sequence:
    - wait: 1 h
    - mission: greet
"""
"""Has all parts that greeting needs, and needs none of them."""

AGAIN = """\
mission: greet_again
tree:
  sequence:
    - mission: greet
      on_failure: succeed
  repeat: forever
"""


@dataclass(frozen=True)
class Scenario:
    """A mission (without a text it is greet), the world that it is run in, and the share of a core that it may take."""

    mission: str
    world: str
    bound: float


SCENARIOS = {
    "nobody": Scenario("", "empty", 0.12),
    "greeting": Scenario(AGAIN, "living_room", 0.12),
    "at rest": Scenario(REST, "living_room", 0.04),
}
"""Looking for somebody who is not there; finding, following and greeting somebody again and again; waiting."""


@dataclass(frozen=True)
class Cost:
    """Shares of a core by thread, and of the processes that were started besides; MB; what was imported."""

    threads: Mapping[str, float]
    memory: float
    modules: tuple[str, ...]

    @property
    def share(self) -> float:
        """The share of a core in all."""
        return sum(self.threads.values())


def rows() -> Iterator[Row]:
    """Yield the shares of a core, the memory, and the processor time until the first tick and of a check."""
    for name, scenario in SCENARIOS.items():
        cost = measured(scenario, SHORT)
        yield Row(f"a run on the metal, {name}: of a core", cost.share, 1.0, cost.share, scenario.bound)
    yield Row("its memory, MB", cost.memory, 110.0, cost.memory / 110.0, 1.0)
    for name, bound, found in (("start to first tick", 0.8, start()), ("mission check greet", 0.25, check())):
        yield Row(f"{name}: processor time", found, bound, found / bound, 1.0)


def measured(scenario: Scenario, seconds: float, tree: Path = ROOT) -> Cost:
    """Run a scenario of the version in ``tree`` for so long, and return what it cost."""
    with tempfile.TemporaryDirectory() as folder, robot_beside(scenario.world) as robot:
        imported = Path(folder, "imported.json")
        with _running(scenario, robot, Path(folder), imported, tree) as process:
            Event().wait(STARTED)
            before, clock = _spent(process.pid), SystemClock()
            Event().wait(seconds)
            after, passed = _spent(process.pid), clock.now()
            memory = _memory(process.pid)
            if process.poll() is not None:
                raise RuntimeError(f"the run ended by itself, with {process.returncode}")
        modules = tuple(json.loads(imported.read_text()))
    threads: defaultdict[str, float] = defaultdict(float)
    for (_, name), spent in after.items():
        threads[name] += spent / passed
    for (_, name), spent in before.items():
        threads[name] -= spent / passed
    return Cost(dict(sorted(threads.items(), key=lambda item: -item[1])), memory, modules)


@contextmanager
def _running(scenario: Scenario, robot: Beside, folder: Path, imported: Path, tree: Path) -> Iterator[Popen[bytes]]:
    """Have the scenario run in a process of its own until the end of the block; then it is interrupted."""
    mission, words = "greet", ["--param", "patience=1 h"]
    if scenario.mission:
        file = Path(folder, "scenario.yaml")
        file.write_text(scenario.mission, encoding="utf-8")
        mission, words = str(file), []
    program = NAMED.replace("{0!r}", repr(str(imported)))
    command = [sys.executable, "-c", program, "mission", "run", mission, *words, *robot.options]
    with Popen(command, stdin=DEVNULL, stdout=DEVNULL, cwd=tree) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)


def start() -> float:
    """Return the seconds of processor time until the first tick, its processes' too: the median of several starts."""
    return statistics.median(starts(ROOT)[ROOT])


def starts(*trees: Path, rounds: int = STARTS) -> dict[Path, list[float]]:
    """Return what ``start`` measures for several starts of the version in each of ``trees``, which take turns."""
    found: dict[Path, list[float]] = {tree: [] for tree in trees}
    with tempfile.TemporaryDirectory() as folder, robot_beside("living_room") as robot:
        events = Path(folder, "events")
        os.mkfifo(events)
        command = [sys.executable, "-m", "missions", "run", "greet", "--events", str(events), *robot.options]
        for tree in [*trees] * rounds:
            process = Popen(command, stdin=DEVNULL, stdout=DEVNULL, env=_compiled(), cwd=tree)
            with process, events.open() as lines:
                next(line for line in lines if '"tick": 1' in line)  # before it, what is known as it starts is told
                found[tree].append(sum(_spent(process.pid).values()))
                process.send_signal(signal.SIGINT)
                lines.read()
    return found


def check() -> float:
    """Return the seconds of processor time that ``mission check greet`` takes, the median of several."""
    found = []
    for _ in range(STARTS):
        process = Popen([sys.executable, "-m", "missions", "check", "greet"], stdout=DEVNULL, env=_compiled())
        _, code, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(code)
        found.append(used.ru_utime + used.ru_stime)
    return statistics.median(found)


def _compiled() -> dict[str, str]:
    """Return an environment in which Python keeps what it compiles, as it does on a robot, whatever ours says."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def _spent(pid: int) -> dict[tuple[int, str], float]:
    """Return the seconds that each thread of a process has used by now, and each process that it started."""
    found = {}
    for task in Path(f"/proc/{pid}/task").iterdir():
        found[int(task.name), _line(task)[0]] = _line(task)[1]
        for child in (task / "children").read_text().split():
            with suppress(OSError):  # it has ended
                threads = Path(f"/proc/{child}/task").iterdir()
                found[int(child), f"process {_program(child)}"] = sum(_line(each)[1] for each in threads)
    return found


def _program(pid: str) -> str:
    """Return the name of the program that a process runs."""
    words = Path("/proc", pid, "cmdline").read_text().split("\0")
    return next((Path(word).stem for word in words if word.endswith(".py")), " ".join(words[-2:-1]) or words[0])


def _line(folder: Path) -> tuple[str, float]:
    """Return the name of a thread, and the seconds that it has run."""
    return (folder / "comm").read_text().strip(), int((folder / "schedstat").read_text().split()[0]) / 1e9


def _memory(pid: int) -> float:
    """Return how much memory (MB) of a process is in use."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) * 1024 / 1e6


def main(seconds: float, names: list[str]) -> None:
    """Print a table for each scenario, and what start and check cost."""
    for name in names or SCENARIOS:
        cost = measured(SCENARIOS[name], seconds)
        ours = [module for module in cost.modules if module.split(".")[0] in OURS]
        print(
            f"{name}: {cost.share:.1%} of a core, {cost.memory:.0f} MB, {len(ours)} of {len(cost.modules)} modules ours"
        )
        for thread, share in cost.threads.items():
            print(f"  {thread:<20} {share:6.2%}")
    if not names:
        print(f"start to first tick: {start():.2f} s\nmission check greet: {check():.2f} s")


def beside(folder: Path, rounds: int = STARTS) -> None:
    """Print the costs of this version and of the one in ``folder``."""
    found = starts(ROOT, folder, rounds=rounds)
    pairs = {"start to first tick: processor time": list(zip(found[ROOT], found[folder], strict=True))}
    for name, scenario in SCENARIOS.items():
        costs = [(measured(scenario, SHORT), measured(scenario, SHORT, folder)) for _ in range(rounds)]
        pairs[f"a run on the metal, {name}: of a core"] = [(here.share, there.share) for here, there in costs]
        pairs[f"its memory, {name}, MB"] = [(here.memory, there.memory) for here, there in costs]
    for name, values in pairs.items():
        ours, theirs = (min(each[place] for each in values) for place in (0, 1))
        print(Row(name, ours, theirs, statistics.median(one / other for one, other in values)))


OURS = ("missions", "behaviours", "drivers", "perception", "config")

if __name__ == "__main__":
    if sys.argv[1:2] == ["--beside"]:
        beside(Path(sys.argv[2]).resolve(), *map(int, sys.argv[3:]))
    else:
        main(float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS, sys.argv[2:])
