"""Factories that make cameras from a section of a robot file, or from a source such as a path."""

from math import radians

from drivers.api import StatusCallback, ignore
from drivers.api.driver import DriverContext
from drivers.api.image_orientation import UPRIGHT, ImageOrientation
from drivers.api.sensor_sections import CameraKeys
from drivers.camera.reader import ReaderFeed
from drivers.camera.source import Source
from drivers.clock import Clock
from drivers.errors import BadRequest
from drivers.pictures.capture import ThreadedCamera


def open_source(
    source: Source,
    clock: Clock,
    *,
    field_of_view: float = radians(60.0),
    size: tuple[int, int] | None = None,
    loop: bool = True,
    retry: float = 1.0,
    rate: float = 5.0,
    report: StatusCallback = ignore,
    turn: ImageOrientation = UPRIGHT,
) -> ThreadedCamera:
    """Return a camera, not opened yet, for ``source``: number or path of a device, address, video or pictures.

    ``field_of_view`` is horizontal, in radians. ``size`` (width, height in pixels) is requested from devices. ``loop``
    repeats recordings, so that a clip can replace a live camera. ``retry`` is the reconnect interval in seconds.
    ``turn`` rotates or mirrors each picture. Pictures of a folder come at ``rate`` per second, a video at its own rate.
    The stamp of a picture is its arrival time, a few tens of milliseconds after the exposure. Raises BadRequest unless
    ``rate`` > 0.
    """
    if rate <= 0:
        raise BadRequest(f"camera: {rate} pictures per second: must be above 0")
    return ThreadedCamera(
        lambda: ReaderFeed("camera", source, size, rate),
        clock,
        name="camera",
        field_of_view=field_of_view,
        loop=loop,
        retry=retry,
        report=report,
        turn=turn,
    )


def make(keys: CameraKeys, site: DriverContext) -> ThreadedCamera:
    """Return the camera of a robot file's section."""
    return open_source(
        keys.source,
        site.clock,
        field_of_view=keys.upright().field_of_view,
        size=(keys.width, keys.height),
        report=site.report,
        turn=keys.orientation,
    )
