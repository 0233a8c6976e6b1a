"""Pictures of a connected camera, for terminal commands."""

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
"""Maximum seconds until a camera's first picture.

It is longer than the 5 s after which an unreachable network camera reports its error.
"""

FAILURE_TIMEOUT = 2.0
"""Maximum seconds until the first picture after the camera has reported an error."""

RETURN_TIMEOUT = 30.0
"""Maximum seconds without a picture from a camera that has sent pictures before."""


def camera_frames(
    source: str, seconds: float, size: tuple[int, int] | None = None, turn: ImageOrientation = UPRIGHT
) -> Iterator[tuple[float, Image]]:
    """Yield the pictures of a camera or film, each with the time (s) since it was opened.

    The iterator ends after ``seconds``, or with the film. ``size`` is the requested picture size, ``turn`` how the
    pictures are rotated and flipped. While a live source is interrupted, the iterator waits. Raises NotConnected if no
    picture arrives in time.
    """
    clock = SystemClock()
    with closing(open_source(source, clock, size=size, loop=False, report=print_camera_status, turn=turn)) as camera:
        yield from _frames_until(camera, clock, seconds, live=is_live(source))


def robot_camera_frames(config: RobotConfig, seconds: float) -> Iterator[tuple[float, Image]]:
    """Yield the pictures of a robot's camera as ``camera_frames`` does.

    The camera is opened by its driver, with the parts of the robot that this driver needs, and no others.
    """
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
    """Yield time since opening (s) and picture of a camera for ``seconds`` after the first picture.

    If the camera is not ``live``, it is a film, and its end ends the pictures too.
    """
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
            return  # end of the film
        most = RETURN_TIMEOUT
        if seen_at is None:
            most = PICTURE_TIMEOUT if health.detail.endswith(NOT_YET_TEXT) else FAILURE_TIMEOUT
        if clock.now() - (seen_at or begin) > most:
            raise NotConnected(health.detail, hint=health.hint)


def print_camera_status(notice: DeviceStatus) -> None:
    """Print a notice of a camera, except its first connection."""
    if notice.kind != "online" or notice.message.endswith(AGAIN_SUFFIX):
        click.echo(notice.message + (f"\n  try: {notice.hint}" if notice.hint else ""), err=True)
