"""The tree of a mission on the terminal: fold it, search it, and keep its cursor at the running node.

Needs the extra ``view``. The rest of the view's text is in ``panels``, which replays and pictures use without it.
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
"""One of ``missions.trees.feed``."""

MAX_UNFOLDED_NODES = 60
"""Nodes from which on the missions inside are folded at first."""


class NodeTree(Tree[TreeBox], inherit_bindings=False):
    """The tree of a mission; its cursor stays with what runs until somebody moves it."""

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
        """Return a line, on the cursor too in its own colours; a folded one says how much there is below."""
        del base_style
        line = node.label.copy() if isinstance(node.label, Text) else Text(node.label)
        if node.data is not None and node.allow_expand and not node.is_expanded:
            line.append(f"  ({sum(1 for _ in node.data.walk()) - 1} folded)", style=DIM)
        line.stylize_before(style)
        return line

    def set_drawing(self, drawing: TreeDrawing) -> None:
        """Show this tree from now on."""
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
        """Show what a message has changed, and for how long what runs has been running."""
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
        """Move the cursor to a node, or to what it is folded into."""
        above = node.parent
        while above is not None:
            if unfold:
                above.expand()
            elif not above.is_expanded:
                node = above
            above = above.parent
        self.call_after_refresh(self.move_cursor, node)

    def toggle_fold(self) -> None:
        """Fold all missions inside, or unfold them where all are folded."""
        inside = [node for node in self._nodes_by_key.values() if node.data is not None and node.data.mission]
        wanted = not any(node.is_expanded for node in inside)
        for node in inside:
            if wanted:
                node.expand()
            else:
                node.collapse()

    def find_next(self, words: str, *, further: bool) -> bool:
        """Move to the next node in which ``words`` stand, from the present one on; False where there is none."""
        nodes = list(dict.fromkeys(self._nodes_by_key.values()))
        here = next((place for place, node in enumerate(nodes) if node is self.cursor_node), 0) + further
        for node in (*nodes[here:], *nodes[:here]):
            if node.data is not None and words.casefold() in _searchable_text(node.data, self._view_state).casefold():
                self.follows_running = False
                self.reveal_node(node, unfold=True)
                return True
        return False

    def action_go(self, where: str) -> None:
        """Move the cursor, which does not stay with what runs any more."""
        self.follows_running = False
        getattr(self, f"action_{where}")()


def _searchable_text(box: TreeBox, scene: ViewState) -> str:
    """Return all that a search looks through."""
    return f"{node_label(box, scene).plain} {node_details(box, scene).plain}"
