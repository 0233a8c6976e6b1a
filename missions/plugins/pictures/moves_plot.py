"""Plots of movements: goals and measured angles of each joint over time. Needs the extra ``plots``."""

from collections.abc import Mapping, Sequence
from math import ceil, degrees
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from config.file_io import replace_file
from drivers.api import JointLimits


def save_figure(figure: "Figure", path: Path, dpi: int, mode: int | None = None) -> Path:
    """Write a figure atomically, in the format of the file's suffix; return its path.

    ``mode`` are the permission bits of the file. Raises OSError; ValueError for a suffix that Matplotlib does not
    support.
    """
    with replace_file(path, mode) as file:
        figure.savefig(file, dpi=dpi, format=path.suffix.removeprefix(".") or "png")
    return path


FORMATS = (".png", ".svg")
"""Suffixes of the supported picture formats."""

GOAL_COLOUR, MEASURED_COLOUR, LIMIT_COLOUR = "#2a78b5", "#c8553d", "#8a8f98"
"""Colours of goals, measured angles, and limits."""

MAX_COLUMNS = 2
"""Maximum number of joints whose panels stand side by side in a plot."""


def draw_move(
    path: Path,
    title: str,
    goals: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    limits: Mapping[str, JointLimits],
    *,
    measured: Mapping[str, tuple[Sequence[float], Sequence[float]]] | None = None,
) -> None:
    """Draw a picture to ``path`` with a panel for each joint: its goals, limits, and ``measured`` angles if given.

    ``goals`` and ``measured`` hold for each joint its times (s) and its angles (rad). Raises ValueError for an
    unsupported format, OSError if the file cannot be written.
    """
    if path.suffix not in FORMATS:
        raise ValueError(f"{path}: a picture ends in {' or '.join(FORMATS)}")
    columns = min(MAX_COLUMNS, len(goals))
    rows = ceil(len(goals) / columns)
    figure = Figure(figsize=(6.0 * columns, 0.8 + 2.2 * rows), layout="constrained")
    FigureCanvasAgg(figure)  # its own canvas, without a window or global state
    figure.suptitle(title)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True)
    for axes, (joint, (times, angles)) in zip(grid.flat, goals.items(), strict=False):
        axes.plot(times, [degrees(angle) for angle in angles], color=GOAL_COLOUR, linewidth=1.4, label="goal")
        if measured is not None and joint in measured:
            when, where = measured[joint]
            axes.plot(when, [degrees(angle) for angle in where], color=MEASURED_COLOUR, linewidth=1.0, label="measured")
        if joint in limits:
            _draw_limits(axes, limits[joint])
        axes.set_title(joint, fontsize=10)
        axes.set_ylabel("deg")
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color=LIMIT_COLOUR, alpha=0.25)
    for axes in list(grid.flat)[len(goals) :]:
        axes.set_axis_off()
    for axes in grid[-1]:
        axes.set_xlabel("s")
    entries = {
        label: handle for axes in grid.flat for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=len(entries), frameon=False)
    save_figure(figure, path, 90)


def _draw_limits(axes: Axes, limits: JointLimits) -> None:
    """Draw the limits of a joint that are close to its motion."""
    low, high = axes.get_ylim()
    margin = max(5.0, 0.25 * (high - low))
    near = [degrees(end) for end in (limits.lower, limits.upper) if low - margin <= degrees(end) <= high + margin]
    for number, end in enumerate(near):
        axes.axhline(end, color=LIMIT_COLOUR, linestyle=":", linewidth=1.0, label="limit" if number == 0 else None)
