"""Verdicts: what an exploration proves of a mission, what it refutes, and what it could not decide."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

from behaviours.leaf import IDLE, Leaf
from behaviours.node import Node
from config.faults import Diagnostic
from missions.executive.events import status_word
from missions.plugins.verify.choices import Script
from missions.plugins.verify.explore import Found, Space, ended_by_halt

# Traces: a run of the exploration taken again, step by step, and told in lines.


@dataclass(frozen=True, slots=True)
class Turn:
    """One step of a run: whether it was a halt instead of a tick, what was given, and which nodes changed to what."""

    halted: bool
    given: tuple[str, ...]
    changed: Mapping[str, str]

    def __str__(self) -> str:
        given = "; ".join(("told to stop", *self.given) if self.halted else self.given) or "nothing new"
        changed = ", ".join(f"{who} {status}" for who, status in self.changed.items())
        return f"{given} -> {changed}" if changed else given


Run = tuple[Turn, ...]


def run_to(space: Space, place: int) -> Run:
    """Return the run, a shortest one, that leads to a place."""
    way = space.way_to(place)
    return tuple(
        _turn(space, before, space.places[after].script, halted=ended_by_halt(space.places[after]))
        for before, after in pairwise(way)
    )


def run_that_found(space: Space, found: Found) -> Run:
    """Return the run that ends with the step in which something was found."""
    return (*run_to(space, found.place), _turn(space, found.place, found.script, halted=found.halted))


def _turn(space: Space, before: int, script: Script, *, halted: bool) -> Turn:
    space.step(before, script, halted=halted)
    model = space.model
    given = tuple(said for choice in model.oracle.made if (said := str(choice)))
    last = {node: status for node, status in model.watch.changes if _tells(node) or status is IDLE}
    changed = {shown(node): "halted" if status is IDLE else status_word(node) for node, status in last.items()}
    return Turn(halted, given, changed)


def _tells(node: Node) -> bool:
    """Say whether a change of a node is news: what leaves do has been given."""
    return not isinstance(node, Leaf)


def shown(node: Node) -> str:
    """Say which node is meant: its name, a modifier's word, and the line."""
    composite = isinstance(node, Leaf) or len(node.children) != 1 or node.kind == "mission"
    return f"{node.name if composite else node.kind} (line {node.line})"


PROVED, REFUTED, UNDECIDED = "proved", "refuted", "not decided"


@dataclass(frozen=True, slots=True)
class Finding:
    """Where a rule is broken, and a shortest run that shows it; None for what no run ever does."""

    fault: Diagnostic
    run: Run | None = None


@dataclass(frozen=True, slots=True)
class Verdict:
    """What came out for one rule; of one that is not decided, ``so_far`` says what is certain all the same."""

    rule: str
    outcome: str
    findings: tuple[Finding, ...] = ()
    so_far: str = ""

    def __str__(self) -> str:
        return f"{self.outcome:<11}  {self.rule}" + (f": {self.so_far}" if self.so_far else "")


@dataclass(frozen=True, slots=True)
class Report:
    """All verdicts on a mission, and how far it was explored: states, transitions, ticks from the start.

    ``left_out`` says why not everything was explored, where that is so.
    """

    file: str
    mission: str
    verdicts: tuple[Verdict, ...]
    states: int
    transitions: int
    depth: int
    seconds: float
    left_out: str = ""
    outcome: str = field(init=False)

    def __post_init__(self) -> None:
        outcomes = [verdict.outcome for verdict in self.verdicts]
        worst = next((outcome for outcome in (REFUTED, UNDECIDED) if outcome in outcomes), PROVED)
        object.__setattr__(self, "outcome", worst)

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterable[str]:
        figures = (
            f"{self.states} states, {self.transitions} transitions, {_ticks(self.depth)} deep, {self.seconds:.1f} s"
        )
        yield f"{self.file}: {self.outcome} ({figures})"
        for verdict in self.verdicts:
            yield f"  {verdict}"
        for finding in (finding for verdict in self.verdicts for finding in verdict.findings):
            yield ""
            yield str(finding.fault)
            if finding.run is not None:
                yield f"  a shortest run to it, of {_ticks(len(finding.run))}:" if finding.run else "  from the start"
            for number, turn in enumerate(finding.run or (), start=1):
                yield f"  {number:4d}. {turn}"
        if self.left_out:
            yield f"  not everything was explored: {self.left_out}"

    def as_dict(self) -> dict[str, object]:
        """Return it as plain data, for editors and other programs; line and column count from 1."""
        return {
            "file": self.file,
            "mission": self.mission,
            "outcome": self.outcome,
            "states": self.states,
            "transitions": self.transitions,
            "depth": self.depth,
            "seconds": round(self.seconds, 3),
            "left_out": self.left_out,
            "verdicts": [
                {
                    "rule": verdict.rule,
                    "outcome": verdict.outcome,
                    "so_far": verdict.so_far,
                    "findings": [_as_dict(finding) for finding in verdict.findings],
                }
                for verdict in self.verdicts
            ],
        }


def _as_dict(finding: Finding) -> dict[str, object]:
    fault = finding.fault
    turns = [{"halted": t.halted, "given": list(t.given), "changed": dict(t.changed)} for t in finding.run or ()]
    return {
        "file": fault.source.name,
        "line": fault.mark.line,
        "column": fault.mark.column,
        "length": fault.mark.length,
        "message": fault.message,
        "suggestion": fault.suggestion,
        "run": None if finding.run is None else turns,
    }


def _ticks(count: int) -> str:
    return "1 tick" if count == 1 else f"{count} ticks"
