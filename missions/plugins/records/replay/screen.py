"""What a record shows at one moment, on a terminal: the tree and its statuses, the variables, what happened last."""

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from rich.console import Group
from rich.text import Text

from missions.executive.events import (
    CommandSent,
    Event,
    FaultRaised,
    Logged,
    NodeChanged,
    Notified,
    ReflexFired,
    VariableSet,
)
from missions.plugins.records.recording.read import Record
from missions.plugins.records.replay.play import HELP, Player
from missions.plugins.view.panels import Scene, label
from missions.trees.draw import one_line
from missions.trees.drawing import ACTIVE, SIGNS, Box, Now
from missions.trees.states import TIME_TOLERANCE, now_of
from missions.trees.words import in_words, name_of, variable_in_words
from perception.api import Percept

LAST = 3
"""As many of the last events are shown."""

MOST_VARIABLES = 6
"""More are only counted."""

RARE = frozenset({"latch", "enable", "tune", "tone", "light", "relax", "follow", "recover"})
"""Commands worth a line; where base, head and arm go, and what is said, is told otherwise or all the time."""


class Screen:
    """Draws a record at any time."""

    def __init__(self, record: Record) -> None:
        self._record = record
        self._drawing = record.drawing()
        self._told = [event for event in record.events if said(event)]
        self._variables = [event for event in record.events if isinstance(event, VariableSet)]

    def draw(self, player: Player, height: int) -> Group:
        """Return what there is to see where the ``player`` is, in ``height`` lines at most."""
        time = player.time
        below = [*self._values(time), *self._last(time), self._foot(player)]
        tree, focus = self._tree(time)
        rows = [self._head(player), *_window(tree, focus, max(1, height - len(below) - 1)), *below]
        for row in rows:
            row.no_wrap, row.overflow = True, "ellipsis"
        return Group(*rows[:height])

    def _head(self, player: Player) -> Text:
        sign = "▶" if player.playing else "∎"
        speed = f"  x{player.speed:g}" if player.speed != 1.0 else ""
        place = f"{sign} {player.time:8.2f} s of {player.until:.2f} s{speed}"
        return Text.assemble((f"{self._record.head.mission}  ", "bold"), place)

    def _tree(self, time: float) -> tuple[list[Text], int]:
        """Return a line for each node, and which of them it is about now."""
        now = states(self._record, time)
        scene = Scene(t=time, nodes={key: replace(each, reason=one_line(each.reason)) for key, each in now.items()})
        rows = list(_rows(self._drawing.root))
        running = [place for place, (_, box) in enumerate(rows) if scene.now(box.key).status in ACTIVE]
        return [Text("  " * depth) + label(box, scene) for depth, box in rows], max(running, default=0)

    def _values(self, time: float) -> list[Text]:
        """Return a line for each variable that has a value."""
        values = variables(self._variables, time)
        lines = [f"  {name} = {in_words(value)}" for name, value in values.items()]
        more = [f"  and {len(lines) - MOST_VARIABLES} more"] if len(lines) > MOST_VARIABLES else []
        return [Text(line, style="cyan") for line in lines[:MOST_VARIABLES] + more]

    def _last(self, time: float) -> list[Text]:
        """Return a line for each of the last events."""
        end = bisect_right(self._told, time, key=lambda event: event.t)
        return [Text(f"  {event.t:8.2f} s  {said(event)}") for event in self._told[max(0, end - LAST) : end]]

    def _foot(self, player: Player) -> Text:
        if player.typing is not None:
            return Text(f"search: {player.typing}_", style="bold")
        return Text(player.note or HELP, style="yellow" if player.note else "dim")


def lines(record: Record, start: float) -> Iterator[str]:
    """Yield what happened from ``start`` on, a line for each change of a node and each event worth one.

    A variable that holds somebody who was seen is told again once it is somebody else, not in each new place.
    """
    held: dict[tuple[str, str], str] = {}
    for event in record.events:
        if event.t < start - TIME_TOLERANCE:
            continue
        if isinstance(event, NodeChanged):
            reason = f": {event.reason}" if event.reason else ""
            sign, named = SIGNS[now_of(event).status], "" if event.name == event.kind else f" '{event.name}'"
            yield f"{event.t:8.2f} s  {sign} {event.status:<8} {event.kind}{named} (line {event.line}){reason}"
        elif isinstance(event, VariableSet):
            variable, seen = (event.scope, event.name), name_of(event.value) if isinstance(event.value, Percept) else ""
            if not seen or held.get(variable) != seen:
                yield f"{event.t:8.2f} s    {event.name} = {variable_in_words(event)}"
            held[variable] = seen
        elif words := said(event):
            yield f"{event.t:8.2f} s    {words}"


def states(record: Record, time: float) -> Mapping[str, Now]:
    """Return how each node stands at ``time``, as pictures take it."""
    return {key: now_of(change) for key, change in record.statuses(time).items()}


def variables(events: Sequence[VariableSet], time: float) -> Mapping[str, object]:
    """Return the values that variables have at ``time``; those of a mission inside with the key of its node."""
    values: dict[str, object] = {}
    for event in events:
        if event.t > time:
            break
        values[f"{event.scope} {event.name}".lstrip()] = event.value
    return values


def running(root: Box) -> list[Box]:
    """Return the nodes at the bottom of the tree that are running."""
    return [box for box in root.walk() if box.status in ACTIVE and not box.children]


def said(event: Event) -> str:
    """Return an event in words; nothing for those that happen all the time."""
    match event:
        case Logged():
            return _heard(event)
        case Notified():
            return f"notice: {event.text}"
        case FaultRaised():
            return f"! {event.part} {event.what}: {event.plain}"
        case ReflexFired():
            return f"! {event.what} {event.where}".rstrip() + ("" if event.on else " over")
        case CommandSent() if RARE & set(event.values):
            values = ", ".join(f"{name} {in_words(value)}" for name, value in event.values.items())
            return f"{event.to}: {values}  ({event.source})"
        case _:
            return ""


def _heard(line: Logged) -> str:
    """Return a line of the log: of speech, who said it, and what."""
    who, told, words = line.text.partition(": ")
    if line.level == "voice":
        return f'robot: "{line.text}"'
    return f'{who}: "{words}"' if line.level == "person" and told else f"{line.level}: {line.text}"


def _rows(root: Box, depth: int = 0) -> Iterator[tuple[int, Box]]:
    yield depth, root
    for child in root.children:
        yield from _rows(child, depth + 1)


def _window(rows: Sequence[Text], focus: int, height: int) -> Sequence[Text]:
    """Return as many rows as there is room for, with the one that it is about two thirds down."""
    start = min(max(0, focus - height * 2 // 3), max(0, len(rows) - height))
    return rows[start : start + height]
