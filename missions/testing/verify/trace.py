"""Traces: a run of the exploration taken again, step by step, and told in lines."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from behaviours.leaf import IDLE, Leaf
from behaviours.node import Node
from missions.executive.events import status_word
from missions.testing.verify.choices import Script
from missions.testing.verify.explore import Found, Space, ended_by_halt


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
