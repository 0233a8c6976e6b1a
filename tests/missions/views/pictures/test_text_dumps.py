"""The dumps that are text: py_trees' own as lines and as DOT, and Mermaid."""

import os
import re
import subprocess
import sys

import pydot
import pytest
from hypothesis import given, settings
from py_trees import display

from drivers.clock import ManualClock
from missions.library.shipped import load_mission, shipped_missions
from missions.trees.drawing import ASCII_SIGNS, SIGNS, NodeState, TreeDrawing, outline
from missions.trees.drawing_builder import drawing_of, fold_missions, with_states
from missions.trees.text import dot, mermaid, text_tree
from tests.cases import each
from tests.missions.views.pictures.drawn import DRAWINGS, HOSTILE, downwards, plan_of, ready

TREE = """\
  sequence:
    - wait: 1 s
    - drive: {distance: 1 m}
      as: way
      name: on
    - wait: 9 s
      timeout: 5 s
    - say: Hello
"""

STATES = {
    "1": NodeState("running", "", 0.0),
    "1.1": NodeState("success", "", 1.0),
    "1.2": NodeState("failure", "no base", 1.25),
    "1.3": NodeState("failure", "timed out", 6.0),
}

LINK = re.compile(r'  (\w+) --> (?:\|"[^"|]*"\| )?(\w+)')
BOX = re.compile(r'  (\w+)\["([^"]*)"\](?::::?(\w+))?')


def test_text_line_has_kind_name_arguments_variable_and_line() -> None:
    assert text_tree(plan_of(TREE)) == (
        "{-} sequence (line 3)\n"
        "    --> wait: 1 s (line 4)\n"
        "    --> drive: on {distance: 1 m} as way (line 5)\n"
        "    -^- timeout: 5 s (line 9)\n"
        "        --> wait: 9 s (line 8)\n"
        "    --> say: Hello (line 10)\n"
    )


def test_text_tree_of_a_moment_has_signs_and_reasons() -> None:
    assert text_tree(plan_of(TREE), STATES) == (
        "{-} ▶ sequence (line 3) since 0.00 s\n"
        "    --> ✓ wait: 1 s (line 4) since 1.00 s\n"
        "    --> ✗ drive: on {distance: 1 m} as way (line 5) since 1.25 s -- no base\n"
        "    -^- ✗ timeout: 5 s (line 9) -- timed out\n"
        "        --> ○ wait: 9 s (line 8)\n"
        "    --> ○ say: Hello (line 10)\n"
    )


def test_outline_has_modifiers_above_their_node() -> None:
    assert outline(drawing_of(plan_of(TREE))) == (
        "→ sequence (line 3)\n"
        "├─ ■ wait: 1 s (line 4)\n"
        "├─ ■ drive: on {distance: 1 m} as way (line 5)\n"
        "├─ [timeout: 5 s] (line 9)\n"
        "│  ■ wait: 9 s (line 8)\n"
        "└─ ■ say: Hello (line 10)\n"
    )


def test_outline_of_a_moment_has_time_and_statuses() -> None:
    assert outline(with_states(drawing_of(plan_of(TREE)), STATES, 6.0)) == (
        "m at 6.00 s\n"
        "→ ▶ sequence (line 3) since 0.00 s\n"
        "├─ ■ ✓ wait: 1 s (line 4) since 1.00 s\n"
        "├─ ■ ✗ drive: on {distance: 1 m} as way (line 5) since 1.25 s -- no base\n"
        "├─ [✗ timeout: 5 s] (line 9) -- timed out\n"
        "│  ■ ○ wait: 9 s (line 8)\n"
        "└─ ■ ○ say: Hello (line 10)\n"
    )


