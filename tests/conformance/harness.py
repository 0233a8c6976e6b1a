"""Plays the conformance cases: a small mission each, with a table of what must happen, tick by tick.

A file in ``cases`` is a list of cases. ``case`` is its title; ``tree`` and ``params`` are a mission's, cut out of the
file as text, so that the language reads them just as a user would have written them. ``ticks`` is the table: a line
for each tick, with everything that happens in it, in order, and nothing else::

    a starts           a probe is started (py_trees calls this initialise)
    a ends success     it has ended (terminate with its status)
    a halts            it was halted (terminate with INVALID)
    a is running       the observer was told of the new status: running, suspended, success, failure or idle
    a.retry is failure that of the modifier ``retry`` beside the behaviour named ``a``
    b hears 3          an echo was given the value 3
    base settled       the executive was asked to bring the base to rest

``nothing`` stands for a tick in which nothing changes. A line may begin with what comes before that tick: ``after 1 s``
rather than the case's ``step`` (100 ms unless it says otherwise), ``with battery.percent = 10`` for a change in the
robot's ``state``, ``range silent`` and ``range reports`` for that part of it, and ``told to halt`` when the tree is
halted in place of being ticked.

Once the table is through, ``reasons`` and ``variables`` are what must have come out. A case whose mission must not even
start has ``refused`` in their place: a text for each fault, "LINE: MESSAGE" with lines counted from the mission's.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from behaviours.catalogue import LEAVES
from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from config.diagnostics import SourceText
from config.units import si_value
from drivers.clock import ManualClock
from drivers.errors import SensorSilent
from missions.executive.build import build
from missions.executive.events import Event, NodeChanged
from missions.executive.executive import Executive
from missions.executive.stream import EventStream
from missions.language.document import check_plan
from missions.language.nodes import MODIFIERS
from missions.language.plan import Plan
from tests.conformance.probes import PROBES, Bench

CASES = Path(__file__).parent / "cases"
WORDS: Mapping[str, type[Leaf]] = {**LEAVES, **PROBES}
MISSION_KEYS = ("params", "tree")
KEYS = {"case", *MISSION_KEYS, "step", "state", "ticks", "reasons", "variables", "refused"}


@dataclass(frozen=True, slots=True)
class Case:
    """One case as it stands in its file; ``mission`` is the text of its mission, ``step`` in seconds."""

    title: str
    subject: str
    mission: str
    step: float = 0.1
    ticks: tuple[str, ...] = ()
    state: Mapping[str, Any] = field(default_factory=dict)
    reasons: Mapping[str, str] = field(default_factory=dict)
    variables: Mapping[str, object] = field(default_factory=dict)
    refused: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.subject}: {self.title}"

    def plan(self) -> Plan:
        """Check the mission. Raises InvalidFileError with every mistake in it."""
        return check_plan(SourceText(self.subject, self.mission), WORDS, {})


def all_cases() -> list[Case]:
    """Return the cases of every file, in order."""
    return [case for path in sorted(CASES.glob("*.yaml")) for case in read_cases(path.stem, path.read_text("utf-8"))]


def read_cases(subject: str, text: str) -> Iterator[Case]:
    """Read a file's cases. Raises ValueError for one that is not as the head of this module says."""
    lines = text.splitlines()
    loader = (yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader)(text)
    listing: Any = loader.get_single_node()
    for node, told in zip(listing.value, loader.construct_document(listing), strict=True):
        if unknown := told.keys() - KEYS:
            raise ValueError(f"{subject}: '{told.get('case')}' has unknown keys: {', '.join(sorted(unknown))}")
        if bool(told.get("ticks")) == bool(told.get("refused")):
            raise ValueError(f"{subject}: '{told['case']}' needs either ticks or what is refused")
        rest = {key: told[key] for key in ("state", "reasons", "variables") if key in told}
        for key in ("ticks", "refused"):
            rest[key] = tuple(told.get(key, ()))
        step = si_value(told.get("step", "100 ms"), "duration")
        yield Case(told["case"], subject, _mission(node, lines), step, **rest)


def _mission(case: yaml.MappingNode, lines: list[str]) -> str:
    """Cut the mission out of its case, and put the line before it that every mission begins with."""
    starts = [key.start_mark.line for key, _ in case.value]
    ends = [*starts[1:], case.end_mark.line]
    parts = ["mission: case"]
    for (key, _), start, end in zip(case.value, starts, ends, strict=True):
        if key.value in MISSION_KEYS:
            indent = key.start_mark.column
            parts += [line[indent:] for line in lines[start:end]]
    return "\n".join(parts) + "\n"


class Silent:
    """A part of the robot's state that does not report."""

    def __init__(self, part: str) -> None:
        self._part = part

    def __getattr__(self, name: str) -> object:
        raise SensorSilent(f"the {self._part} does not report")


class Play:
    """One case being played on a robot of probes; ``nodes`` are the tree's by the names that tables use."""

    def __init__(self, plan: Plan, state: Mapping[str, Any]) -> None:
        self.clock = ManualClock()
        self.bench = Bench(self.clock)
        self._state = _copied(state)
        self.bench.variables.update(self._state)
        self.root = build(plan, self.bench, lambda _: Robot())
        self.executive = Executive(self.root, self.bench, EventStream([self._hear]))
        self.nodes = {_label(node.name, node.kind): node for node in self.root.iterate() if isinstance(node, Node)}

    def line(self, line: str, step: float) -> str:
        """Play one line of a table; return it as it should have been written."""
        told = [
            entry
            for entry in map(str.strip, line.split(","))
            if entry.startswith(("after ", "with ", "told to ")) or entry.endswith((" silent", " reports"))
        ]
        for entry in told:
            match entry.split():
                case ["after", *duration]:
                    step = si_value(" ".join(duration), "duration")
                case ["with", path, "=", *value]:
                    self.change(path, yaml.safe_load(" ".join(value)))
                case [part, "silent"]:
                    self.bench.variables[part] = Silent(part)
                case [part, "reports"]:
                    self.bench.variables[part] = self._state[part]
        self.clock.advance(step)
        self.bench.log.clear()
        if "told to halt" in told:
            self.bench.tick += 1
            self.root.halt()
        else:
            self.executive.tick()
        return ", ".join([*told, *(self.bench.log or ["nothing"])])

    def change(self, path: str, value: object) -> None:
        """Change the robot's state at, say, ``battery.percent``."""
        *owners, name = path.split(".")
        found: Any = self._state
        for owner in owners:
            found = found[owner]
        found[name] = value

    def _hear(self, event: Event) -> None:
        if isinstance(event, NodeChanged):
            self.bench.log.append(f"{_label(event.name, event.kind)} is {event.status}")


def play(case: Case) -> tuple[list[str], Play]:
    """Play a case to the end of its table; return the table as it should have been written, and what was played."""
    played = Play(case.plan(), case.state)
    return [played.line(line, case.step if number else 0.0) for number, line in enumerate(case.ticks)], played


def _label(name: str, kind: str) -> str:
    return f"{name}.{kind}" if kind in MODIFIERS else name


def _copied(state: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _copied(value) if isinstance(value, Mapping) else value for name, value in state.items()}
