"""Looking through a camera that is plugged in, picture by picture, for commands of a terminal."""

from collections.abc import Iterator
from contextlib import ExitStack, closing
from math import inf
from typing import Any

import click

from config.robot import RobotConfig
from drivers.api import Camera, DeviceStatus, Image, ignore
from drivers.api.image_orientation import UPRIGHT, ImageOrientation
from drivers.camera.make import open_source
from drivers.camera.source import is_live
from drivers.clock import Clock, SystemClock
from drivers.errors import NotConnected
from drivers.pictures.capture import AGAIN_SUFFIX, NOT_YET_TEXT
from missions.assembly.assemble import RealPartFactory
from missions.assembly.part_factory import Hooks, Overrides, order_parts

PICTURE_TIMEOUT = 8.0
"""Seconds in which a camera must show something: one in the network says why not within 5 s."""

FAILURE_TIMEOUT = 2.0
"""Seconds after which a camera that has said why it shows nothing is not waited for."""

RETURN_TIMEOUT = 30.0
"""Seconds without a picture after which a camera that has shown something is not waited for any more."""


def camera_frames(
    source: str, seconds: float, size: tuple[int, int] | None = None, turn: ImageOrientation = UPRIGHT
) -> Iterator[tuple[float, Image]]:
    """Yield what a camera sees, with the time since it was opened, for so long, or until its film is over.

    A live one that falls silent is waited for. Raises NotConnected when there is nothing to see in time.
    """
    clock = SystemClock()
    with closing(open_source(source, clock, size=size, loop=False, report=print_camera_status, turn=turn)) as camera:
        yield from _frames_until(camera, clock, seconds, live=is_live(source))


def robot_camera_frames(config: RobotConfig, seconds: float) -> Iterator[tuple[float, Image]]:
    """Do the same with the camera of a robot, by its driver, and with what that is made of; no other part is opened."""
    clock = SystemClock()
    place = RealPartFactory(config, clock, Overrides(), Hooks(print_camera_status, ignore, click.echo, ignore, ignore))
    parts = frozenset({"camera", *config.sections["camera"].driver.needs})
    made: dict[str, Any] = {}
    with ExitStack() as stack:
        for part in order_parts(config, parts):
            made[part] = stack.enter_context(closing(place.device(config.sections[part], made)))
            if part != "camera":
                made[part].open()
        yield from _frames_until(made["camera"], clock, seconds, live=True)


def _frames_until(camera: Camera, clock: Clock, seconds: float, *, live: bool) -> Iterator[tuple[float, Image]]:
    """Yield pictures for so long after the first one."""
    begin = clock.now()
    camera.open()
    end = inf
    seen_at: float | None = None
    while clock.now() < end:
        frame = camera.read(0.2)
        if frame is not None:
            seen_at = clock.now()
            end = min(end, seen_at + seconds)
            yield frame.stamp - begin, frame.image
            continue
        health = camera.health()
        if seen_at is not None and not health.online and not live:
            return  # a film is over
        most = RETURN_TIMEOUT
        if seen_at is None:
            most = PICTURE_TIMEOUT if health.detail.endswith(NOT_YET_TEXT) else FAILURE_TIMEOUT
        if clock.now() - (seen_at or begin) > most:
            raise NotConnected(health.detail, hint=health.hint)


def print_camera_status(notice: DeviceStatus) -> None:
    """Print what a camera says of itself, but for that it is there at first."""
    if notice.kind != "online" or notice.message.endswith(AGAIN_SUFFIX):
        click.echo(notice.message + (f"\n  try: {notice.hint}" if notice.hint else ""), err=True)