@settings(deadline=None, max_examples=40)
@given(DRAWINGS)
def test_an_outline_has_a_line_for_each_node_and_modifier(drawing: TreeDrawing) -> None:
    shown = sum(1 + len(box.badges) for box in drawing.root.walk())
    assert len(outline(drawing).split("\n")) == shown + (drawing.time is not None) + 1
    hidden = sum(box.folded for box in drawing.root.walk())
    assert drawing.root.nodes == shown + hidden


def test_ascii_output_is_ascii_for_any_mission() -> None:
    drawn = text_tree(plan_of("  say: Grüß dich ✓\n"), {"1": NodeState("success", "", 1.0)}, ascii=True)
    assert drawn == "--> + say: Gr?? dich ? (line 3) since 1.00 s\n"


def test_drawing_and_plan_have_the_same_dumps() -> None:
    plan = plan_of(TREE)
    drawing = with_states(drawing_of(plan), STATES, 6.0)
    assert text_tree(drawing) == text_tree(plan, STATES)
    assert dot(drawing) == dot(plan, STATES)


def test_folded_submission_shows_the_number_of_hidden_nodes() -> None:
    dumped = text_tree(fold_missions(drawing_of(load_mission("follow_me")), 0))
    assert "mission: find_person {patience: ${patience}} (line 14) and 8 more below\n" in dumped
    assert "find_face" not in dumped


def test_the_children_of_a_switch_begin_with_their_case() -> None:
    head = "params: {answer: {default: x, type: text}}\n"
    tree = "  switch:\n    on: answer\n    cases:\n      yes: {drive: 1 m, retry: 2}\n    default: {wait: 2 s}\n"
    plan = plan_of(tree, head)
    assert outline(drawing_of(plan)).splitlines()[1:] == [
        "├─ yes: [retry: 2] (line 7)",
        "│  ■ drive: 1 m (line 7)",
        "└─ default: ■ wait: 2 s (line 8)",
    ]
    assert [line.strip() for line in text_tree(plan).splitlines()][1:] == [
        "-^- yes: retry: 2 (line 7)",
        "--> drive: 1 m (line 7)",
        "--> default: wait: 2 s (line 8)",
    ]
    assert '|"yes"| n1_1_1' in mermaid(drawing_of(plan))


@each("name", shipped_missions())
def test_drawing_counts_nodes_like_the_checker(name: str) -> None:
    plan = load_mission(name)
    drawing = drawing_of(plan)
    assert drawing.root.nodes == fold_missions(drawing, 0).root.nodes == sum(1 for _ in plan.tree.walk())


@each("name", shipped_missions())
def test_text_tree_lines_match_those_of_py_trees(name: str) -> None:
    plan = load_mission(name)
    root, _ = ready(plan, ManualClock())
    for node in downwards(root):
        node.name = "x"
    shapes = [line.removesuffix(" x") for line in display.unicode_tree(root).splitlines()]
    lines = text_tree(plan).splitlines()
    assert len(lines) == len(shapes)
    assert all(line.startswith(f"{shape} ") for line, shape in zip(lines, shapes, strict=True))


def test_dumps_are_the_same_bytes_under_every_encoding_of_the_terminal() -> None:
    program = (
        "import sys; from missions.library.shipped import load_mission\n"
        "from missions.trees.text import dot, text_tree\n"
        "from missions.trees.states import NodeState\n"
        "plan = load_mission('patrol')\n"
        "now = {'1': NodeState('running', '', 0.0), '1.1': NodeState('failure', 'é', 1.0)}\n"
        "for drawn in (text_tree(plan, now), text_tree(plan, now, ascii=True), dot(plan, now), dot(plan)):\n"
        "    sys.stdout.buffer.write(drawn.encode('utf-8'))\n"
    )
    plain = {name: value for name, value in os.environ.items() if not name.startswith(("LC_", "LANG", "PYTHON"))}
    outputs = {
        subprocess.run([sys.executable, "-c", program], env=plain | setting, capture_output=True, check=True).stdout
        for setting in ({"PYTHONIOENCODING": "utf-8"}, {"PYTHONIOENCODING": "latin-1"}, {"PYTHONIOENCODING": "ascii"})
    }
    assert len(outputs) == 1
    assert "▶".encode() in outputs.pop()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of pyparsing, in pydot's parser
