"""The people of a world file: who they are, where they stand and walk, what they do and answer."""

from dataclasses import dataclass
from typing import Literal

from config.fields import Fields
from config.layout import Layout, Place, place
from config.marked import Node, Scalar

LOOKS = ("anna", "ben", "chidi", "dora", "emil", "farah")
"""The people that can be drawn."""

BODY = 0.25
"""Metres from somebody's middle to where a robot touches them."""

ANYTHING = "anything"
"""What ``hears`` says for whatever the robot says."""

REACTION = 0.6
"""Seconds from hearing something to doing something about it."""

EARSHOT = 4.0
"""Metres within which people hear what the robot says, unless the file says otherwise."""

Facing = float | Literal["camera", "away"]
"""An angle about z; or towards whoever looks, or away from them."""


@dataclass(frozen=True, slots=True)
class ActConfig:
    """What somebody does at a time, or ``after`` seconds from hearing something that contains ``hears``.

    One of ``at`` and ``hears`` is None; the empty ``hears`` is contained in everything. What somebody hears makes them
    do it so many ``times`` at most, 0 for always.
    """

    at: float | None
    hears: str | None
    after: float
    say: str
    nod: bool
    turn: Facing | None
    leave: bool
    times: int = 0


@dataclass(frozen=True, slots=True)
class PersonConfig:
    """Somebody who stands at (x, y) and, after ``start`` seconds, walks along ``path`` at ``speed`` m/s.

    ``height`` is that of the eyes. Somebody who is not ``known`` is a stranger to a robot that recognises people.
    ``hears_within`` is how far away from the robot they hear it, in metres.
    """

    name: str
    look: str
    x: float
    y: float
    height: float
    facing: Facing
    path: tuple[Place, ...]
    speed: float
    start: float
    loop: bool
    acts: tuple[ActConfig, ...] = ()
    known: bool = True
    hears_within: float = EARSHOT


def read_person(world: Fields, node: Node, layout: Layout | None) -> PersonConfig:
    """Read one person, who must have room where they stand and walk to, as far as that is known."""
    fields = Fields(world.source, node, world.faults, what="a person")
    (x, y), path = read_path(fields, layout, BODY)
    facing = fields.node_of("facing")
    person = PersonConfig(
        name=fields.text("name"),
        look=fields.choice("look", LOOKS, "anna"),
        x=x,
        y=y,
        height=fields.quantity("height", "length", 1.6, low=0.8, high=2.1),
        facing="camera" if facing is None else _facing(fields, facing, "facing"),
        path=path,
        speed=fields.quantity("speed", "speed", 0.5, low=0.01, high=5.0),
        start=fields.quantity("after", "duration", 0.0, low=0.0),
        loop=fields.flag("loop", True),
        acts=tuple(_act(fields, act) for act in fields.items("acts")),
        known=fields.flag("known", True),
        hears_within=fields.quantity("hears_within", "length", EARSHOT, low=0.0, high=50.0),
    )
    fields.done()
    return person


def read_path(fields: Fields, layout: Layout | None, radius: float) -> tuple[Place, tuple[Place, ...]]:
    """Read where somebody of that ``radius`` is at first, under 'at', and the waypoints under 'walk'."""
    node = fields.node_of("at", required=True)
    points = []
    for number, stop in enumerate((node, *fields.items("walk"))):
        before = len(fields.faults)
        points.append(place(fields, stop, "at" if number == 0 else "walk"))
        if layout is not None and stop is not None and len(fields.faults) == before:
            name = fields.node_of("name")
            who = name.text if isinstance(name, Scalar) else fields.what
            layout.stand(fields, stop.mark, who, points[-1], radius if number == 0 else None)
    return points[0], tuple(points[1:])


def _act(person: Fields, node: Node) -> ActConfig:
    fields = Fields(person.source, node, person.faults, what="an act")
    at, hears, turn = fields.node_of("at"), fields.node_of("hears"), fields.node_of("turn")
    heard = fields.text("hears", "")
    act = ActConfig(
        at=None if at is None else fields.measure(at, "at", "duration", low=0.0),
        hears=None if hears is None else "" if heard == ANYTHING else heard,
        after=fields.quantity("after", "duration", REACTION, low=0.0, high=60.0),
        say=fields.text("say", ""),
        nod=fields.flag("nod", False),
        turn=None if turn is None else _facing(fields, turn, "turn"),
        leave=fields.flag("leave", False),
        times=fields.integer("times", 0, low=1),
    )
    before = len(fields.faults)
    fields.done()
    misspelt = at is None and hears is None and len(fields.faults) > before
    if (at is None) == (hears is None) and not misspelt:
        fields.fault(node.mark, "an act needs either 'at' or 'hears'", "such as {at: 5 s, ...} or {hears: hello, ...}")
    elif at is not None and fields.node_of("after") is not None:
        fields.fault(node.mark, "'after' is for what somebody hears; 'at' says when already")
    elif at is not None and fields.node_of("times") is not None:
        fields.fault(node.mark, "'times' is for what somebody hears; what has a time is done once")
    if not (act.say or act.nod or act.leave or turn is not None):
        fields.fault(node.mark, "nothing is done here", "an act needs one of: say, nod, turn, leave")
    return act


def _facing(fields: Fields, node: Node, key: str) -> Facing:
    word = node.value if isinstance(node, Scalar) else None
    if word == "camera":
        return "camera"
    return "away" if word == "away" else fields.measure(node, key, "angle")
