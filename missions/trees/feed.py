"""Feed of a view (the terminal or the studio) from a run: collects events, and executes the person's commands."""

import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from threading import Lock

from behaviours.node import RUNNING, Node
from drivers.clock import Clock
from missions.executive.events import Event, NodeChanged, Ticked, VariableSet, status_word
from missions.executive.executive import Executive
from missions.executive.parts import PartStatus
from missions.trees.drawing import ACTIVE
from missions.trees.drawing_builder import one_line
from missions.trees.value_text import value_text

Json = dict[str, object]

VIEW_COMMANDS = ("pause", "resume", "step", "stop", "interrupt")
"""Commands that a view can send; ``interrupt`` is a Ctrl-C, which reaches even a run that hangs."""

STOPPED_REASON = "stopped from the view"
"""Reason of a run that was stopped from a view."""

ABANDONED_REASON = "the view ended while the mission was paused"
"""Reason of a paused run whose view has ended, so that no user can resume it."""

POLL_INTERVAL = 0.5
"""Seconds between two polls of the robot's parts."""

MAX_LOG_LINES = 1000
"""Maximum number of log lines that wait for a slow view; older lines are dropped."""

MAX_SHOWN_LENGTH = 200
"""Maximum length of a variable's value or a node's reason in a message to a view."""


class ViewFeed:
    """Event listener that stores the present state at low cost; ``take_changes`` returns the changes for one view.

    ``look`` returns the states of the robot's parts, ``lines`` the log lines of an event. With ``in_tick``, for
    simulated time, the ticking thread polls the parts, otherwise the thread that takes the changes.
    """

    def __init__(
        self,
        executive: Executive,
        wall: Clock,
        *,
        look: Callable[[], Sequence[PartStatus]],
        lines: Callable[[Event], Iterable[str]],
        in_tick: bool = False,
    ) -> None:
        self._executive = executive
        self._wall = wall
        self._look = look
        self._lines = lines
        self._in_tick = in_tick
        self._paused = self._over = False
        self._tick, self._late, self._lates = 0, 0.0, 0
        self._nodes = {node.key: node for node in executive.root.iterate() if isinstance(node, Node)}
        self._running: dict[str, tuple[str, str, float]] = {}  # as they were told last
        # What is to be told yet, under the lock.
        self._changed: dict[str, tuple[str, str, float]] = {}
        self._variables: dict[str, str | None] = {}
        self._log: deque[str] = deque(maxlen=MAX_LOG_LINES)
        self._parts: Sequence[PartStatus] | None = None
        self._looked = float("-inf")
        self._lock = Lock()

    # --- told by the run ----------------------------------------------------------------------------------------------

    def __call__(self, event: Event) -> None:
        match event:
            case NodeChanged():
                with self._lock:
                    self._changed[event.node] = (event.status, _short(event.reason), event.t)
            case VariableSet():
                name = f"{event.scope} {event.name}".lstrip()
                with self._lock:
                    self._variables[name] = None if event.value is None else value_text(event.value)
            case Ticked():
                self._on_tick(event)
            case _:
                pass
        lines = [_printable(line) for line in self._lines(event)]
        with self._lock:
            self._log.extend(lines)

    def _on_tick(self, event: Ticked) -> None:
        self._tick, self._late = event.tick, event.late or 0.0
        self._lates += event.late is not None
        self._over = event.status in ("success", "skipped", "failure")  # what is being closed then is no news
        if self._in_tick:
            self.poll_parts()

    def poll_parts(self) -> None:
        """Poll the robot's parts if POLL_INTERVAL is over."""
        now = self._wall.now()
        if self._over or self._executive.stopping or now - self._looked < POLL_INTERVAL:
            return
        self._looked = now
        with suppress(Exception):  # what a driver has to say of itself must end neither a run nor its view
            parts = self._look()
            with self._lock:
                self._parts = parts

    # --- asked by the view's thread -----------------------------------------------------------------------------------

    def take_changes(self) -> Json:
        """Return all changes of the run's state since the last call."""
        if not self._in_tick:
            self.poll_parts()
        executive = self._executive
        with self._lock:
            changed, self._changed = self._changed, {}
            self._renew_reasons(changed)
            variables, self._variables = self._variables, {}
            log, parts = list(self._log), self._parts
            self._log.clear()
            self._parts = None
        told: Json = {
            "t": executive.time(),
            "tick": self._tick,
            "late": self._late,
            "lates": self._lates,
            "paused": executive.paused,
            "stopping": executive.stopping,
        }
        news = {"changed": changed, "variables": variables, "log": log}
        told |= {name: value for name, value in news.items() if value}
        if parts is not None:
            told["parts"] = [asdict(part) for part in parts]
        return told

    def visited_keys(self) -> list[str]:
        """Return the keys of the nodes visited in the last tick, and in the present one so far."""
        last = self._tick
        return [key for key, node in self._nodes.items() if node.visited_tick >= last]

    def _renew_reasons(self, changed: dict[str, tuple[str, str, float]]) -> None:
        """Add running nodes with a new reason to ``changed``; there is no event for a new reason."""
        for key, now in changed.items():
            self._running.pop(key, None)
            if now[0] in ACTIVE:
                self._running[key] = now
        for key, told in self._running.items():
            node = self._nodes.get(key)
            if node is not None and node.status is RUNNING:
                now = (status_word(node), _short(node.reason), told[2])
                if now != told:
                    changed[key] = self._running[key] = now

    def execute(self, message: Mapping[str, object]) -> None:
        """Execute a command of a view; unknown commands are ignored."""
        executive = self._executive
        match message.get("do"):
            case "pause":
                self._paused = True
                executive.pause()
            case "resume":
                self._paused = False
                executive.resume()
            case "step":
                executive.step()
            case "stop":
                executive.stop(STOPPED_REASON)
            case "interrupt":
                os.kill(os.getpid(), signal.SIGINT)
            case _:
                pass

    def on_view_lost(self) -> None:
        """Stop the run if a person had paused it from the lost view: no user could resume it."""
        if self._paused:
            self._executive.stop(ABANDONED_REASON)


def _short(text: str) -> str:
    line = one_line(text)
    return line if len(line) <= MAX_SHOWN_LENGTH else f"{line[: MAX_SHOWN_LENGTH - 1]}…"


def _printable(line: str) -> str:
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line.expandtabs())
