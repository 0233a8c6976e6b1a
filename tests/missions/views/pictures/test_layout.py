"""Where cards stand: none on another, all text on its card, parents left of or above their children."""

from itertools import pairwise

from hypothesis import given, settings

from missions.library.shipped import load_mission, shipped_missions
from missions.plugins.pictures.compare import compare
from missions.plugins.pictures.layout import PAGE_WIDTH, MissionPanel, PlacedCard, TreeLayout, lay_out, lay_out_pair
from missions.trees.drawing import TreeBox, TreeDrawing
from missions.trees.drawing_builder import drawing_of
from tests.missions.views.pictures.drawn import DRAWINGS


def apart(one: PlacedCard, other: PlacedCard) -> bool:
    beside = one.x + one.width < other.x or other.x + other.width < one.x
    return beside or one.y + one.height < other.y or other.y + other.height < one.y


def holds(panel: MissionPanel, placed: PlacedCard) -> bool:
    across = panel.x <= placed.x and placed.x + placed.width <= panel.x + panel.width
    return across and panel.y < placed.y and placed.y + placed.height <= panel.y + panel.height


def is_sound(layout: TreeLayout, root: TreeBox) -> None:
    """Say that a layout shows a tree as it should."""
    assert [each.box for each in layout.cards] == list(root.walk())
    for number, one in enumerate(layout.cards):
        assert all(apart(one, other) for other in layout.cards[number + 1 :])
        assert one.x >= 0
        assert one.y >= 0
        assert one.x + one.width <= layout.width
        assert one.y + one.height <= layout.height
        for line in one.lines:
            assert 0 <= line.x <= line.x + line.width <= one.width
            assert 0 < line.y < one.height
    linked = sorted((link.parent.box.key, link.child.box.key) for link in layout.links)
    assert linked == sorted((box.key, child.key) for box in root.walk() for child in box.children)
    for link in layout.links:
        parent, child = link.parent, link.child
        assert child.y >= parent.y + parent.height if link.below else child.x > parent.x + parent.width


@settings(max_examples=25)
@given(DRAWINGS)
def test_cards_do_not_overlap_and_contain_their_text(drawing: TreeDrawing) -> None:
    is_sound(lay_out(drawing), drawing.root)


def test_shipped_missions_are_laid_out_without_overlap() -> None:
    for name in shipped_missions():
        drawing = drawing_of(load_mission(name))
        is_sound(lay_out(drawing), drawing.root)


@settings(max_examples=15)
@given(DRAWINGS, DRAWINGS)
def test_two_trees_side_by_side_are_sound_and_at_equal_heights(left: TreeDrawing, right: TreeDrawing) -> None:
    comparison = compare(left, right)
    layouts = lay_out_pair(comparison)
    for layout, drawing in zip(layouts, (left, right), strict=True):
        is_sound(layout, drawing.root)
    heights = [{each.box.key: each.y for each in layout.cards} for layout in layouts]
    for pair in comparison.root.walk():
        if pair.left is not None and pair.right is not None:
            assert heights[0][pair.left.key] == heights[1][pair.right.key]


def test_children_stand_in_the_order_of_the_file_and_begin_in_one_column() -> None:
    layout = lay_out(drawing_of(load_mission("greet_everybody")))
    for box in (each.box for each in layout.cards if each.box.children):
        children = [link.child for link in layout.links if link.parent.box is box]
        assert [child.box for child in children] == list(box.children)
        assert len({child.x for child in children}) == 1
        assert all(above.y + above.height < below.y for above, below in pairwise(children))


def test_submission_is_drawn_on_a_panel_with_its_file_name() -> None:
    drawing = drawing_of(load_mission("patrol"))
    layout = lay_out(drawing)
    (panel,) = layout.panels
    assert panel.label == "greet_everybody.yaml"
    (mission,) = (box for box in drawing.root.walk() if box.mission)
    inside = {box.key for child in mission.children for box in child.walk()}
    assert {each.box.key for each in layout.cards if holds(panel, each)} == inside


def test_a_deep_tree_grows_downwards_and_stays_as_narrow_as_a_page() -> None:
    leaf = TreeBox("1", "say", "say", "■", "m.yaml", 1, "Hello", {"text": "Hello"})
    tree = leaf
    for _ in range(15):
        tree = TreeBox("1", "sequence", "sequence", "→", "m.yaml", 1, children=(leaf, tree, leaf))
    assert lay_out(TreeDrawing("m", "", "m.yaml", tree)).width <= PAGE_WIDTH
