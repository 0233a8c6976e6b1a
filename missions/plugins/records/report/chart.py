"""Charts as inline SVG, readable without colour.

Horizontal positions are percentages, so the page's script can move one time marker over all charts.
"""

from collections.abc import Sequence
from math import ceil, degrees, dist, floor, log10

from missions.plugins.pictures.page.document import Markup, join, tag
from missions.plugins.records.report.slider import SliderTimes
from missions.plugins.records.report.traces import BaseRoute, Chart, ChartLine, Points, split_at_gaps, thin_points

GRID_STEPS = (1.0, 2.0, 5.0, 10.0)
"""Allowed distances between the grid lines of a chart, times a power of ten."""

GRID_ROWS, GRID_COLUMNS = 3, 6
"""Approximate number of vertical grid lines, as ``GRID_ROWS`` is of horizontal ones."""

VIEW_SIZE = 1000
"""Width and height of the SVG view box of a chart."""


def round_numbers(low: float, high: float, count: int) -> list[float]:
    """Return about ``count`` evenly spaced round numbers from ``low`` to ``high``; at least two if these differ.

    The distance between them is 1, 2 or 5 times a power of ten.
    """
    span = high - low
    if span <= 0:
        return [low]
    power = 10.0 ** floor(log10(span / count))
    coarse = next(each for each in GRID_STEPS if each * power * count >= span * 0.999)
    for step in (coarse * power / part for part in (1, 2, 5)):
        found = [number * step for number in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]
        if len(found) > 1:
            break
    return found


def percent_along(time: float, slider: SliderTimes) -> str:
    """Return the horizontal position of ``time`` (s) on the charts as a CSS length, such as "12.5%"."""
    return f"{100 * (time - slider.start) / slider.span:.3f}%"


def time_axis(slider: SliderTimes) -> Markup:
    """Return the time axis of the charts as SVG: labels at round times."""
    times = round_numbers(slider.start, slider.end, GRID_COLUMNS)
    marks = [
        tag(
            "text",
            f"{time:g} s",
            x=percent_along(time, slider),
            y=12,
            text_anchor=_text_anchor((time - slider.start) / slider.span),
        )
        for time in times
    ]
    return tag("svg", *marks, class_="axis", aria_hidden="true", height=16)


def chart_figure(chart: Chart, slider: SliderTimes) -> Markup:
    """Return a chart with title and legend; the page's script writes current values into its ``output`` elements."""
    low, high = _value_range(chart)
    legend = [
        tag(
            "span", _legend_line(line), line.name, " ", tag("output", class_="value", data_line=f"{chart.key}/{number}")
        )
        for number, line in enumerate(chart.lines)
    ]
    grid = [_grid_line(value, low, high) for value in round_numbers(low, high, GRID_ROWS)]
    lines = [_line_path(line, slider, low, high) for line in sorted(chart.lines, key=lambda line: not line.requested)]
    inside = tag(
        "svg", *lines, viewBox=f"0 0 {VIEW_SIZE} {VIEW_SIZE}", preserveAspectRatio="none", width="100%", height="100%"
    )
    label = f"{chart.title}, {', '.join(_line_summary(line, chart.unit) for line in chart.lines)}"
    plot = tag("svg", *grid, inside, class_="plot", role="img", aria_label=label)
    return tag(
        "figure",
        tag("figcaption", tag("b", f"{chart.title}, {chart.unit}"), tag("span", *legend, class_="lines")),
        tag("div", plot, class_="over-time"),
        time_axis(slider),
        class_="chart",
    )


def route_figure(route: BaseRoute) -> Markup:
    """Return a figure with the path of the base from above; the initial heading points up.

    The script of the page moves the element ``.robot`` along the path.
    """
    points = [(-y, -x) for x, y, _ in route.poses]
    left, right, top, bottom = _bounding_box(points)
    size = max(right - left, bottom - top)
    rule = _round_below(size / 3)
    margin = 0.08 * size
    plot = tag(
        "svg",
        route_markup(route, 0.028 * size, size / VIEW_SIZE),
        tag("path", d=f"M{_number(left)},{_number(bottom + margin / 2)} h{_number(rule)}", class_="rule"),
        viewBox=" ".join(
            _number(value)
            for value in (left - margin, top - margin, right - left + 2 * margin, bottom - top + 2 * margin)
        ),
        class_="route",
        role="img",
        aria_label=f"Path of the base from above, {route.length:.1f} m long",
    )
    caption = tag(
        "figcaption",
        tag("b", "Path of the base, from above"),
        tag("span", tag("span", "○ start, initial heading up"), tag("span", f"━ {rule:g} m"), class_="lines"),
    )
    return tag("figure", caption, plot, class_="chart")


