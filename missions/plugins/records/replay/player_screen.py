"""Terminal screen of the record player: the tree with statuses, variables, and the last events."""

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
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.replay.record_player import KEY_HELP, RecordPlayer
from missions.plugins.view.panels import ViewState, node_label
from missions.trees.drawing import ACTIVE, SIGNS, NodeState, TreeBox
from missions.trees.drawing_builder import one_line
from missions.trees.states import TIME_TOLERANCE, state_after
from missions.trees.value_text import percept_name, value_text, variable_text
from perception.api import Percept

MAX_EVENTS = 3
"""Maximum number of events shown on the screen of the record player."""

MAX_VARIABLES = 6
"""Maximum number of variables shown; of the others, only their number is shown."""

SHOWN_COMMANDS = frozenset({"latch", "enable", "tune", "tone", "light", "relax", "follow", "recover"})
"""Commands that the record player lists as events; motion and speech are shown elsewhere or are too frequent."""


class PlayerScreen:
    """Draws the tree, variables and last events of a recorded run, at a time of the replay, on the terminal."""

    def __init__(self, record: RunRecord) -> None:
        self._record = record
        self._drawing = record.drawing()
        self._notable_events = [event for event in record.events if event_text(event)]
        self._variables = [event for event in record.events if isinstance(event, VariableSet)]

    def draw(self, player: RecordPlayer, height: int) -> Group:
        """Return the screen at the player's time, in at most ``height`` lines."""
        time = player.time
        below = [*self._variable_lines(time), *self._event_lines(time), self._footer(player)]
        tree, focus = self._tree(time)
        rows = [self._title_line(player), *_visible_rows(tree, focus, max(1, height - len(below) - 1)), *below]
        for row in rows:
            row.no_wrap, row.overflow = True, "ellipsis"
        return Group(*rows[:height])

    def _title_line(self, player: RecordPlayer) -> Text:
        sign = "▶" if player.playing else "∎"
        speed = f"  x{player.speed:g}" if player.speed != 1.0 else ""
        place = f"{sign} {player.time:8.2f} s of {player.end:.2f} s{speed}"
        return Text.assemble((f"{self._record.header.mission}  ", "bold"), place)

    def _tree(self, time: float) -> tuple[list[Text], int]:
        """Return a text line for each node of the tree, and the index of the last running one."""
        now = node_states(self._record, time)
        scene = ViewState(t=time, nodes={key: replace(each, reason=one_line(each.reason)) for key, each in now.items()})
        rows = list(_rows(self._drawing.root))
        running = [place for place, (_, box) in enumerate(rows) if scene.node_status(box.key).status in ACTIVE]
        return [Text("  " * depth) + node_label(box, scene) for depth, box in rows], max(running, default=0)

    def _variable_lines(self, time: float) -> list[Text]:
        """Return a line for each variable with a value."""
        values = variables_at(self._variables, time)
        lines = [f"  {name} = {value_text(value)}" for name, value in values.items()]
        more = [f"  and {len(lines) - MAX_VARIABLES} more"] if len(lines) > MAX_VARIABLES else []
        return [Text(line, style="cyan") for line in lines[:MAX_VARIABLES] + more]

    def _event_lines(self, time: float) -> list[Text]:
        """Return a text line for each of the last ``MAX_EVENTS`` events up to ``time`` (s)."""
        end = bisect_right(self._notable_events, time, key=lambda event: event.t)
        return [
            Text(f"  {event.t:8.2f} s  {event_text(event)}")
            for event in self._notable_events[max(0, end - MAX_EVENTS) : end]
        ]

    def _footer(self, player: RecordPlayer) -> Text:
        if player.typing is not None:
            return Text(f"search: {player.typing}_", style="bold")
        return Text(player.note or KEY_HELP, style="yellow" if player.note else "dim")


def event_lines(record: RunRecord, start: float) -> Iterator[str]:
    """Yield a line for each status change and notable event of a record from ``start`` (s) on.

    A variable that holds a percept is printed again only when the percept's name changes.
    """
    held: dict[tuple[str, str], str] = {}
    for event in record.events:
        if event.t < start - TIME_TOLERANCE:
            continue
        if isinstance(event, NodeChanged):
            reason = f": {event.reason}" if event.reason else ""
            sign, named = SIGNS[state_after(event).status], "" if event.name == event.kind else f" '{event.name}'"
            yield f"{event.t:8.2f} s  {sign} {event.status:<8} {event.kind}{named} (line {event.line}){reason}"
        elif isinstance(event, VariableSet):
            variable, seen = (
                (event.scope, event.name),
                percept_name(event.value) if isinstance(event.value, Percept) else "",
            )
            if not seen or held.get(variable) != seen:
                yield f"{event.t:8.2f} s    {event.name} = {variable_text(event)}"
            held[variable] = seen
        elif words := event_text(event):
            yield f"{event.t:8.2f} s    {words}"


def node_states(record: RunRecord, time: float) -> Mapping[str, NodeState]:
    """Return the status of each node at ``time`` (s) by its key, in the form that tree drawings take."""
    return {key: state_after(change) for key, change in record.statuses(time).items()}


def variables_at(events: Sequence[VariableSet], time: float) -> Mapping[str, object]:
    """Return the values of variables at ``time`` (s); names in a sub-mission begin with the key of its node."""
    values: dict[str, object] = {}
    for event in events:
        if event.t > time:
            break
        values[f"{event.scope} {event.name}".lstrip()] = event.value
    return values


def running_leaves(root: TreeBox) -> list[TreeBox]:
    """Return the running leaves of a tree."""
    return [box for box in root.walk() if box.status in ACTIVE and not box.children]


def event_text(event: Event) -> str:
    """Return an event as text for the record player; empty for events that are too frequent to list."""
    match event:
        case Logged():
            return _log_text(event)
        case Notified():
            return f"notice: {event.text}"
        case FaultRaised():
            return f"! {event.part} {event.status}: {event.detail_without_part}"
        case ReflexFired():
            return f"! {event.condition} {event.where}".rstrip() + ("" if event.on else " over")
        case CommandSent() if SHOWN_COMMANDS & set(event.values):
            values = ", ".join(f"{name} {value_text(value)}" for name, value in event.values.items())
            return f"{event.to}: {values}  ({event.source})"
        case _:
            return ""


def _log_text(line: Logged) -> str:
    """Return the text of a log line, or speaker and words if it is speech."""
    speaker, separator, words = line.text.partition(": ")
    if line.level == "voice":
        return f'robot: "{line.text}"'
    return f'{speaker}: "{words}"' if line.level == "person" and separator else f"{line.level}: {line.text}"


def _rows(root: TreeBox, depth: int = 0) -> Iterator[tuple[int, TreeBox]]:
    yield depth, root
    for child in root.children:
        yield from _rows(child, depth + 1)


def _visible_rows(rows: Sequence[Text], focus: int, height: int) -> Sequence[Text]:
    """Return ``height`` of the rows, chosen so that the row with index ``focus`` is two thirds down."""
    start = min(max(0, focus - height * 2 // 3), max(0, len(rows) - height))
    return rows[start : start + height]
