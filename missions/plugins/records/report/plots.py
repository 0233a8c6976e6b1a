"""Charts, path and timeline of a record as PNG files at 300 dpi. Needs the extra ``plots``."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from config.file_io import PRIVATE_MODE
from missions.plugins.pictures.moves_plot import save_figure
from missions.plugins.records.report.summary import RecordStudy
from missions.plugins.records.report.timeline import Lane
from missions.plugins.records.report.traces import MIN_ROUTE_LENGTH, BaseRoute, Chart, ChartLine, split_at_gaps
from missions.trees.drawing import Status

DPI = 300

FIGURE_WIDTH = 6.3
"""Width of a plot in inches: the text width of an A4 page."""

REQUESTED_COLOUR, MEASURED_COLOUR, GRID_COLOUR = "#b3400a", "#0067a8", "#8a8f98"

BAR_STYLES: dict[Status, tuple[str, str]] = {
    "success": ("#00735a", ""),
    "failure": ("#b3400a", "////"),
    "running": ("#0067a8", "...."),
    "suspended": ("#7a5200", "----"),
    "skipped": ("#56616d", ""),
    "idle": ("#8a8f98", "\\\\\\\\"),
}
"""Colour and hatching of a timeline bar by outcome, also readable in black and white."""

OUTCOME_LABELS: dict[Status, str] = {
    "success": "success",
    "failure": "failure",
    "running": "running",
    "suspended": "suspended",
    "skipped": "skipped",
    "idle": "interrupted",
}

MAX_NAME_LENGTH = 34
"""Maximum number of characters of a node name in a plot."""


def draw_plots(study: RecordStudy, folder: Path) -> Iterator[Path]:
    """Draw all plots into a folder, and yield their paths. Raises OSError."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    begin, end = study.slider.start, study.slider.start + study.slider.span
    for chart in (*study.charts, *study.joint_charts):
        figure, axes = _new_figure(2.2)
        _draw_chart(axes, chart, begin, end)
        yield _save_plot(figure, folder / f"{chart.key}.png")
    if study.route.length > MIN_ROUTE_LENGTH:
        figure, axes = _new_figure(4.0)
        _draw_route(axes, study.route)
        yield _save_plot(figure, folder / "route.png")
    if study.lanes:
        figure, axes = _new_figure(0.9 + 0.24 * len(study.lanes))
        _draw_timeline(axes, study.lanes, begin, end)
        yield _save_plot(figure, folder / "timeline.png")


def _draw_chart(axes: Axes, chart: Chart, begin: float, end: float) -> None:
    for line in chart.lines:
        _draw_line(axes, line)
    title = chart.title.partition(",")[0].replace("$", r"\$")
    axes.set(xlabel="time (s)", ylabel=f"{title}\n({chart.unit})", xlim=(begin, end))
    if len(chart.lines) > 1:
        axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(chart.lines), borderpad=0.0)
    _simplify_axes(axes)


def _draw_line(axes: Axes, line: ChartLine) -> None:
    colour, style = (REQUESTED_COLOUR, (0, (4, 2))) if line.requested else (MEASURED_COLOUR, "-")
    for number, stretch in enumerate(split_at_gaps(line.points)):
        times, values = zip(*stretch, strict=True)
        label = "_" if number else line.name
        marker = "." if len(stretch) == 1 else ""
        axes.plot(times, values, color=colour, linestyle=style, marker=marker, linewidth=1.2, label=label)


def _draw_route(axes: Axes, route: BaseRoute) -> None:
    """Draw the path of the base, with the initial heading up."""
    xs, ys, _ = zip(*route.poses, strict=True)
    axes.plot(ys, xs, color=MEASURED_COLOUR, linewidth=1.2)
    axes.plot(ys[0], xs[0], "o", color="black", markerfacecolor="white", label="start")
    axes.plot(ys[-1], xs[-1], "s", color=REQUESTED_COLOUR, label="end")
    axes.set(xlabel="y (m), left is +", ylabel="x (m), ahead is +", aspect="equal")
    axes.margins(0.1)
    axes.set_adjustable("datalim")
    axes.invert_xaxis()
    axes.legend(frameon=False)
    _simplify_axes(axes)


def _draw_timeline(axes: Axes, lanes: Sequence[Lane], begin: float, end: float) -> None:
    named: set[Status] = set()
    for row, lane in enumerate(lanes):
        for bar in lane.bars:
            colour, hatch = BAR_STYLES[bar.outcome]
            width = max(bar.end - bar.start, (end - begin) / 400)
            label = "_" if bar.outcome in named else OUTCOME_LABELS[bar.outcome]
            named.add(bar.outcome)
            axes.barh(
                row, width, 0.6, left=bar.start, facecolor=f"{colour}40", edgecolor=colour, hatch=hatch, label=label
            )
    titles = [lane.box.title for lane in lanes]
    short = [title if len(title) <= MAX_NAME_LENGTH else f"{title[: MAX_NAME_LENGTH - 1]}…" for title in titles]
    axes.set_yticks(range(len(lanes)), [text.replace("$", r"\$") for text in short])
    axes.set(xlabel="time (s)", xlim=(begin, end), ylim=(len(lanes) - 0.5, -0.5))
    axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(named), borderpad=0.0)
    _simplify_axes(axes)


def _new_figure(height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(FIGURE_WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)  # an own canvas avoids a window and pyplot's global state
    return figure, figure.subplots()


def _simplify_axes(axes: Axes) -> None:
    """Remove the upper and right frame lines of a plot, and add a light grid."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="both", color=GRID_COLOUR, alpha=0.25)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)


def _save_plot(figure: Figure, path: Path) -> Path:
    return save_figure(figure, path, DPI, PRIVATE_MODE)
