"""Plot of a sweep: success over each varied parameter, times, and causes. Needs the extra ``plots``."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from textwrap import fill

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from missions.plugins.pictures.moves_plot import save_figure
from missions.plugins.testing.sweep.report import interval, percent
from missions.plugins.testing.sweep.summary import Bin, Summary
from missions.plugins.testing.sweep.variation import SweepRow

SUCCESS_COLOUR, FAILURE_COLOUR, MUTED_COLOUR = "#2a78b5", "#c8553d", "#8a8f98"
"""Colours of success, of failure, and of secondary elements."""

MAX_COLUMNS = 3
MAX_CAUSES = 6


def draw_sweep(path: Path, title: str, summary: Summary, rows: Sequence[SweepRow]) -> None:
    """Draw the results of a sweep as a PNG. Raises OSError if the file cannot be written."""
    panels = len(summary.bins) + 1 + bool(summary.causes)
    height = ceil(panels / MAX_COLUMNS)
    figure = Figure(figsize=(4.6 * min(MAX_COLUMNS, panels), 0.9 + 3.3 * height), layout="constrained")
    FigureCanvasAgg(figure)  # its own canvas, without a window or global state
    rate = summary.rate
    figure.suptitle(f"{title}: {percent(rate.share)} of {rate.runs} runs succeed (95 % interval {interval(rate)})")
    axes = iter(figure.subplots(height, min(MAX_COLUMNS, panels), squeeze=False).flat)
    for name, bins in summary.bins.items():
        _draw_success(next(axes), name, bins)
    _draw_times(next(axes), [row.seconds for row in rows if row.result == "success"])
    if summary.causes:
        _draw_causes(next(axes), summary)
    for unused in axes:
        unused.set_axis_off()
    save_figure(figure, path, 110)


def _draw_success(axes: Axes, name: str, bins: Sequence[Bin]) -> None:
    bins = [each for each in bins if each.rate.runs]
    middles = [(each.low + each.high) / 2 for each in bins]
    shares = [100 * each.rate.share for each in bins]
    low, high = zip(*((100 * bound for bound in each.rate.interval) for each in bins), strict=True)
    below = [share - bound for share, bound in zip(shares, low, strict=True)]
    above = [bound - share for share, bound in zip(shares, high, strict=True)]
    axes.bar(middles, shares, [0.9 * (each.high - each.low) for each in bins], color=SUCCESS_COLOUR, alpha=0.35)
    axes.errorbar(
        middles,
        shares,
        yerr=[below, above],
        fmt="o",
        color=SUCCESS_COLOUR,
        ecolor=SUCCESS_COLOUR,
        capsize=3,
        markersize=4,
    )
    axes.set(ylim=(0, 105), xlabel=name, ylabel="success (%)")
    if all(each.high - each.low == 1 and " to " not in each.label for each in bins):
        axes.set_xticks(middles, [each.label for each in bins])
    _simplify_axes(axes)


def _draw_times(axes: Axes, seconds: Sequence[float]) -> None:
    axes.hist(seconds, bins=30, color=SUCCESS_COLOUR)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set(xlabel="simulated time of the successes (s)", ylabel="runs", xlim=(0, None))
    _simplify_axes(axes)


def _draw_causes(axes: Axes, summary: Summary) -> None:
    causes = summary.causes[:MAX_CAUSES]
    places = range(len(causes))
    axes.barh(places, [cause.runs for cause in causes], 0.6, color=FAILURE_COLOUR)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_yticks(places, [fill(cause.text, 40, max_lines=3) for cause in causes], fontsize=8)
    axes.set(ylim=(max(2.5, len(causes) - 0.5), -0.5), xlabel="failed runs by cause")
    _simplify_axes(axes, along="x")


def _simplify_axes(axes: Axes, along: str = "y") -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="x" if along == "x" else "y", color=MUTED_COLOUR, alpha=0.25)
    axes.set_axisbelow(True)
