"""What the house is like: rooms and arrows of ``missions``, what a run imports, and how much there is of all.

    python -m tests.benchmarks house [FOLDER]

The figures are those of the table "Effects to show" (docs/decisions/0008 and 0009), measured on the working tree in
``FOLDER``, or on this one; there, without those that must run it. Arrows are imports anywhere in a module, also within
functions and for types alone, and dotted names such as ``missions.plugins.teleop.pad:make_pad``.
"""

import ast
import json
import re
import signal
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from subprocess import DEVNULL, Popen
from types import FrameType
from typing import Any

from drivers.api import Velocity
from tests.benchmarks.proxies import Asker
from tests.benchmarks.robot_beside import robot_beside
from tests.benchmarks.running import OURS, start

ROOT = Path(__file__).parents[2]

LONGEST = 180.0
"""Seconds that a run of greet may take."""

DOTTED = re.compile(r"(?:missions|behaviours|drivers|perception|config)(?:\.\w+)+:\w+")

MIRRORS = ("Told", "Asked", "Answering")
"""How the classes began that repeated the protocol of a part, by hand."""

PARTS = ("Base", "Head", "Joints", "Ranger", "Voice", "Sight", "Hearing", "Screen")

GREETING = """
import json, sys
from pathlib import Path
import missions.executive.executive as executive
tick, before = executive.Executive.tick, []
def first(self, **given):
    status = tick(self, **given)
    before.extend([] if before else sys.modules)
    return status
executive.Executive.tick = first
from missions.cli.root import main
sys.argv = ["mission", *sys.argv[2:]]
try:
    main()
finally:
    Path({0!r}).write_text(json.dumps([sorted(before), sorted(sys.modules)]))
"""
"""A program that is ``mission``, and says what was imported by its first tick, and by its end."""


def modules(folder: Path) -> Mapping[str, Path]:
    """Return our modules by their names."""
    found = {}
    for package in OURS:
        for path in sorted((folder / package).rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(path: Path, name: str) -> Iterator[str]:
    """Yield what a module names of others, wherever in it: imports, and dotted names."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{source}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and DOTTED.fullmatch(node.value):
            yield node.value.partition(":")[0]


def room(name: str) -> str:
    """Return the room of ``missions`` that a module is in; nothing for one elsewhere, and for its entries."""
    top, _, rest = name.partition(".")
    found = rest.partition(".")[0]
    return found if top == "missions" and found != "__main__" else ""


def arrows(folder: Path = ROOT) -> dict[str, set[str]]:
    """Return which rooms of ``missions`` name each other."""
    known = modules(folder)
    found: dict[str, set[str]] = {each: set() for each in sorted({room(name) for name in known} - {""})}
    for name, path in known.items():
        if here := room(name):
            there = {room(other) for other in imported(path, name)} & found.keys()
            found[here] |= there - {here}
    return found


def cycles(found: Mapping[str, set[str]]) -> list[set[str]]:
    """Return the rooms that lead back to themselves, those of one circle together."""
    reached = {each: _from(each, found) for each in found}
    circles: list[set[str]] = []
    for each in found:
        circle = {other for other in reached[each] if each in reached[other]}
        if circle and circle not in circles:
            circles.append(circle)
    return circles


def _from(start: str, found: Mapping[str, set[str]]) -> set[str]:
    reached: set[str] = set()
    waiting = [*found[start]]
    while waiting:
        if (each := waiting.pop()) not in reached:
            reached.add(each)
            waiting += found[each]
    return reached


def lines(folder: Path = ROOT) -> dict[str, int]:
    """Return how many lines of Python each package has, and the tests."""
    return {
        package: sum(len(path.read_text(encoding="utf-8").splitlines()) for path in (folder / package).rglob("*.py"))
        for package in (*OURS, "tests")
    }


def mirrors(folder: Path = ROOT) -> dict[str, int]:
    """Return the classes that repeat a part's protocol by hand, with their lines."""
    names = {f"{mirror}{part}" for mirror in MIRRORS for part in PARTS}
    return {
        node.name: (node.end_lineno or node.lineno) - node.lineno + 1
        for path in modules(folder).values()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef) and node.name in names
    }


def frames() -> int:
    """Return how many calls of Python it takes from a leaf to the driver of a base for ``drive``, the last included."""
    asker, counted = Asker(), [0]

    def leaf(drive: Callable[[Velocity], object]) -> None:
        drive(Velocity(0.2, 0.0))

    def driver(*_: Any, **__: Any) -> Velocity:
        frame: FrameType | None = sys._getframe()
        while frame is not None and frame.f_code is not leaf.__code__:
            counted[0] += 1
            frame = frame.f_back
        return Velocity(0.2, 0.0)

    asker.devices["base"].drive = driver
    leaf(asker.robot.base.drive)
    return counted[0]


def greeting() -> tuple[frozenset[str], frozenset[str]]:
    """Return our modules that a run of greet on the metal has imported by its first tick, and by its end."""
    with tempfile.TemporaryDirectory() as folder, robot_beside("living_room") as robot:
        kept = Path(folder, "imported.json")
        command = [sys.executable, "-c", GREETING.replace("{0!r}", repr(str(kept))), "mission", "run", "greet"]
        with Popen([*command, *robot.options], stdin=DEVNULL, stdout=DEVNULL, cwd=ROOT) as process:
            try:
                process.wait(LONGEST)
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGINT)
        before, after = json.loads(kept.read_text())
    first, last = (frozenset(name for name in names if name.split(".")[0] in OURS) for names in (before, after))
    return first, last


def main(folder: Path = ROOT) -> None:
    """Print the table."""
    found = arrows(folder)
    circles = cycles(found)
    print(f"rooms of missions      {len(found)}: {' '.join(found)}")
    print(f"arrows between them    {sum(map(len, found.values()))}")
    print(f"circles among them     {len(circles)}" + "".join(f"\n  {' '.join(sorted(each))}" for each in circles))
    counted = lines(folder)
    told = ", ".join(f"{name} {number}" for name, number in counted.items())
    print(f"lines of Python        {sum(counted.values())}: {told}")
    repeated = mirrors(folder)
    print(f"mirrors by hand        {sum(repeated.values())} lines{''.join(f', {name}' for name in repeated)}")
    if folder != ROOT:
        return
    print(f"calls, leaf to driver  {frames()} for drive, the driver's own included", flush=True)
    first, last = greeting()
    packages: defaultdict[str, int] = defaultdict(int)
    for name in last:
        packages[name.split(".")[0]] += 1
    told = ", ".join(f"{name} {packages[name]}" for name in OURS)
    print(f"modules, greet, metal  {len(last)}: {told}")
    later = ", ".join(sorted(last - first))
    print(f"  after the first tick {len(last - first)}{': ' if later else ''}{later}", flush=True)
    print(f"processor time, start  {start():.2f} s to the first tick")
