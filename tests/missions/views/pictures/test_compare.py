"""Two missions compared: what belongs together, and what has changed in it."""

from collections import Counter

import pytest
from hypothesis import given, settings
from rich.cells import cell_len

from missions.library.shipped import load_mission
from missions.plugins.pictures.compare import Change, TreeComparison, compare, side_by_side
from missions.plugins.pictures.forms import comparison_to_json
from missions.trees.drawing import TreeDrawing
from missions.trees.drawing_builder import drawing_of, fold_missions
from tests.missions.views.pictures.drawn import DRAWINGS, plan_of

BEFORE = """
  sequence:
    - find_face: {pan: [-60 deg, 60 deg], scans: 2}
      timeout: 5 s
    - selector:
        - say: Hello
        - say: Who are you?
    - drive: 1 m
"""


def drawn(tree: str) -> TreeDrawing:
    return drawing_of(plan_of(tree))


def told(comparison: TreeComparison) -> dict[str, tuple[Change, str]]:
    """What is said of each pair that is not the same, by the title of its node."""
    pairs = (pair for pair in comparison.root.walk() if pair.change != "same")
    return {
        box.title: (pair.change, pair.differences) for pair in pairs if (box := pair.right or pair.left) is not None
    }


def test_mission_compared_with_itself_has_no_difference() -> None:
    comparison = compare(drawn(BEFORE), drawn(BEFORE))
    assert {pair.change for pair in comparison.root.walk()} == {"same"}
    assert comparison.summary == "no difference"


def test_lines_of_the_file_do_not_count() -> None:
    comparison = compare(drawn(BEFORE), drawn(f"\n  # a note\n\n{BEFORE}"))
    assert comparison.left.root.line != comparison.right.root.line
    assert told(comparison) == {}


def test_a_changed_threshold_is_named_with_both_values() -> None:
    after = drawn(BEFORE.replace("scans: 2", "scans: 3").replace("5 s", "8 s"))
    assert told(compare(drawn(BEFORE), after)) == {"find_face": ("changed", "scans: 2 -> 3\ntimeout: 5 s -> 8 s")}


def test_added_or_removed_argument_is_named() -> None:
    after = drawn(BEFORE.replace(", scans: 2", ", new: true"))
    (change,) = told(compare(drawn(BEFORE), after)).values()
    assert change == ("changed", "- scans: 2\n+ new: true")


def test_order_counts_for_modifiers_but_not_for_arguments() -> None:
    one = drawn("\n  drive: {distance: 1 m, speed: 0.2 m/s}\n  timeout: 5 s\n  retry: 2\n")
    assert told(compare(one, drawn("\n  drive: {speed: 0.2 m/s, distance: 1 m}\n  timeout: 5 s\n  retry: 2\n"))) == {}
    other = drawn("\n  drive: {distance: 1 m, speed: 0.2 m/s}\n  retry: 2\n  timeout: 5 s\n")
    assert told(compare(one, other)) == {"drive": ("changed", "modifiers in another order")}


def test_added_modifier_is_a_change_of_its_node() -> None:
    after = drawn(BEFORE.replace("- drive: 1 m", "- drive: 1 m\n      timeout: 9 s"))
    assert told(compare(drawn(BEFORE), after)) == {"drive: 1 m": ("changed", "+ timeout: 9 s")}


def test_added_or_removed_node_does_not_affect_its_siblings() -> None:
    after = drawn(BEFORE.replace("        - say: Hello\n", "        - say: Good morning\n        - say: Hello\n"))
    assert told(compare(drawn(BEFORE), after)) == {"say: Good morning": ("added", "")}
    assert told(compare(after, drawn(BEFORE))) == {"say: Good morning": ("removed", "")}


def test_all_nodes_below_a_removed_node_are_removed() -> None:
    comparison = compare(drawn(BEFORE), drawn("\n  sequence:\n    - drive: 1 m\n"))
    assert [comparison.count(change) for change in ("same", "changed", "added", "removed")] == [2, 0, 0, 4]
    assert comparison.summary == "4 removed"


def test_nodes_with_another_name_or_argument_are_matched() -> None:
    after = drawn(BEFORE.replace("- drive: 1 m", "- drive: 2 m\n      name: go"))
    assert told(compare(drawn(BEFORE), after)) == {"drive: go": ("changed", "distance: 1 m -> 2 m\n+ name: go")}


def test_roots_of_different_kinds_belong_together() -> None:
    comparison = compare(drawn(BEFORE), drawn(BEFORE.replace("sequence", "random_sequence", 1)))
    assert told(comparison) == {"random_sequence": ("changed", "kind: sequence -> random_sequence")}


@settings(max_examples=15)
@given(DRAWINGS, DRAWINGS)
def test_every_node_is_in_one_pair_in_its_order(left: TreeDrawing, right: TreeDrawing) -> None:
    pairs = list(compare(left, right).root.walk())
    assert sorted(pair.left.key for pair in pairs if pair.left) == sorted(box.key for box in left.root.walk())
    assert sorted(pair.right.key for pair in pairs if pair.right) == sorted(box.key for box in right.root.walk())
    for pair in pairs:
        for box, inner in (
            (pair.left, [each.left for each in pair.children]),
            (pair.right, [each.right for each in pair.children]),
        ):
            assert tuple(each for each in inner if each) == (box.children if box else ())


@settings(max_examples=20)
@given(DRAWINGS)
def test_drawing_compared_with_itself_has_no_difference(drawing: TreeDrawing) -> None:
    assert compare(drawing, drawing).summary == "no difference"


@pytest.mark.parametrize("width", [40, 80, 121])
def test_two_columns_are_as_wide_as_the_terminal(width: int) -> None:
    comparison = compare(drawn(BEFORE), drawn(BEFORE.replace("Who", "日本語 " * 30).replace("scans: 2", "scans: 3")))
    lines = side_by_side(comparison, width).splitlines()
    assert all(cell_len(line) <= width for line in lines)
    signs = Counter(line[(width - 3) // 2 + 1] for line in lines if cell_len(line) > width // 2)
    assert signs["="] == 4
    assert signs["≠"] == 2
    what = "".join(line[(width - 3) // 2 + 3 :].strip() for line in lines if line.startswith(" " * (width // 2)))
    assert "scans:2->3" in what.replace(" ", "")
    assert what.count("日") == 30  # what has changed is never cut
    assert lines[-1] == "2 changed"


def test_side_by_side_comparison_can_be_ascii_only() -> None:
    comparison = compare(drawn(BEFORE), drawn(BEFORE.replace("Who are you?", "x" * 200)))
    assert "≠" in side_by_side(comparison, 60)
    assert side_by_side(comparison, 60, ascii_only=True).isascii()


def test_a_comparison_as_json_names_nodes_by_their_keys() -> None:
    data = comparison_to_json(compare(drawn(BEFORE), drawn(BEFORE.replace("scans: 2", "scans: 3"))))
    pairs = data["pairs"]
    assert isinstance(pairs, dict)
    first = pairs["children"][0]
    assert (first["left"], first["right"], first["change"], first["what"]) == (
        "1.1.1",
        "1.1.1",
        "changed",
        ["scans: 2 -> 3"],
    )


def test_folded_mission_is_compared_without_its_hidden_nodes() -> None:
    patrol = drawing_of(load_mission("patrol"))
    comparison = compare(patrol, fold_missions(patrol, 0))
    inside = [box for mission in patrol.root.walk() if mission.mission for box in mission.walk() if box is not mission]
    assert comparison.count("removed") == len(inside) > 0
    assert comparison.count("changed") == 0