def route_markup(route: BaseRoute, radius: float, min_distance: float = 0.01) -> Markup:
    """Return path, start and robot (a disc of ``radius`` metres) in metres, with the initial heading up.

    Points closer together than ``min_distance`` (m) are merged.
    """
    points = [(-y, -x) for x, y, _ in route.poses]
    path = " ".join(f"{x:.3f},{y:.3f}" for x, y in _thin_route(points, min_distance))
    (x, y), robot = (
        points[0],
        tag(
            "g",
            tag("circle", r=_number(radius)),
            tag("path", d=f"M0,0 V{_number(-2 * radius)}"),
            class_="robot",
            transform=_robot_transform(route.poses[-1]),
        ),
    )
    begin = tag("circle", cx=_number(x), cy=_number(y), r=_number(0.65 * radius), class_="start")
    return join(tag("polyline", points=path, class_="way"), begin, robot)


def _round_below(value: float) -> float:
    """Return the largest number up to ``value`` that is 1, 2 or 5 times a power of ten."""
    power = 10.0 ** floor(log10(value))
    return max(each * power for each in GRID_STEPS if each * power <= value)


def to_plan_view(pose: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return a pose (x, y, heading in rad) in drawing coordinates: x, y and rotation in degrees."""
    x, y, heading = pose
    return round(-y, 4), round(-x, 4), round(-degrees(heading), 1)


def _robot_transform(pose: tuple[float, float, float]) -> str:
    """Return the SVG transform of the robot symbol for a pose of the base; the page's script computes the same."""
    x, y, angle = to_plan_view(pose)
    return f"translate({x} {y}) rotate({angle})"


def _value_range(chart: Chart) -> tuple[float, float]:
    """Return the value range of a chart with margins; it includes 0, except for a nearly constant percentage."""
    low, high = min(chart.values), max(chart.values)
    if low < 0.8 * high or chart.unit != "%":
        low, high = min(low, 0.0), max(high, 0.0)
    margin = max(0.08 * (high - low), 0.01 * abs(high), 1e-3)
    return low - margin, high + margin


def _line_path(line: ChartLine, slider: SliderTimes, low: float, high: float) -> Markup:
    path = " ".join(
        _path_data([(time - slider.start, value) for time, value in stretch], slider.span, low, high)
        for stretch in split_at_gaps(thin_points(line.points, slider.start, slider.span))
    )
    return tag("path", d=path, class_=_line_class(line))


def _path_data(points: Points, span: float, low: float, high: float) -> str:
    """Return the SVG path data of one segment of a chart line; a single value becomes a dot, by its round line caps."""
    places = [
        f"{VIEW_SIZE * time / span:.1f} {VIEW_SIZE * (high - value) / (high - low):.1f}" for time, value in points
    ]
    return f"M{places[0]} L{' '.join(places[1:] or places)}"


def _grid_line(value: float, low: float, high: float) -> Markup:
    """Return a horizontal grid line of a chart with its number."""
    height = f"{100 * (high - value) / (high - low):.2f}%"
    return join(
        tag("line", x1=0, x2="100%", y1=height, y2=height, class_="zero" if value == 0 else "grid"),
        tag("text", f"{value:g}", x=-8, y=height, dy=4, text_anchor="end"),
    )


def _legend_line(line: ChartLine) -> Markup:
    """Return a short sample of a chart line for the legend."""
    stroke = tag("line", x1=0, x2=28, y1=5, y2=5, class_=_line_class(line))
    return tag("svg", stroke, width=28, height=10, aria_hidden="true")


def _line_class(line: ChartLine) -> str:
    return "asked" if line.requested else "measured"


def _line_summary(line: ChartLine, unit: str) -> str:
    values = [value for _, value in line.points]
    return f"{line.name} {min(values):.3g} to {max(values):.3g} {unit}" if values else f"{line.name} unknown"


def _text_anchor(place: float) -> str:
    """Return the SVG text anchor of a label at a position from 0 to 1, so that the label stays inside the chart."""
    return "start" if place < 0.03 else "end" if place > 0.97 else "middle"


def _bounding_box(points: Sequence[tuple[float, float]]) -> tuple[float, float, float, float]:
    """Return left, right, top and bottom of a drawing of these points of a route, in metres.

    It is at least half a metre wide and high, and widened if the route is too narrow for a drawing.
    """
    (left, right), (top, bottom) = ((min(each), max(each)) for each in zip(*points, strict=True))
    width, height = max(right - left, 0.5, 0.8 * (bottom - top)), max(bottom - top, 0.5, 0.5 * (right - left))
    x, y = (left + right) / 2, (top + bottom) / 2
    return x - width / 2, x + width / 2, y - height / 2, y + height / 2


def _thin_route(points: Sequence[tuple[float, float]], min_distance: float) -> list[tuple[float, float]]:
    """Return the points of a route, without those within ``min_distance`` (m) of the last point returned."""
    kept = [points[0]]
    for point in points[1:]:
        if dist(point, kept[-1]) > min_distance:
            kept.append(point)
    return kept


def _number(value: float) -> str:
    return f"{value:.3f}"
