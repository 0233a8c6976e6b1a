"""Looking through a camera that is plugged in, picture by picture, for commands of a terminal."""

from collections.abc import Iterator
from contextlib import ExitStack, closing
from typing import Any

import click

from config.robot import RobotConfig
from drivers.api import Camera, DeviceStatus, Image, ignore
from drivers.camera.make import open_source
from drivers.clock import Clock, SystemClock
from drivers.errors import NotConnected
from missions.assembly.assemble import Place
from missions.assembly.together import Hooks, Overrides, making_order

PICTURE_TIMEOUT = 5.0
"""Seconds in which a camera must show something, unless less was asked for."""


def through(source: str, seconds: float, size: tuple[int, int] | None = None) -> Iterator[tuple[float, Image]]:
    """Yield what a camera sees, with the time since it was opened, for so long, or until its film is over.

    Raises NotConnected when there is nothing to see in time.
    """
    clock = SystemClock()
    with closing(open_source(source, clock, size=size, loop=False, report=tell)) as camera:
        yield from _watched(camera, clock, seconds)


def through_own(config: RobotConfig, seconds: float) -> Iterator[tuple[float, Image]]:
    """Do the same with the camera of a robot, by its driver, and with what that is made of; no other part is opened."""
    clock = SystemClock()
    place = Place(config, clock, Overrides(), Hooks(tell, ignore, click.echo, ignore, ignore))
    parts = frozenset({"camera", *config.sections["camera"].driver.needs})
    made: dict[str, Any] = {}
    with ExitStack() as stack:
        for part in making_order(config, parts):
            made[part] = stack.enter_context(closing(place.device(config.sections[part], made)))
            if part != "camera":
                made[part].open()
        yield from _watched(made["camera"], clock, seconds)


def _watched(camera: Camera, clock: Clock, seconds: float) -> Iterator[tuple[float, Image]]:
    begin = clock.now()
    camera.open()
    seen = False
    while (now := clock.now() - begin) < seconds:
        frame = camera.read(0.2)
        if frame is not None:
            seen = True
            yield frame.stamp - begin, frame.image
            continue
        health = camera.health()
        if seen and not health.online:
            return  # a film is over, or it was unplugged, which is told
        if not seen and now > min(PICTURE_TIMEOUT, seconds / 5):
            raise NotConnected(health.detail, hint=health.hint)


def tell(notice: DeviceStatus) -> None:
    """Print what a camera says of itself, but for that it is there."""
    if notice.kind != "online":
        click.echo(notice.what + (f"\n  try: {notice.hint}" if notice.hint else ""), err=True)
