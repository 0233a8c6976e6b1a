"""From the keys of a robot file to a camera."""

from math import radians

from drivers.api import Camera, Report, ignore
from drivers.api.driver import Site
from drivers.api.senses import CameraKeys
from drivers.camera.opencv import OpenCVCamera
from drivers.camera.source import Kind, Source, kind_of
from drivers.clock import Clock


def open_source(
    source: Source,
    clock: Clock,
    *,
    field_of_view: float = radians(60.0),
    size: tuple[int, int] | None = None,
    loop: bool = True,
    retry: float = 1.0,
    report: Report = ignore,
) -> Camera:
    """Return a camera over ``source``, not opened yet: a number or path of a device, an address, a video, pictures.

    ``size`` (width, height in pixels) is asked of devices, ``loop`` is for recordings.
    """
    if kind_of(source) in {Kind.FOLDER, Kind.PICTURE}:
        from drivers.camera.folder import FolderCamera  # noqa: PLC0415 - a robot has none

        return FolderCamera(str(source), clock, field_of_view=field_of_view, loop=loop, retry=retry, report=report)
    return OpenCVCamera(source, clock, field_of_view=field_of_view, size=size, loop=loop, retry=retry, report=report)


def make(keys: CameraKeys, site: Site) -> Camera:
    """Return the camera on the source of the keys: an index, a device, a file, a URL or a folder."""
    return open_source(
        keys.source,
        site.clock,
        field_of_view=keys.field_of_view,
        size=(keys.width, keys.height),
        report=site.report,
    )
