"""People and furniture in the way of a robot, drawn by chance."""

from collections.abc import Iterator
from dataclasses import replace
from math import cos, hypot, pi, sin
from random import Random

from config.world import WorldConfig
from config.world_items import BoxConfig, PersonConfig

PACES = (0.2, 0.4, 0.7, 1.0)
"""m/s at which people walk."""

FREE = 0.55
"""Metres about the robot's start that stay free: somebody's body is 0.25 m, a base's 0.18 m."""

AHEAD = 0.6
"""The share of what is put on the way ahead of the robot."""


def crowded(world: WorldConfig, chance: Random, *, people: int, furniture: int) -> WorldConfig:
    """Return the world with more people, who stand and walk, and more furniture; nothing of it at the robot's start."""
    boxes = tuple(_boxes(world, chance, furniture))
    others = tuple(_people(world, chance, people))
    return replace(world, people=(*world.people, *others), furniture=(*world.furniture, *boxes))


def _boxes(world: WorldConfig, chance: Random, count: int) -> Iterator[BoxConfig]:
    for number in range(count):
        thin = chance.random() < 0.4  # the leg of a table, a post
        length, width = (0.05, 0.05) if thin else (chance.uniform(0.2, 1.2), chance.uniform(0.2, 0.8))
        at = _place(world, chance, FREE - 0.25 + hypot(length, width) / 2)
        if at is not None:
            size = (round(length, 2), round(width, 2), 1.0)
            yield BoxConfig(name=f"thing {number}", at=at, size=size, heading=chance.uniform(-pi, pi), colour="grey")


def _people(world: WorldConfig, chance: Random, count: int) -> Iterator[PersonConfig]:
    for number in range(count):
        at = _place(world, chance, FREE)
        path = tuple(
            stop for _ in range(chance.choice([0, 1, 2, 3])) if (stop := _place(world, chance, 0.0)) is not None
        )
        if at is not None:
            yield PersonConfig(
                name=f"Walker {number}",
                look="anna",
                at=at,
                path=path,
                speed=chance.choice(PACES),
                start=chance.choice([0.0, 0.0, round(chance.uniform(0.0, 6.0), 1)]),
                loop=chance.random() < 0.5,
            )


def _place(world: WorldConfig, chance: Random, free: float) -> tuple[float, float] | None:
    """Return a place in the room that is so far from the robot's start; None where chance finds none."""
    (cx, cy), length, width = world.centre, world.length, world.width
    for _ in range(20):
        if chance.random() < AHEAD:
            far, aside = chance.uniform(0.6, 3.0), chance.uniform(-0.6, 0.6)
            heading = world.start.heading
            x = world.start.x + far * cos(heading) - aside * sin(heading)
            y = world.start.y + far * sin(heading) + aside * cos(heading)
        else:
            x = cx + (length / 2 - 0.3) * chance.uniform(-1, 1)
            y = cy + (width / 2 - 0.3) * chance.uniform(-1, 1)
        inside = abs(x - cx) <= length / 2 - 0.26 and abs(y - cy) <= width / 2 - 0.26
        if inside and hypot(x - world.start.x, y - world.start.y) > free:
            return round(x, 2), round(y, 2)
    return None
