"""The view on the terminal: what comes from a run is shown, and keys go back as orders."""

import json
from asyncio import StreamReader
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container, Vertical, VerticalScroll
from textual.widgets import Input, RichLog, Static, Tree

from drivers.clock import Clock
from missions.cli.printable import all_printable
from missions.plugins.view import panels
from missions.plugins.view.node_tree import Message, NodeTree
from missions.plugins.view.panels import Scene
from missions.trees.drawing import Box, from_json

SILENCE = 2.0
"""Seconds without a message after which what is shown is called old."""

WIDE = 110
"""Columns from which on the robot stands beside the tree, not below it."""

LINES = 1000
"""Lines of the log that can be looked at."""

Send = Callable[[str], None]
"""Sends an order, one of ``missions.trees.feed.ORDERS``."""


class ViewApp(App[None]):
    """Shows the messages that it reads from ``messages`` until they end.

    ``send`` takes orders away. With ``plain`` there is nothing on the screen but ASCII, except in the words of others.
    """

    CSS_PATH = Path(__file__).with_name("view.tcss")
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "pause"),
        Binding("n", "step"),
        Binding("s,q", "stop"),
        Binding("ctrl+q", "stop", priority=True),
        # Without the view these are signals that end the run.
        Binding("ctrl+c,ctrl+z,ctrl+backslash", "interrupt", priority=True),
        Binding("slash", "search"),
        Binding("escape", "leave_search"),
        Binding("f", "fold"),
        Binding("r", "follow"),
    ]

    def __init__(self, messages: StreamReader, send: Send, clock: Clock, *, plain: bool = False) -> None:
        super().__init__()
        self.animation_level = "none"  # each frame of one goes over the wire
        self.HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (WIDE, "-wide")]
        self.scene = Scene(plain)
        self._messages = messages
        self._order = send
        self._clock = clock
        self._heard = clock.now()

    def compose(self) -> ComposeResult:
        """Make the parts of the screen."""
        yield Static(id="head")
        with Container(id="body"):
            with Vertical(id="mission"):
                yield NodeTree(self.scene)
                yield Static(id="about")
            with Container(id="state"):
                with VerticalScroll(id="robot", can_focus=False):
                    yield Static(id="parts")
                with VerticalScroll(id="memory", can_focus=False):
                    yield Static(id="variables")
        yield RichLog(id="log", max_lines=LINES, wrap=True)
        yield Input(id="search", placeholder="search: Enter goes on, Escape ends it", compact=True)
        yield Static(id="foot")

    async def on_mount(self) -> None:
        """Begin to read."""
        self.screen.set_class(self.scene.plain, "-plain")
        for name, title in (("robot", "robot"), ("memory", "variables"), ("log", "log")):
            self.query_one(f"#{name}").border_title = title
        self.query_one("#log").can_focus = False
        self.nodes.show_guides = not self.scene.plain
        self.nodes.focus()
        self.set_interval(1.0, self._show_head)
        self.run_worker(self._read())

    @property
    def nodes(self) -> NodeTree:
        """The tree."""
        return self.query_one(NodeTree)

    async def _read(self) -> None:
        with suppress(ConnectionError):  # so it ends where an order is on its way to a run that is over
            while line := await self._messages.readline():
                self.take(all_printable(json.loads(line)))
        self.exit()

    def take(self, message: Message) -> None:
        """Show a message."""
        self._heard = self._clock.now()
        if "drawing" in message:
            drawing = from_json(message["drawing"])
            self.scene.begin(drawing, message["robot"])
            self.nodes.fill(drawing)
        self.scene.take(message)
        self.nodes.renew(message)
        log = self.query_one("#log", RichLog)
        for line in message.get("log", ()):
            log.write(panels.log_line(line, self.scene))
        self._show_head()
        self._show("about", self._about())
        self._show("parts", panels.parts(self.scene))
        self._show("variables", panels.variables(self.scene))
        self._show("foot", panels.foot(self.scene))

    def _show_head(self) -> None:
        silence = self._clock.now() - self._heard
        self._show("head", panels.head(self.scene, self.size.width, silence if silence > SILENCE else 0.0))

    def _show(self, name: str, text: Text) -> None:
        """Show a text, unless the screen is being taken down; the same text again costs nothing on the wire."""
        for shown in self.query(f"#{name}").results(Static):
            shown.update(text)

    def _about(self) -> Text:
        node = self.nodes.cursor_node
        return Text() if node is None or node.data is None else panels.about(node.data, self.scene)

    # --- keys ---------------------------------------------------------------------------------------------------------

    def on_tree_node_highlighted(self, event: Tree.NodeHighlighted[Box]) -> None:
        """Say more of the node on which the cursor is."""
        del event
        self._show("about", self._about())

    def action_pause(self) -> None:
        """Pause, or go on."""
        self._order("resume" if self.scene.paused else "pause")

    def action_step(self) -> None:
        """Make one tick; only while paused."""
        if self.scene.paused:
            self._order("step")

    def action_stop(self) -> None:
        """Stop the mission; once that has been heard and still lasts, as Ctrl-C does."""
        self._order("interrupt" if self.scene.stopping else "stop")

    def action_interrupt(self) -> None:
        """Do what Ctrl-C does where there is no view."""
        self._order("interrupt")

    def action_fold(self) -> None:
        """Fold the missions inside, or unfold them."""
        self.nodes.fold()

    def action_follow(self) -> None:
        """Let the cursor stay with what runs again."""
        self.nodes.following = True
        self.nodes.renew({})

    def action_search(self) -> None:
        """Ask for what to search."""
        field = self.query_one("#search", Input)
        field.display = True
        field.focus()

    def action_leave_search(self) -> None:
        """End the search, where it has led to."""
        field = self.query_one("#search", Input)
        field.value = ""
        field.display = False
        self.nodes.focus()

    def on_input_changed(self, event: Input.Changed) -> None:
        """Go to the first node in which these words stand."""
        self._search(event.value, further=False)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Go to the next one."""
        self._search(event.value, further=True)

    def _search(self, words: str, *, further: bool) -> None:
        found = not words or self.nodes.find(words, further=further)
        self.query_one("#search", Input).set_class(not found, "-missing")
