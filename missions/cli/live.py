"""Display of a run on a terminal: one line for each finished behaviour, and a live line for the running ones."""

from collections.abc import Mapping
from contextlib import suppress
from types import TracebackType
from typing import TYPE_CHECKING, Self, TextIO

from py_trees.common import Status

from behaviours.leaf import Leaf
from behaviours.node import Node
from missions.cli.printable import make_printable, unwrap_stream
from missions.executive.events import (
    CommandSent,
    Ended,
    Event,
    FaultRaised,
    Logged,
    NodeChanged,
    Notified,
    ReflexFired,
    Started,
    Ticked,
)
from missions.trees.drawing import ACTIVE

if TYPE_CHECKING:
    from missions.cli.console import LiveLines

REFRESH_INTERVAL = 0.1
"""Seconds between two updates of the live line."""

READY_NOTICE_DELAY = 2.0
"""If the first tick of a run is later than this, in seconds, the line "ready" is printed."""

STATUS_SIGNS = {"success": ("✓", "green"), "skipped": ("»", "dim"), "failure": ("✗", "red"), "idle": ("-", "dim")}

REFLEX_TEXTS = {
    "bumper": "bumped",
    "latched": "stopped until it is enabled",
    "battery_low": "its battery is low",
    "battery_critical": "its battery is critical",
}
"""Texts for the conditions of the base that are shown at once; cliffs and wheel drops are shown as faults."""


Part = str | tuple[str, str]
"""A piece of an output line: a text, or a text with its style."""


class PlainLines:
    """Lines in a file or a pipe, without colours and without a live line."""

    is_live = False

    def __init__(self, out: TextIO) -> None:
        self._out = unwrap_stream(out)

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def print(self, *parts: Part) -> None:
        """Write the texts of ``parts`` as one line, without their styles."""
        self._out.write(make_printable("".join(part if isinstance(part, str) else part[0] for part in parts)) + "\n")
        self._out.flush()

    def show(self, line: str) -> None: ...


def lines_on(out: TextIO) -> "PlainLines | LiveLines":
    """Return the writer of output lines for ``out``: with a live line if it is a terminal, else plain lines."""
    if not out.isatty():
        return PlainLines(out)
    from missions.cli.console import LiveLines  # noqa: PLC0415 - most runs of a robot have no terminal

    return LiveLines(out)


