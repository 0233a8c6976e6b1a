"""Tree widget of a mission: folding, search, and a cursor that follows the running node.

Needs the extra ``view``. Other texts of the view are in ``panels``, which replays and pictures use without that extra.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

from rich.style import Style
from rich.text import Text
from textual.binding import Binding, BindingType
from textual.widgets import Tree
from textual.widgets.tree import TreeNode

from missions.plugins.view.panels import DIM, ViewState, node_details, node_label
from missions.trees.drawing import ACTIVE, TreeBox, TreeDrawing

Message = Mapping[str, Any]
"""Message from a run to its view, as ``missions.trees.feed`` makes it: the changes since the message before."""

MAX_UNFOLDED_NODES = 60
"""Number of nodes of a mission above which its sub-missions are folded at first."""


class NodeTree(Tree[TreeBox], inherit_bindings=False):
    """Tree widget of a mission; its cursor follows the running node until the user moves it."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "go('cursor_up')"),
        Binding("down", "go('cursor_down')"),
        Binding("pageup", "go('page_up')"),
        Binding("pagedown", "go('page_down')"),
        Binding("home", "go('scroll_home')"),
        Binding("end", "go('scroll_end')"),
        Binding("left", "scroll_left"),
        Binding("right", "scroll_right"),
        Binding("enter", "toggle_node"),
    ]

    def __init__(self, scene: ViewState) -> None:
        super().__init__("", id="tree")
        self.guide_depth = 2
        self.follows_running = True
        self._view_state = scene
        self._nodes_by_key: dict[str, TreeNode[TreeBox]] = {}  # by the key of the box, and of its badges
        self._label_cache: dict[str, str] = {}
        self._box: TreeBox | None = None

    def render_label(self, node: TreeNode[TreeBox], base_style: Style, style: Style) -> Text:
        """Return the line of a node, with its own colours at the cursor, and with the number of folded nodes."""
        del base_style
        line = node.label.copy() if isinstance(node.label, Text) else Text(node.label)
        if node.data is not None and node.allow_expand and not node.is_expanded:
            line.append(f"  ({sum(1 for _ in node.data.walk()) - 1} folded)", style=DIM)
        line.stylize_before(style)
        return line

    def set_drawing(self, drawing: TreeDrawing) -> None:
        """Show the tree of a mission's drawing, with sub-missions folded if it is large."""
        self._box = drawing.root
        many = sum(1 for _ in drawing.root.walk()) > MAX_UNFOLDED_NODES
        self._add_box(self.root, drawing.root, fold=many)

    def _add_box(self, node: TreeNode[TreeBox], box: TreeBox, *, fold: bool) -> None:
        node.data = box
        for key in (box.key, *(badge.key for badge in box.badges)):
            self._nodes_by_key[key] = node
        self._update_label(node, box)
        for child in box.children:
            self._add_box(node.add("", allow_expand=bool(child.children)), child, fold=fold)
        if not (fold and box.mission):
            node.expand()

    def show_changes(self, message: Message) -> None:
        """Update the changed nodes of a message, and the times of running ones."""
        changed = {self._nodes_by_key[key] for key in message.get("changed", ()) if key in self._nodes_by_key}
        running = {
            self._nodes_by_key[key]
            for key, now in self._view_state.nodes.items()
            if now.status in ACTIVE and key in self._nodes_by_key
        }
        for node in changed | running:
            if node.data is not None:
                self._update_label(node, node.data)
        if (
            self.follows_running
            and self._box is not None
            and (newest := self._view_state.newest_running_leaf(self._box))
        ):
            self.reveal_node(self._nodes_by_key[newest], unfold=False)

    def _update_label(self, node: TreeNode[TreeBox], box: TreeBox) -> None:
        words = node_label(box, self._view_state)
        if self._label_cache.get(box.key) != words.markup:
            self._label_cache[box.key] = words.markup
            node.set_label(words)

    def reveal_node(self, node: TreeNode[TreeBox], *, unfold: bool) -> None:
        """Move the cursor to a node.

        With ``unfold``, unfold the nodes above it; otherwise move to the folded node around it.
        """
        above = node.parent
        while above is not None:
            if unfold:
                above.expand()
            elif not above.is_expanded:
                node = above
            above = above.parent
        self.call_after_refresh(self.move_cursor, node)

    def toggle_fold(self) -> None:
        """Fold all sub-missions, or unfold them if all are folded."""
        inside = [node for node in self._nodes_by_key.values() if node.data is not None and node.data.mission]
        wanted = not any(node.is_expanded for node in inside)
        for node in inside:
            if wanted:
                node.expand()
            else:
                node.collapse()

    def find_next(self, words: str, *, further: bool) -> bool:
        """Move the cursor to the next node that contains ``words``; return False if there is none.

        The search starts at the cursor, or after it if ``further``.
        """
        nodes = list(dict.fromkeys(self._nodes_by_key.values()))
        here = next((place for place, node in enumerate(nodes) if node is self.cursor_node), 0) + further
        for node in (*nodes[here:], *nodes[:here]):
            if node.data is not None and words.casefold() in _searchable_text(node.data, self._view_state).casefold():
                self.follows_running = False
                self.reveal_node(node, unfold=True)
                return True
        return False

    def action_go(self, where: str) -> None:
        """Move the cursor, and stop following the running node; ``where`` is a cursor action such as ``page_up``."""
        self.follows_running = False
        getattr(self, f"action_{where}")()


def _searchable_text(box: TreeBox, scene: ViewState) -> str:
    """Return the text of a node that a search looks through."""
    return f"{node_label(box, scene).plain} {node_details(box, scene).plain}"
