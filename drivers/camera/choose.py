"""Chooses the camera that fits a source."""

from math import radians

from drivers.api import Camera, Report, ignore
from drivers.camera.folder import FolderCamera
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
        return FolderCamera(str(source), clock, field_of_view=field_of_view, loop=loop, retry=retry, report=report)
    return OpenCVCamera(source, clock, field_of_view=field_of_view, size=size, loop=loop, retry=retry, report=report)