class RunDisplay:
    """Listener that shows a run on a terminal, or as plain lines on another stream."""

    def __init__(self, out: TextIO) -> None:
        self._leaves: dict[str, Leaf] = {}
        self._lines = lines_on(out)
        self._drawn_at = -REFRESH_INTERVAL
        self._started: dict[str, float] = {}
        self._halted: list[tuple[NodeChanged, float]] = []  # leaves and their run times, until the cause is known
        self._online_parts: list[str] = []  # parts that are shown until the first tick
        self._faulty_parts: set[str] = set()  # parts with a printed problem that may have ended
        self._ready = False

    def show_tree(self, root: Node) -> None:
        """Set the tree of the run by its ``root``; its leaves are shown."""
        self._leaves = {node.key: node for node in root.iterate() if isinstance(node, Leaf)}

    def __enter__(self) -> Self:
        self._lines.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Without a terminal, rich raises even SystemExit; there is nothing to show then.
        with suppress(OSError, ValueError, SystemExit):
            self._lines.stop()

    def __call__(self, event: Event) -> None:
        if self._halted and not (isinstance(event, NodeChanged) and event.status == "idle"):
            self._print_halted(event)
        self._show(event)

    def _show(self, event: Event) -> None:
        match event:
            case Started():
                self._lines.print(("mission ", "bold"), event.mission, f" on {event.robot}")
                self._show_preparing()
            case NodeChanged() if event.kind:
                self._node(event)
            case FaultRaised():
                self._fault(event)
            case CommandSent(to="screen"):
                self._face(event.values)
            case ReflexFired() if event.on and event.condition in REFLEX_TEXTS:
                self._reflex(event)
            case Logged():
                self._log(event)
            case Notified():
                self._lines.print(("  notice: ", "bold green"), event.text)
            case Ticked():
                self._tick(event.t)
            case Ended() if event.result != "error":  # the command itself prints an error, with a hint
                self._end(event)
            case _:
                pass

    def _show_preparing(self) -> None:
        """Show, until the first tick, that the robot is getting ready, with the parts that are connected."""
        if not self._ready:
            online = f": {', '.join(self._online_parts)}" if self._online_parts else ""
            self._lines.show(f"  getting ready{online}")

    def _tick(self, time: float) -> None:
        if not self._ready and time > READY_NOTICE_DELAY:
            self._lines.print(f"{time:6.1f} s  ready")
        self._ready = True
        if time - self._drawn_at >= REFRESH_INTERVAL:
            self._draw(time)

    def _node(self, event: NodeChanged) -> None:
        """Show a leaf that has ended, or was halted, after it ran for at least a tick."""
        if event.status in ACTIVE:
            self._started.setdefault(event.node, event.t)
            return
        began = self._started.pop(event.node, None)
        if began is None or event.node not in self._leaves:
            return
        if event.status == "idle":
            self._halted.append((event, event.t - began))
        else:
            self._print_leaf(event, event.t - began, event.reason if event.status == "failure" else "")

    def _print_halted(self, event: Event) -> None:
        """Print the leaves that were halted before ``event``; as timed out if it is the failure of a timeout."""
        is_timeout = isinstance(event, NodeChanged) and event.kind == "timeout" and event.status == "failure"
        for leaf, seconds in self._halted:
            self._print_leaf(leaf, seconds, "timed out" if is_timeout else "halted")
        self._halted.clear()

    def _print_leaf(self, event: NodeChanged, seconds: float, note: str) -> None:
        sign, style = STATUS_SIGNS[event.status]
        took = (f"  ({seconds:.1f} s{', ' + note if note else ''})", "dim")
        self._lines.print(f"{event.t:6.1f} s  ", (sign, style), f" {event.name}", took)

    def _fault(self, event: FaultRaised) -> None:
        if event.status == "online":
            self._online_parts.append(event.part)
            self._show_preparing()
            if "(screen): http" in event.detail:  # the address of the page with its face
                self._lines.print(f"  {event.detail_without_part}")
            elif event.part in self._faulty_parts:
                self._faulty_parts.discard(event.part)
                self._lines.print(
                    f"{event.t:6.1f} s  ", ("✓", "green"), f" {event.part}: back: {event.detail_without_part}"
                )
            return
        self._faulty_parts.add(event.part)
        hint = f"\n            try: {event.hint}" if event.hint else ""
        self._lines.print(f"{event.t:6.1f} s  ", ("!", "yellow"), f" {event.part}: {event.detail_without_part}{hint}")

    def _face(self, values: Mapping[str, object]) -> None:
        """Show the mood and the picture of the robot's screen, for users without a display."""
        if "mood" in values:
            self._lines.print(("  face: ", "bold cyan"), str(values["mood"]))
        if values.get("show"):
            self._lines.print(("  shows: ", "bold cyan"), str(values["show"]))

    def _reflex(self, event: ReflexFired) -> None:
        what = f" base: {REFLEX_TEXTS[event.condition]}" + (f": {event.where}" if event.where else "")
        if event.condition == "latched" and event.where.startswith("stopped by "):
            who = event.where.removeprefix("stopped by ")
            who = "`mission stop`" if who.startswith("mission stop") else who
            what = f" base: stopped by {who}; to go on: mission stop --release --resume"
        self._lines.print(f"{event.t:6.1f} s  ", ("!", "yellow"), what)

    def _log(self, event: Logged) -> None:
        if event.level == "voice":
            self._lines.print(("  robot: ", "bold cyan"), event.text)
        elif event.level == "person":
            who, _, words = event.text.partition(": ")
            self._lines.print((f"  {who}: ", "bold magenta"), words)
        else:
            style = {"info": "dim", "warning": "yellow"}.get(event.level, "red")
            self._lines.print(f"{event.t:6.1f} s  ", (f"{event.level}: ", style), event.text)

    def _draw(self, time: float) -> None:
        self._drawn_at = time
        if not self._lines.is_live:
            return
        running = [leaf for leaf in self._leaves.values() if leaf.status is Status.RUNNING]
        words = [f"{leaf.name}: {leaf.reason}" if leaf.reason else leaf.name for leaf in running]
        self._lines.show(f"{time:6.1f} s  > {' | '.join(words)}")

    def _end(self, event: Ended) -> None:
        self._lines.show("")
        sign, style = STATUS_SIGNS.get(event.result, ("✗", "yellow"))
        reason = f": {event.reason}" if event.reason else ""
        self._lines.print((f"{sign} {event.mission}: {event.result}", style), f" after {event.seconds:.1f} s{reason}")