def test_dot_uses_keys_as_node_names_and_keeps_texts() -> None:
    quoted = HOSTILE.replace("'", "''")
    plan = plan_of(f"  sequence:\n    - say: '{quoted}'\n    - say: '{quoted}'\n")
    (graph,) = pydot.graph_from_dot_data(dot(plan)) or []
    labels = {node.get_name(): node.get("label") for node in graph.get_nodes() if node.get("label")}
    written = HOSTILE.replace("\\", "\\\\").replace('"', '\\"')
    assert labels == {
        "n1": '"sequence\\n(line 3)"',
        "n1_1": f'"say: {written}\\n(line 4)"',
        "n1_2": f'"say: {written}\\n(line 5)"',
    }
    assert [(edge.get_source(), edge.get_destination()) for edge in graph.get_edges()] == [
        ("n1", "n1_1"),
        ("n1", "n1_2"),
    ]


@settings(deadline=None, max_examples=40)
@given(DRAWINGS)
def test_mermaid_has_one_line_for_each_box_and_each_link(drawing: TreeDrawing) -> None:
    lines = mermaid(with_states(drawing, {}, 1.0)).splitlines()
    drawn = list(drawing.root.walk())
    assert len([line for line in lines if LINK.fullmatch(line)]) == len(drawn) - 1
    found = [match for line in lines if (match := BOX.fullmatch(line))]
    assert len({match[1] for match in found}) == len(drawn)


def test_mermaid_draws_modifiers_in_the_box_with_the_outer_status() -> None:
    drawing = with_states(drawing_of(plan_of(TREE)), STATES, 6.0)
    assert mermaid(drawing).splitlines()[5:] == [
        '  n1["→ ▶ sequence<br/>(line 3)<br/>since 0.00 s"]:::running',
        '  n1_1["■ ✓ wait: 1 s<br/>(line 4)<br/>since 1.00 s"]:::success',
        '  n1_2["■ ✗ drive: on<br/>{distance: 1 m}<br/>as way<br/>(line 5)<br/>since 1.25 s<br/>-- no base"]:::failure',
        '  n1_3_1["✗ timeout: 5 s (line 9) -- timed out<br/>■ ○ wait: 9 s<br/>(line 8)"]:::failure',
        '  n1_4["■ ○ say: Hello<br/>(line 10)"]:::idle',
        "  n1 --> n1_1",
        "  n1 --> n1_2",
        "  n1 --> n1_3_1",
        "  n1 --> n1_4",
    ]


def test_mermaid_takes_no_text_for_markup() -> None:
    quoted = HOSTILE.replace("'", "''")
    (line,) = [line for line in mermaid(drawing_of(plan_of(f"  say: '{quoted}'\n"))).splitlines() if "say" in line]
    inside = line.removeprefix('  n1["').removesuffix('"]').replace("<br/>", "")
    assert not set('"<>&`|\\') & set(inside)
    assert re.sub(r"#(\d+);", lambda code: chr(int(code[1])), inside) == f"■ say: {HOSTILE}(line 3)"


@each("status", SIGNS)
def test_dumps_mark_statuses_by_signs_as_well_as_colours(status: str) -> None:
    (known,) = [each for each in SIGNS if each == status]
    plan, now = plan_of("  wait: 1 s\n"), {"1": NodeState(known, "", 1.0)}
    drawing = with_states(drawing_of(plan), now, 1.0)
    for drawn in (outline(drawing), text_tree(plan, now), dot(plan, now), mermaid(drawing)):
        assert [sign for sign in SIGNS.values() if sign in drawn.replace("-->", "")] == [SIGNS[known]]
    assert f"--> {ASCII_SIGNS[known]} wait" in text_tree(plan, now, ascii=True)
