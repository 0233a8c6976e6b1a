"""Terminal application of the view: shows the messages of a run, and sends a command when the user presses a key."""

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
from missions.cli.printable import make_all_printable
from missions.plugins.view import panels
from missions.plugins.view.node_tree import Message, NodeTree
from missions.plugins.view.panels import ViewState
from missions.trees.drawing import TreeBox, from_json

STALE_TIMEOUT = 2.0
"""Seconds without a message after which the display is marked as old."""

MIN_WIDE_COLUMNS = 110
"""Number of terminal columns from which on the robot is shown beside the tree, not below it."""

MAX_LOG_LINES = 1000
"""Maximum number of lines that the view keeps in its log."""

OrderSender = Callable[[str], None]
"""Sends an order, one of ``missions.trees.feed.VIEW_COMMANDS``."""


class ViewApp(App[None]):
    """Shows the messages from ``messages`` until they end.

    ``send`` sends a command of the user to the run. With ``plain`` only ASCII is used, except in texts of the mission.
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

    def __init__(self, messages: StreamReader, send: OrderSender, clock: Clock, *, plain: bool = False) -> None:
        super().__init__()
        self.animation_level = "none"  # each frame is sent over the line
        self.HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (MIN_WIDE_COLUMNS, "-wide")]
        self.view_state = ViewState(plain)
        self._messages = messages
        self._send_order = send
        self._clock = clock
        self._last_message_at = clock.now()

    def compose(self) -> ComposeResult:
        yield Static(id="head")
        with Container(id="body"):
            with Vertical(id="mission"):
                yield NodeTree(self.view_state)
                yield Static(id="about")
            with Container(id="state"):
                with VerticalScroll(id="robot", can_focus=False):
                    yield Static(id="parts")
                with VerticalScroll(id="memory", can_focus=False):
                    yield Static(id="variables")
        yield RichLog(id="log", max_lines=MAX_LOG_LINES, wrap=True)
        yield Input(id="search", placeholder="search: Enter for the next match, Escape to close", compact=True)
        yield Static(id="foot")

    async def on_mount(self) -> None:
        self.screen.set_class(self.view_state.plain, "-plain")
        for name, title in (("robot", "robot"), ("memory", "variables"), ("log", "log")):
            self.query_one(f"#{name}").border_title = title
        self.query_one("#log").can_focus = False
        self.nodes.show_guides = not self.view_state.plain
        self.nodes.focus()
        self.set_interval(1.0, self._show_head)
        self.run_worker(self._read())

    @property
    def nodes(self) -> NodeTree:
        """Widget that shows the mission's tree."""
        return self.query_one(NodeTree)

    async def _read(self) -> None:
        with suppress(ConnectionError):  # the run ended while an order was on its way
            while line := await self._messages.readline():
                self.show_message(make_all_printable(json.loads(line)))
        self.exit()

    def show_message(self, message: Message) -> None:
        """Update all panels of the view with a message from the run."""
        self._last_message_at = self._clock.now()
        if "drawing" in message:
            drawing = from_json(message["drawing"])
            self.view_state.set_drawing(drawing, message["robot"])
            self.nodes.set_drawing(drawing)
        self.view_state.apply(message)
        self.nodes.show_changes(message)
        log = self.query_one("#log", RichLog)
        for line in message.get("log", ()):
            log.write(panels.log_line(line, self.view_state))
        self._show_head()
        self._show("about", self._node_details())
        self._show("parts", panels.part_lines(self.view_state))
        self._show("variables", panels.variable_lines(self.view_state))
        self._show("foot", panels.footer_line(self.view_state))

    def _show_head(self) -> None:
        silence = self._clock.now() - self._last_message_at
        self._show(
            "head", panels.header_line(self.view_state, self.size.width, silence if silence > STALE_TIMEOUT else 0.0)
        )

    def _show(self, name: str, text: Text) -> None:
        """Update a text widget, unless the screen is being closed; an unchanged text sends nothing to the terminal."""
        for shown in self.query(f"#{name}").results(Static):
            shown.update(text)

    def _node_details(self) -> Text:
        node = self.nodes.cursor_node
        return Text() if node is None or node.data is None else panels.node_details(node.data, self.view_state)

    # --- keys ---------------------------------------------------------------------------------------------------------

    def on_tree_node_highlighted(self, event: Tree.NodeHighlighted[TreeBox]) -> None:
        """Show details of the node at the cursor."""
        del event
        self._show("about", self._node_details())

    def action_pause(self) -> None:
        """Pause or resume the mission."""
        self._send_order("resume" if self.view_state.paused else "pause")

    def action_step(self) -> None:
        """Tick the mission once; only while it is paused."""
        if self.view_state.paused:
            self._send_order("step")

    def action_stop(self) -> None:
        """Stop the mission; while it is stopping, interrupt it as Ctrl-C does."""
        self._send_order("interrupt" if self.view_state.stopping else "stop")

    def action_interrupt(self) -> None:
        """Interrupt the run as Ctrl-C does without a view."""
        self._send_order("interrupt")

    def action_fold(self) -> None:
        """Fold or unfold all sub-missions."""
        self.nodes.toggle_fold()

    def action_follow(self) -> None:
        """Let the cursor follow the running node again."""
        self.nodes.follows_running = True
        self.nodes.show_changes({})

    def action_search(self) -> None:
        """Open the search field."""
        field = self.query_one("#search", Input)
        field.display = True
        field.focus()

    def action_leave_search(self) -> None:
        """Close the search field; the cursor stays."""
        field = self.query_one("#search", Input)
        field.value = ""
        field.display = False
        self.nodes.focus()

    def on_input_changed(self, event: Input.Changed) -> None:
        """Move the cursor to the first node that contains the search text."""
        self._search(event.value, further=False)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Move the cursor to the next node that contains the search text."""
        self._search(event.value, further=True)

    def _search(self, words: str, *, further: bool) -> None:
        found = not words or self.nodes.find_next(words, further=further)
        self.query_one("#search", Input).set_class(not found, "-missing")
