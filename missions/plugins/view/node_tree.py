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

from missions.plugins.view.panels import DIM, Scene, about, label
from missions.trees.drawing import ACTIVE, Box, Drawing

Message = Mapping[str, Any]
"""One of ``missions.trees.feed``."""

MANY = 60
"""Nodes from which on the missions inside are folded at first."""


class NodeTree(Tree[Box], inherit_bindings=False):
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

    def __init__(self, scene: Scene) -> None:
        super().__init__("", id="tree")
        self.guide_depth = 2
        self.following = True
        self._scene = scene
        self._at: dict[str, TreeNode[Box]] = {}  # by the key of the box, and of its badges
        self._words: dict[str, str] = {}
        self._box: Box | None = None

    def render_label(self, node: TreeNode[Box], base_style: Style, style: Style) -> Text:
        """Return a line, on the cursor too in its own colours; a folded one says how much there is below."""
        del base_style
        line = node.label.copy() if isinstance(node.label, Text) else Text(node.label)
        if node.data is not None and node.allow_expand and not node.is_expanded:
            line.append(f"  ({sum(1 for _ in node.data.walk()) - 1} folded)", style=DIM)
        line.stylize_before(style)
        return line

    def fill(self, drawing: Drawing) -> None:
        """Show this tree from now on."""
        self._box = drawing.root
        many = sum(1 for _ in drawing.root.walk()) > MANY
        self._grow(self.root, drawing.root, fold=many)

    def _grow(self, node: TreeNode[Box], box: Box, *, fold: bool) -> None:
        node.data = box
        for key in (box.key, *(badge.key for badge in box.badges)):
            self._at[key] = node
        self._say(node, box)
        for child in box.children:
            self._grow(node.add("", allow_expand=bool(child.children)), child, fold=fold)
        if not (fold and box.mission):
            node.expand()

    def renew(self, message: Message) -> None:
        """Show what a message has changed, and for how long what runs has been running."""
        changed = {self._at[key] for key in message.get("changed", ()) if key in self._at}
        running = {self._at[key] for key, now in self._scene.nodes.items() if now.status in ACTIVE and key in self._at}
        for node in changed | running:
            if node.data is not None:
                self._say(node, node.data)
        if self.following and self._box is not None and (newest := self._scene.newest(self._box)):
            self.show(self._at[newest], unfold=False)

    def _say(self, node: TreeNode[Box], box: Box) -> None:
        words = label(box, self._scene)
        if self._words.get(box.key) != words.markup:
            self._words[box.key] = words.markup
            node.set_label(words)

    def show(self, node: TreeNode[Box], *, unfold: bool) -> None:
        """Move the cursor to a node, or to what it is folded into."""
        above = node.parent
        while above is not None:
            if unfold:
                above.expand()
            elif not above.is_expanded:
                node = above
            above = above.parent
        self.call_after_refresh(self.move_cursor, node)

    def fold(self) -> None:
        """Fold all missions inside, or unfold them where all are folded."""
        inside = [node for node in self._at.values() if node.data is not None and node.data.mission]
        wanted = not any(node.is_expanded for node in inside)
        for node in inside:
            if wanted:
                node.expand()
            else:
                node.collapse()

    def find(self, words: str, *, further: bool) -> bool:
        """Move to the next node in which ``words`` stand, from the present one on; False where there is none."""
        nodes = list(dict.fromkeys(self._at.values()))
        here = next((place for place, node in enumerate(nodes) if node is self.cursor_node), 0) + further
        for node in (*nodes[here:], *nodes[:here]):
            if node.data is not None and words.casefold() in _text(node.data, self._scene).casefold():
                self.following = False
                self.show(node, unfold=True)
                return True
        return False

    def action_go(self, where: str) -> None:
        """Move the cursor, which does not stay with what runs any more."""
        self.following = False
        getattr(self, f"action_{where}")()


def _text(box: Box, scene: Scene) -> str:
    """Return all that a search looks through."""
    return f"{label(box, scene).plain} {about(box, scene).plain}"
