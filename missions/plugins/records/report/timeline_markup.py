"""The timeline as an HTML table: a row per leaf with its bars and total running time."""

from collections.abc import Iterator, Sequence

from missions.plugins.pictures.page.document import Markup, tag
from missions.plugins.records.report.chart import percent_along, time_axis
from missions.plugins.records.report.slider import SliderTimes
from missions.plugins.records.report.timeline import Bar, Lane, count_outcomes, merge_bars
from missions.trees.drawing import SIGNS, Status
from missions.trees.value_text import count_text, seconds_text

OUTCOME_LABELS = {
    "idle": "interrupted",
    "running": "still running",
    "suspended": "suspended",
    "success": "success",
    "skipped": "skipped",
    "failure": "failure",
}
"""Label of a timeline bar by its outcome."""

SIGN_WIDTH = 0.028
"""Width of the sign of an outcome as a share of the timeline; overlapping signs are left out."""


def timeline_markup(lanes: Sequence[Lane], slider: SliderTimes) -> Markup:
    """Return the timeline as an HTML table."""
    head = tag(
        "tr",
        tag("th", "Node", scope="col"),
        tag("td", time_axis(slider), class_="bars"),
        tag("th", "Total", scope="col", class_="total"),
    )
    rows = [_row(lane, slider) for lane in lanes]
    return tag("table", tag("thead", head), tag("tbody", *rows), class_="timeline")


def _row(lane: Lane, slider: SliderTimes) -> Markup:
    box = lane.box
    ended = ", ".join(f"{count} {OUTCOME_LABELS[status]}" for status, count in count_outcomes(lane.bars).items())
    label = f"{box.title}: {count_text(len(lane.bars), 'time')}, {seconds_text(lane.busy_seconds)} in total; {ended}"
    svg = tag("svg", *_bar_markup(lane.bars, slider), role="img", aria_label=label)
    within = tag("small", f"in {lane.submission}") if lane.submission else ""
    name = tag("button", box.title, type="button", data_node=box.key, title=f"{box.file}:{box.line}", class_="link")
    return tag(
        "tr",
        tag("th", name, " ", within, scope="row"),
        tag("td", svg, class_="bars over-time"),
        tag("td", f"{lane.busy_seconds:.1f} s" if lane.busy_seconds else "", class_="total"),
        data_row=box.key,
    )


def _bar_markup(bars: Sequence[Bar], slider: SliderTimes) -> Iterator[Markup]:
    free = -1.0
    for bar in merge_bars(bars, slider.span):
        end = (bar.end - slider.start) / slider.span
        width = f"{100 * (bar.end - bar.start) / slider.span:.3f}%"
        what = f"{count_text(bar.count, 'time')}, " if bar.count > 1 else ""
        time = (
            seconds_text(bar.start) if bar.end == bar.start else f"{seconds_text(bar.start)} to {seconds_text(bar.end)}"
        )
        why = f": {bar.reason}" if bar.reason else ""
        yield tag(
            "g",
            tag("title", f"{time}, {what}{OUTCOME_LABELS[bar.outcome]}{why}"),
            tag("rect", x=percent_along(bar.start, slider), width=width, y=7, height=10, rx=2),
            tag("line", x1=percent_along(bar.end, slider), x2=percent_along(bar.end, slider), y1=5, y2=19),
            class_=bar.outcome,
        )
        if end - free > SIGN_WIDTH and (sign := _end_sign(bar.outcome)):
            free = end
            yield tag("text", sign, x=percent_along(bar.end, slider), y=16, dx=4, class_=bar.outcome)


def _end_sign(outcome: Status) -> str:
    """Return the sign at the end of a timeline bar: for success and failure, else empty."""
    return SIGNS[outcome] if outcome in ("success", "failure") else ""
