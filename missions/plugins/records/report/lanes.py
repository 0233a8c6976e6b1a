"""The timeline as a table: a row for each leaf with its bars, and how long it was at work in all."""

from collections.abc import Iterator, Sequence

from missions.plugins.pictures.page.document import Markup, tag
from missions.plugins.records.report.chart import share, time_axis
from missions.plugins.records.report.slider import Moments
from missions.plugins.records.report.timeline import Bar, Lane, outcomes, thinned
from missions.trees.drawing import SIGNS, Status
from missions.trees.words import counted, in_seconds

WORDS = {
    "idle": "interrupted",
    "running": "still at work",
    "suspended": "suspended",
    "success": "success",
    "skipped": "skipped",
    "failure": "failure",
}
"""What the end of a bar is called."""

ROOM = 0.028
"""What a sign takes of the width of the timeline; one that would stand on another is left out."""


def timeline(lanes: Sequence[Lane], moments: Moments) -> Markup:
    """Return the timeline."""
    head = tag(
        "tr",
        tag("th", "Node", scope="col"),
        tag("td", time_axis(moments), class_="bars"),
        tag("th", "In all", scope="col", class_="total"),
    )
    rows = [_row(lane, moments) for lane in lanes]
    return tag("table", tag("thead", head), tag("tbody", *rows), class_="timeline")


def _row(lane: Lane, moments: Moments) -> Markup:
    box = lane.box
    ended = ", ".join(f"{count} {WORDS[status]}" for status, count in outcomes(lane.bars).items())
    told = f"{box.title}: {counted(len(lane.bars), 'time')}, {in_seconds(lane.busy)} in all; {ended}"
    svg = tag("svg", *_marks(lane.bars, moments), role="img", aria_label=told)
    within = tag("small", f"in {lane.within}") if lane.within else ""
    name = tag("button", box.title, type="button", data_node=box.key, title=f"{box.file}:{box.line}", class_="link")
    return tag(
        "tr",
        tag("th", name, " ", within, scope="row"),
        tag("td", svg, class_="bars over-time"),
        tag("td", f"{lane.busy:.1f} s" if lane.busy else "", class_="total"),
        data_row=box.key,
    )


def _marks(bars: Sequence[Bar], moments: Moments) -> Iterator[Markup]:
    free = -1.0
    for bar in thinned(bars, moments.span):
        end = (bar.end - moments.begin) / moments.span
        width = f"{100 * (bar.end - bar.start) / moments.span:.3f}%"
        what = f"{counted(bar.count, 'time')}, " if bar.count > 1 else ""
        time = in_seconds(bar.start) if bar.end == bar.start else f"{in_seconds(bar.start)} to {in_seconds(bar.end)}"
        why = f": {bar.reason}" if bar.reason else ""
        yield tag(
            "g",
            tag("title", f"{time}, {what}{WORDS[bar.outcome]}{why}"),
            tag("rect", x=share(bar.start, moments), width=width, y=7, height=10, rx=2),
            tag("line", x1=share(bar.end, moments), x2=share(bar.end, moments), y1=5, y2=19),
            class_=bar.outcome,
        )
        if end - free > ROOM and (sign := _sign(bar.outcome)):
            free = end
            yield tag("text", sign, x=share(bar.end, moments), y=16, dx=4, class_=bar.outcome)


def _sign(outcome: Status) -> str:
    """Return the sign at the end of a bar: none where nobody knows how it would have ended."""
    return SIGNS[outcome] if outcome in ("success", "failure") else ""
