"""A robot as a mission asks and commands it: within a moment each question has one answer, and a part is asked once.

That is so whether a run is recorded or not, and it is what makes a record enough to decide everything over again:
whatever a tree is told from outside comes through here. A command that is not permitted is refused here too, as a
driver would; and a leaf sees the robot so that what it commands is told, with its name on it. In answers the parts go
by the names that they have in ``behaviours.robot.Robot``: base, head, arm, ranger, voice, sight, hearing, screen, and
further parts of a kind by their own.
Arguments are those of the protocol in its order, with what may be left out.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from behaviours.node import Node
from behaviours.robot import Robot
from drivers.api import Utterance
from drivers.api.driver import resolved
from drivers.api.kinds import KINDS
from drivers.api.marks import commands
from missions.executive.answers import Answers
from missions.executive.proxy import Permit, Tell, always, for_leaf, proxied
from missions.executive.speaking import voice_proxy

FIELDS = tuple(kind.field for kind in KINDS.values())
"""The parts by their names in answers."""


@cache
def protocol_of(kind: str) -> type:
    """Return the protocol of what leaves see of a kind of part, by its name, or that in answers."""
    found = next(each for each in KINDS.values() if kind in (each.field, each.name))
    protocol: type = resolved(found.seen or found.device)
    return protocol


@cache
def commands_of(kind: str) -> frozenset[str]:
    """Return what a kind of part is told, by its name in answers; the rest it is asked.

    A voice is told to cancel what it says, by its number.
    """
    return commands(protocol_of(kind)) | (commands(Utterance) if kind == "voice" else frozenset())


def asked(robot: Robot, answers: Answers, permit: Permit = always) -> Robot:
    """Return ``robot`` so that its parts answer through ``answers``; ``permit`` is asked before anything moves."""
    return _with(
        robot,
        {
            part: voice_proxy(device, answers)
            if part == "voice"
            else proxied(part, protocol_of(kind), device, answers, permit)
            for part, kind, device in _parts(robot)
        },
    )


def robot_for(node: Node, robot: Robot, tell: Tell) -> Robot:
    """Return a ``robot`` that ``asked`` has made as ``node`` sees it: each command that it gives is told."""
    source = f"{node.name} ({node.key})" if node.name != node.kind else f"{node.kind} ({node.key})"
    told = {part: for_leaf(proxy, source, tell) for part, kind, proxy in _parts(robot) if commands_of(kind)}
    return _with(robot, told).of(getattr(node, "named_parts", {}))


def _parts(robot: Robot) -> Iterator[tuple[str, str, Any]]:
    """Yield the name of each part in answers, that of its kind there, and what stands for it."""
    for part in FIELDS:
        device = getattr(robot, f"{part}_part")
        if device is not None:
            yield part, part, device
    for name, other in robot.others.items():
        yield name, KINDS[other.kind].field, other.part


def _with(robot: Robot, parts: Mapping[str, Any]) -> Robot:
    fields: dict[str, Any] = {f"{part}_part": device for part, device in parts.items() if part in FIELDS}
    others = {name: replace(other, part=parts.get(name, other.part)) for name, other in robot.others.items()}
    return replace(robot, others=others, **fields)
