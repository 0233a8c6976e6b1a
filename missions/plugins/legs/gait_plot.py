"""Plots and films of gaits: soles, pelvis and centre of mass over a cycle, joints with limits.

Needs the extra ``plots``.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from drivers.api import Image, JointLimits
from drivers.legs.body import SIDES, Floats, LeggedBody
from drivers.legs.engine import whole_body_pose
from drivers.legs.gait import Gait
from drivers.legs.gait_check import TRUNK, capsules
from drivers.legs.kinematics import centre_of_mass, forward_kinematics
from drivers.sim.rigid.stick_drawing import Stroke, draw_stick_figure
from missions.plugins.pictures.moves_plot import FORMATS, GOAL_COLOUR, LIMIT_COLOUR, MEASURED_COLOUR, save_figure

# A gait as a stick figure, from the right and from the front, over two cycles on a treadmill.

FRAME_RATE = 25.0
"""Frames per second of the film of a gait."""

FILM_CYCLES = 2

SIZE = (640, 480)

LINE_HALF_WIDTH = 0.004
"""Half the width (m) of a line from joint to joint."""


def gait_pictures(gait: Gait, body: LeggedBody) -> Iterator[Image]:
    """Yield the frames of the film of a reachable gait."""
    angles, _ = gait.angles(body)
    placed = forward_kinematics(body, whole_body_pose(body, angles))
    lowest = gait.feet[..., 2].min()
    height = float(placed.position[..., 2].max() - lowest) * 1.15
    gone = _travelled(gait)
    count = len(gait.times)
    for number in range(max(2, round(FILM_CYCLES * gait.period * FRAME_RATE))):
        time = number / FRAME_RATE
        cycle, place = divmod(round(time / gait.period * count), count)
        strokes = list(_strokes(body, placed.position[place], placed.rotation[place], -lowest))
        way = float(gone[place] + cycle * gone[-1])
        yield draw_stick_figure(strokes, SIZE, height=height, walked=way, caption=f"{gait.name}  {time:.2f} s")


def _travelled(gait: Gait) -> Floats:
    """Return the distance (m) that the body has travelled at each time of a cycle, and at its end.

    It is computed from the feet on the floor, which move backwards relative to the body.
    """
    back = gait.feet[:, :, 0] - np.roll(gait.feet[:, :, 0], -1, axis=0)
    held = gait.on_floor & np.roll(gait.on_floor, -1, axis=0)
    steps = np.where(held, back, 0.0).sum(axis=1) / np.maximum(held.sum(axis=1), 1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _strokes(body: LeggedBody, position: Floats, rotation: Floats, up: float) -> Iterator[Stroke]:
    raised = np.array([0.0, 0.0, up])
    for place, parent in enumerate(body.parent):
        if parent >= 0:
            yield Stroke(position[parent] + raised, position[place] + raised, LINE_HALF_WIDTH)
    for each in capsules(body):
        if each.name == TRUNK and each.link < 0:
            yield Stroke(each.start + raised, each.end + raised, each.radius)
        else:
            at, turned = position[each.link] + raised, rotation[each.link]
            yield Stroke(at + turned @ each.start, at + turned @ each.end, each.radius)


COLOURS = {"left": GOAL_COLOUR, "right": MEASURED_COLOUR}


def draw_gait(path: Path, gait: Gait, body: LeggedBody, limits: Mapping[str, JointLimits]) -> None:
    """Draw a reachable gait. Raises ValueError for an unknown format, OSError if the file cannot be written."""
    if path.suffix not in FORMATS:
        raise ValueError(f"{path}: a picture ends in {' or '.join(FORMATS)}")
    angles, _ = gait.angles(body)
    figure = Figure(figsize=(12.0, 11.0), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{gait.name}: a cycle of {gait.period:.2f} s")
    grid = figure.subplots(4, 3, squeeze=False)
    centre = centre_of_mass(body, forward_kinematics(body, whole_body_pose(body, angles)))
    for axes, title, axis in zip(grid[0], ("ahead", "left", "up"), range(3), strict=True):
        for number, side in enumerate(SIDES):
            axes.plot(gait.times, 1000 * gait.feet[:, number, axis], color=COLOURS[side], label=f"{side} sole")
        axes.plot(gait.times, 1000 * centre[:, axis], color="#444", linestyle="--", label="centre of mass")
        axes.axhline(0.0, color=LIMIT_COLOUR, linewidth=1.0, label="pelvis")
        _style_axes(axes, f"{title}, from the pelvis", "mm")
    ways = zip(("hip turn", "hip roll", "hip pitch", "knee", "ankle pitch", "ankle roll"), range(6), strict=True)
    for axes, (title, place) in zip([*grid[1], *grid[2]], ways, strict=True):
        for number, side in enumerate(SIDES):
            column = 6 * number + place
            _plot_joint(axes, gait.times, angles[:, column], COLOURS[side], limits[body.leg_joints[column]])
        _style_axes(axes, title, "deg")
    for axes, side in zip(grid[3], SIDES, strict=False):
        number = SIDES.index(side)
        axes.plot(1000 * gait.feet[:, number, 0], 1000 * gait.feet[:, number, 2], color=COLOURS[side])
        _style_axes(axes, f"{side} sole from the side", "mm up", "mm ahead")
    grid[3][2].set_axis_off()
    handles, labels = grid[0][0].get_legend_handles_labels()
    grid[3][2].legend(handles, labels, loc="center", frameon=False)
    save_figure(figure, path, 90)


def _plot_joint(axes: Axes, times: Floats, angles: Floats, colour: str, limits: JointLimits) -> None:
    """Plot the angle of a joint in degrees, and those of its limits that are within 10 degrees of the angles."""
    axes.plot(times, np.degrees(angles), color=colour)
    low, high = float(np.degrees(angles.min())) - 10.0, float(np.degrees(angles.max())) + 10.0
    for end in np.degrees([limits.lower, limits.upper]):
        if low <= end <= high:
            axes.axhline(end, color=colour, linestyle=":", linewidth=1.0)


def _style_axes(axes: Axes, title: str, up: str, along: str = "s") -> None:
    axes.set_title(title, fontsize=10)
    axes.set_ylabel(up)
    axes.set_xlabel(along)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color=LIMIT_COLOUR, alpha=0.25)
