"""From the keys of a robot file to a camera."""

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
    """Return a camera over ``source``, not opened yet: a number or path of a device, an address, a video, pictures.

    ``size`` (width, height in pixels) is asked of devices, ``loop`` is for recordings: a clip stands in for a camera
    that goes on. ``turn`` is applied to each picture. Pictures come at ``rate`` a second, a film at its own. Stamps are
    the time at which the picture arrived, a few tens of milliseconds after its exposure. Raises BadRequest unless
    ``rate`` > 0.
    """
    if rate <= 0:
        raise BadRequest(f"camera: {rate} pictures a second: must be above 0")
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
    """Return the camera on the source of the keys: an index, a device, a file, a URL or a folder."""
    return open_source(
        keys.source,
        site.clock,
        field_of_view=keys.upright().field_of_view,
        size=(keys.width, keys.height),
        report=site.report,
        turn=keys.orientation,
    )
