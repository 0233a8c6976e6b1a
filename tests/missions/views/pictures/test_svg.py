"""SVG pictures: all that they must say, in the words and signs of a document that any program can read."""

import re
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given, settings

from missions.library.shipped import load_mission
from missions.plugins.pictures.compare import CHANGES, compare
from missions.plugins.pictures.svg import svg, svg_pair
from missions.trees.drawing import SIGNS, NodeState, Status, TreeBox, TreeDrawing
from missions.trees.drawing_builder import drawing_of, fold_missions, with_states
from tests.missions.views.pictures.drawn import DRAWINGS, HOSTILE, plan_of

NAME = "{http://www.w3.org/2000/svg}"


def parsed(picture: str) -> ET.Element:
    return ET.fromstring(picture)  # noqa: S314 - our own picture


def texts(picture: str, kind: str = "") -> list[str]:
    """The texts of a picture, or those of one class."""
    found = parsed(picture).iter(f"{NAME}text")
    return [each.text or "" for each in found if not kind or kind in each.attrib["class"].split()]


def standing(status: Status, *, children: tuple[TreeBox, ...] = ()) -> TreeDrawing:
    box = TreeBox("1", "say", "say", "■", "m.yaml", 7, "Hello", {"text": "Hello"}, status=status, children=children)
    return TreeDrawing("m", "", "m.yaml", box, time=1.0)


def test_card_shows_kind_arguments_modifiers_variable_and_line() -> None:
    plan = plan_of("\n  find_face: {pan: [-60 deg, 60 deg], scans: 2}\n  as: person\n  timeout: 5 s\n  retry: 3\n")
    picture = svg(drawing_of(plan))
    assert texts(picture, "kind") == ["find_face"]
    assert texts(picture, "argument") == ["pan: [-60 deg, 60 deg], scans: 2, as: person"]
    assert texts(picture, "badge") == ["retry 3", "timeout 5 s"]
    assert texts(picture, "line") == [":4"]
    assert texts(picture, "title") == ["m"]


def test_switch_case_is_drawn_on_the_line_to_its_node() -> None:
    tree = "\n  switch:\n    on: 1 + 1\n    cases: {2: {say: two}, 3: {say: three}}\n    default: {say: other}\n"
    assert texts(svg(drawing_of(plan_of(tree))), "case") == ["2", "3", "default"]


@pytest.mark.parametrize("status", list(SIGNS))
def test_each_status_has_its_own_sign_and_border(status: Status) -> None:
    picture = svg(standing(status))
    assert texts(picture, "sign") == [SIGNS[status]] * 2  # on the card and in the legend
    assert status in texts(picture, "within")
    borders = {}
    for each in SIGNS:
        rules = re.findall(rf"\.card(?:\.{each})? {{([^}}]*)}}", picture)
        borders[each] = re.sub(r"#\w+", "", "".join(re.findall(r"stroke-[^;]*", "".join(rules)))) + (
            "double" if 'class="inner"' in svg(standing(each)) else ""
        )
    assert len(set(borders.values())) == len(SIGNS), borders


def test_legend_has_the_status_of_a_skipped_modifier() -> None:
    drawing = drawing_of(plan_of("\n  say: Hello\n  if: 1 > 2\n"))
    picture = svg(with_states(drawing, {"1": NodeState("skipped", "not true: 1 > 2", 0.0)}, 1.0))
    assert texts(picture, "badge") == ["» if 1 > 2"]
    assert "skipped" in texts(picture, "within")


def test_a_mission_at_rest_has_no_signs_of_statuses() -> None:
    assert texts(svg(drawing_of(load_mission("greet"))), "sign") == []


def test_moment_shows_time_reason_and_start_of_each_status() -> None:
    drawing = drawing_of(load_mission("greet"))
    now = {
        "1": NodeState("running", "", 0.5),
        "1.1.1": NodeState("failure", "no face found", 3.0),
        "1.1": NodeState("failure", "", 3.0),
    }
    picture = svg(with_states(drawing, now, 3.25))
    assert texts(picture, "moment") == ["at 3.25 s"]
    assert texts(picture, "reason") == ["since 0.50 s", "no face found; since 3.00 s"]
    assert "✗ timeout ${patience}" in texts(picture, "badge")
    assert 'class="link failure"' in picture


def test_folded_mission_shows_the_number_of_hidden_nodes() -> None:
    (inner,) = (box for box in drawing_of(load_mission("patrol")).root.walk() if box.mission)
    hidden = sum(child.nodes for child in inner.children)
    assert hidden > 0
    assert texts(svg(fold_missions(drawing_of(load_mission("patrol")), 0)), "folded") == [f"{hidden} more inside"]


def test_text_too_long_for_a_card_is_in_its_tooltip() -> None:
    said = "word " * 60
    box = TreeBox("1", "say", "say", "■", "m.yaml", 7, said.strip(), {"text": said.strip()})
    root = parsed(svg(TreeDrawing("m", "", "m.yaml", box)))
    assert any((each.text or "").endswith("…") for each in root.iter(f"{NAME}text"))
    assert any(said.strip() in (each.text or "") for each in root.iter(f"{NAME}title"))


def test_hostile_texts_stay_texts() -> None:
    box = TreeBox(
        "1", "say", HOSTILE, "■", "m.yaml", 7, HOSTILE, {HOSTILE: HOSTILE}, reason=f"{HOSTILE}\x00\x1b[31m\ud800"
    )
    root = parsed(svg(TreeDrawing(HOSTILE, HOSTILE, "m.yaml", replace(box, case=HOSTILE, keep_as=HOSTILE))))
    known = {"svg", "title", "style", "rect", "g", "text", "path", "circle"}
    assert {each.tag.removeprefix(NAME) for each in root.iter()} <= known


@settings(max_examples=25)
@given(DRAWINGS)
def test_every_drawing_is_a_document_of_whole_numbers(drawing: TreeDrawing) -> None:
    root = parsed(svg(drawing))
    for each in root.iter():
        for name in ("x", "y", "width", "height"):
            assert re.fullmatch(r"-?\d+", each.attrib.get(name, "0"))
    assert len([each for each in root.iter(f"{NAME}g") if "node" in each.get("class", "")]) == len(
        list(drawing.root.walk())
    )


def test_only_differences_are_marked_on_their_side() -> None:
    before = "\n  sequence:\n    - say: one\n    - drive: 1 m\n"
    after = "\n  sequence:\n    - drive: 2 m\n    - turn: 90 deg\n"
    picture = svg_pair(compare(drawing_of(plan_of(before)), drawing_of(plan_of(after))))
    assert sorted(texts(picture, "marked")) == sorted("-≠≠+")
    assert texts(picture, "change") == ["distance: 1 m -> 2 m"]
    assert set(texts(picture, "within")) == set(CHANGES)
    assert "1 changed, 1 added, 1 removed" in (parsed(picture).findtext(f"{NAME}title") or "")
