"""Looking through a camera that is plugged in, picture by picture, for commands of a terminal."""

from collections.abc import Iterator
from contextlib import closing

import click

from drivers.api import DeviceStatus, Image
from drivers.camera.choose import open_source
from drivers.clock import SystemClock
from drivers.errors import NotConnected

PICTURE_TIMEOUT = 5.0
"""Seconds in which a camera must show something, unless less was asked for."""


def through(source: str, seconds: float, size: tuple[int, int] | None = None) -> Iterator[tuple[float, Image]]:
    """Yield what a camera sees, with the time since it was opened, for so long, or until its film is over.

    Raises NotConnected when there is nothing to see in time.
    """
    clock = SystemClock()
    begin = clock.now()
    with closing(open_source(source, clock, size=size, loop=False, report=tell)) as camera:
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
