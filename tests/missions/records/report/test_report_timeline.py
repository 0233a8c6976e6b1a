"""The timeline: bars from the changes of nodes, and as many as can be told apart."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from missions.executive.events import NodeChanged
from missions.plugins.records.report.summary import RecordStudy
from missions.plugins.records.report.timeline import MAX_BARS, Bar, count_outcomes, leaf_lanes, merge_bars
from missions.trees.drawing import TreeBox, TreeDrawing

LEAF = TreeDrawing("m", "", "m.yaml", TreeBox("1", "drive", "drive", "■", "m.yaml", 1))


def bars(*changes: tuple[float, str], end: float = 10.0) -> list[tuple[float, float, str]]:
    told = [NodeChanged(t, 1, "1", "drive", "drive", 1, status, "") for t, status in changes]
    return [
        (bar.start, bar.end, bar.outcome)
        for lane in leaf_lanes(LEAF, told, {change.node: change for change in told}, end)
        for bar in lane.bars
    ]


def test_bar_spans_from_first_tick_to_result() -> None:
    assert bars((1.0, "running"), (3.0, "success")) == [(1.0, 3.0, "success")]


def test_instant_result_is_a_bar_without_length() -> None:
    assert bars((1.0, "failure"), (1.0, "idle"), (2.0, "success")) == [(1.0, 1.0, "failure"), (2.0, 2.0, "success")]


def test_interrupted_bar_ends_idle_and_running_bar_ends_with_the_record() -> None:
    assert bars((1.0, "running"), (2.0, "idle"), (3.0, "running")) == [(1.0, 2.0, "idle"), (3.0, 10.0, "running")]


def test_new_feedback_does_not_begin_another_bar() -> None:
    assert bars((1.0, "running"), (2.0, "running"), (3.0, "success")) == [(1.0, 3.0, "success")]


def test_lanes_are_ticked_leaves_with_their_submission(found: RecordStudy) -> None:
    assert [(lane.box.kind, lane.submission, lane.busy_seconds) for lane in found.lanes] == [
        ("track_face", "", 2.9),
        ("say", "", 1.0),
        ("drive", "go", 1.0),
    ]


def test_indistinguishable_bars_are_merged_and_failure_wins() -> None:
    many = [Bar(t / 1000, t / 1000, "failure" if t == 3 else "success", f"at {t}") for t in range(5)]
    assert merge_bars(many, 100.0) == [Bar(0.0, 0.004, "failure", "at 3", 5)]
    assert merge_bars(many, 0.1) == many


spans = st.lists(st.tuples(st.floats(0, 50), st.floats(0, 5), st.sampled_from(["success", "failure"])), max_size=300)


@given(spans)
def test_thinned_bars_stay_in_order_cover_all_and_are_few(drawn: list[tuple[float, float, str]]) -> None:
    whole, time = [], 0.0
    for gap, length, outcome in drawn:
        start = time + gap
        time = start + length
        whole.append(Bar(start, time, "success" if outcome == "success" else "failure"))
    thin = merge_bars(whole, max(time, 1.0))
    assert sum(bar.count for bar in thin) == len(whole)
    assert len(thin) <= 2 * MAX_BARS + 2
    assert all(one.end <= other.start for one, other in pairwise(thin))
    failed = count_outcomes(whole).get("failure", 0)
    assert (count_outcomes(thin).get("failure", 0) > 0) == (failed > 0)
