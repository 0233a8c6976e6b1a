"""Plots of controllers: terms, surfaces, and tracking errors. Needs the extra ``plots``."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import groupby
from math import degrees
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from behaviours.tracking.fuzzy import Controller, RuleBases, controllers
from behaviours.tracking.terms import FuzzySets, FuzzyVariable
from config.controller import ControllerConfig
from missions.plugins.pictures.moves_plot import save_figure
from missions.plugins.testing.controllers.bench import CENTRED_ERROR, OUTPUT_UNIT, UNITS, BenchRow
from missions.plugins.testing.controllers.tracking_trial import TrackingBody

MUTED_COLOUR = "#8a8f98"
"""Colour of axes and other secondary elements."""

COLOURS = ("#c8553d", "#d9a21b", "#6a9f58", "#2a78b5", "#7a5aa6", "#4a4f57")
"""Colours of the controllers in a plot, in order."""

MARGIN_SHARE = 0.12
"""Margin on each side of a plot of fuzzy terms, as a share of the range of the terms."""

CURVE_POINTS = 201
"""Number of points along a plotted curve."""

SURFACE_POINTS = 61
"""Number of points along each side of a plotted rule surface."""


def draw_controller(path: Path, config: ControllerConfig) -> None:
    """Draw the terms of each rule base and the surface of its rules as a PNG.

    Raises ValueError for an invalid controller, OSError if the picture cannot be written.
    """
    rules = RuleBases.from_mapping(config.values)
    fuzzy = controllers(config.values)
    names = [name for name in config.values if getattr(rules, name, None) not in (None, True, False)]
    figure = _make_figure((16.0, 0.7 + 3.2 * len(names)), f"{config.name}: {config.summary}")
    grid = figure.subplots(len(names), 4, squeeze=False)
    for row, name in zip(grid, names, strict=True):
        if name in fuzzy:
            _draw_rule_base(row, name, fuzzy[name])
        else:
            _draw_pd(row, name, rules, config)
    save_figure(figure, path, 100)


def draw_bench(path: Path, rows: Sequence[BenchRow]) -> None:
    """Draw the tracking error over time, a panel for each scenario and body. Raises OSError if it cannot be written."""
    names = list(dict.fromkeys(row.controller for row in rows))
    colours = dict(zip(names, COLOURS * len(names), strict=False))
    panels = [(key, list(found)) for key, found in groupby(rows, key=lambda row: (row.scenario, row.body))]
    bodies = list(dict.fromkeys(row.body for row in rows))
    height = -(-len(panels) // len(bodies))
    figure = _make_figure((5.0 * len(bodies), 0.9 + 2.7 * height), "Error of the face (degrees) over time (seconds)")
    grid = figure.subplots(height, len(bodies), squeeze=False, sharex=True)
    for axes, ((scenario, body), found) in zip(grid.flat, panels, strict=True):
        for row in found:
            errors = [degrees(error) for error in row.trace.errors]
            axes.plot(row.trace.times, errors, color=colours[row.controller], linewidth=1.1, label=row.controller)
        axes.axhspan(-degrees(CENTRED_ERROR), degrees(CENTRED_ERROR), color=MUTED_COLOUR, alpha=0.15, linewidth=0)
        axes.axvline(found[0].score.bound, color="black", linestyle=":", linewidth=1.0, label="time-optimal bound")
        axes.set_title(f"{scenario.name}: {_body_title(body)}", fontsize=10)
        axes.set(ylim=(-8, 27), xlim=(0, scenario.seconds))
        _simplify_axes(axes)
    handles, labels = grid.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    save_figure(figure, path, 90)


def _body_title(body: TrackingBody) -> str:
    return {TrackingBody.HEAD: "head alone", TrackingBody.BASE: "base alone", TrackingBody.BOTH: "head and base"}[body]


# --- one rule base, in four panels ------------------------------------------------------------------------------------


def _draw_rule_base(row: Sequence[Axes], name: str, controller: Controller) -> None:
    for axes, variable in zip(row, controller.inputs, strict=False):
        unit, scale = UNITS[variable.name]
        _draw_terms(axes, {term: partial(_grade, variable, term) for term in variable.terms}, variable.corners, scale)
        axes.set_xlabel(f"{variable.name} ({unit})")
    for axes in row[len(controller.inputs) : 2]:
        axes.set_axis_off()
    output = controller.output
    if isinstance(output, FuzzySets):
        _draw_terms(row[2], output.terms, output.corners, OUTPUT_UNIT[1])
    else:
        numbers = {term: value for term, value in output.terms.items() if isinstance(value, int | float)}
        for number, (term, value) in enumerate(sorted(numbers.items(), key=lambda item: item[1])):
            row[2].plot([value * OUTPUT_UNIT[1]] * 2, [0, 1], color=COLOURS[number % len(COLOURS)], linewidth=2)
            row[2].text(value * OUTPUT_UNIT[1], 1.03, term, rotation=60, fontsize=7)
        row[2].set(ylim=(0, 1.6), yticks=(0, 0.5, 1))
        _simplify_axes(row[2])
    row[2].set_xlabel(f"{output.name} ({OUTPUT_UNIT[0]})")
    row[0].set_ylabel(name, fontsize=13, fontweight="bold")
    inputs = [variable.name for variable in controller.inputs]
    _draw_surface(row[3], inputs, [variable.corners for variable in controller.inputs], controller.tabulate())


def _draw_pd(row: Sequence[Axes], name: str, rules: RuleBases, config: ControllerConfig) -> None:
    for axes in row[:3]:
        axes.set_axis_off()
    values = config.values[name]
    if isinstance(values, Mapping):
        text = f"{name}\n\np = {values['p']:g} 1/s\nd = {values['d']:g}"
        row[1].text(0.5, 0.5, text, ha="center", va="center", fontsize=12)
    reach = np.radians(30.0)
    _draw_surface(row[3], ["error", "rate"], [(-reach, reach), (-reach * 3, reach * 3)], getattr(rules, name).surface)


def _grade(variable: FuzzyVariable, term: str, value: float) -> float:
    """Return the membership grade of an input in a term; values beyond the outermost corners are clamped to them."""
    return variable.grades(value)[term]


def _draw_terms(
    axes: Axes, terms: Mapping[str, Callable[[float], float]], corners: Sequence[float], scale: float
) -> None:
    low, high = _padded_range(corners)
    places = sorted({*np.linspace(low, high, CURVE_POINTS).tolist(), *corners})
    for number, (term, grade) in enumerate(terms.items()):
        colour = COLOURS[number % len(COLOURS)]
        grades = [grade(place) for place in places]
        axes.plot([place * scale for place in places], grades, color=colour, linewidth=1.5)
        full = [place * scale for place, value in zip(places, grades, strict=True) if value == max(grades)]
        axes.text((full[0] + full[-1]) / 2, 1.03, term, rotation=60, fontsize=7, color=colour)
    axes.set(ylim=(0, 1.6), yticks=(0, 0.5, 1))
    _simplify_axes(axes)


def _draw_surface(
    axes: Axes, names: Sequence[str], corners: Sequence[Sequence[float]], surface: Callable[..., float]
) -> None:
    """Draw a controller's output over its inputs: a curve for one input, a map for two; further inputs are 0.

    ``names`` are the inputs, ``corners`` the corners of each input's terms, and ``surface`` is the controller.
    """
    spans = [
        np.linspace(*_padded_range(along), CURVE_POINTS if len(names) == 1 else SURFACE_POINTS) for along in corners
    ]
    units = [UNITS[name] for name in names]
    if len(names) == 1:
        axes.plot(spans[0] * units[0][1], [surface(float(at)) * OUTPUT_UNIT[1] for at in spans[0]], color=COLOURS[3])
        axes.set(xlabel=f"{names[0]} ({units[0][0]})", ylabel=f"output ({OUTPUT_UNIT[0]})")
        _simplify_axes(axes)
        return
    rest = [0.0] * (len(names) - 2)
    heights = [[surface(float(x), float(y), *rest) * OUTPUT_UNIT[1] for x in spans[0]] for y in spans[1]]
    drawn = axes.pcolormesh(
        spans[0] * units[0][1], spans[1] * units[1][1], heights, cmap="RdBu_r", shading="auto", rasterized=True
    )
    axes.contour(spans[0] * units[0][1], spans[1] * units[1][1], heights, levels=[0.0], colors="black", linewidths=0.8)
    axes.set(xlabel=f"{names[0]} ({units[0][0]})", ylabel=f"{names[1]} ({units[1][0]})")
    if axes.figure is not None:
        axes.figure.colorbar(drawn, ax=axes, label=f"output ({OUTPUT_UNIT[0]})")


def _padded_range(corners: Sequence[float]) -> tuple[float, float]:
    """Return the plotted range of an input: from the lowest to the highest corner of its terms, with a margin."""
    margin = MARGIN_SHARE * (corners[-1] - corners[0])
    return corners[0] - margin, corners[-1] + margin


def _make_figure(size: tuple[float, float], title: str) -> Figure:
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)  # its own canvas, without a window or global state
    figure.suptitle(title)
    return figure


def _simplify_axes(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color=MUTED_COLOUR, alpha=0.25)
    axes.set_axisbelow(True)
