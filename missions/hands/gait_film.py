"""A gait as pictures of a figure of lines, from its right and from the front, over two cycles on a treadmill."""

from collections.abc import Iterator

import numpy as np

from drivers.api import Image
from drivers.legs.body import Body, Floats
from drivers.legs.collision import TRUNK, capsules
from drivers.legs.engine import whole
from drivers.legs.gait import Gait
from drivers.legs.kinematics import forward
from drivers.sim.rigid.stick import Stroke, stick_figure

RATE = 25.0
"""Pictures a second."""

CYCLES = 2

SIZE = (640, 480)

LINE = 0.004
"""Half the width (m) of a line from joint to joint."""


def gait_pictures(gait: Gait, body: Body) -> Iterator[Image]:
    """Yield the pictures of a gait that the body reaches."""
    angles, _ = gait.angles(body)
    placed = forward(body, whole(body, angles))
    lowest = gait.feet[..., 2].min()
    height = float(placed.position[..., 2].max() - lowest) * 1.15
    gone = _gone(gait)
    count = len(gait.times)
    for number in range(max(2, round(CYCLES * gait.period * RATE))):
        time = number / RATE
        cycle, place = divmod(round(time / gait.period * count), count)
        strokes = list(_strokes(body, placed.position[place], placed.rotation[place], -lowest))
        way = float(gone[place] + cycle * gone[-1])
        yield stick_figure(strokes, SIZE, height=height, gone=way, told=f"{gait.name}  {time:.2f} s")


def _gone(gait: Gait) -> Floats:
    """Return how far the body has gone by each time of a cycle, and by its end: as the feet on the floor go back."""
    back = gait.feet[:, :, 0] - np.roll(gait.feet[:, :, 0], -1, axis=0)
    held = gait.on & np.roll(gait.on, -1, axis=0)
    steps = np.where(held, back, 0.0).sum(axis=1) / np.maximum(held.sum(axis=1), 1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _strokes(body: Body, position: Floats, rotation: Floats, up: float) -> Iterator[Stroke]:
    raised = np.array([0.0, 0.0, up])
    for place, parent in enumerate(body.parent):
        if parent >= 0:
            yield Stroke(position[parent] + raised, position[place] + raised, LINE)
    for each in capsules(body):
        if each.name == TRUNK and each.link < 0:
            yield Stroke(each.start + raised, each.end + raised, each.radius)
        else:
            at, turned = position[each.link] + raised, rotation[each.link]
            yield Stroke(at + turned @ each.start, at + turned @ each.end, each.radius)
