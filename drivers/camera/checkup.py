"""Checkup of a camera: picture rate and exposure."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from drivers.api import CameraFrame, Image
from drivers.api.driver import DriverContext, Finding, failure, warning
from drivers.api.sensor_sections import CameraKeys
from drivers.camera.make import make
from drivers.camera.source import SourceKind, is_number, source_kind
from drivers.pictures.capture import NOT_YET_TEXT

FIRST_PICTURE_TIMEOUT = 6.0
"""Maximum seconds to wait for the first picture, more than the 5 s in which a network camera reports an error."""

FAILURE_TIMEOUT = 2.0
"""Seconds to wait for pictures after a camera has reported an error."""

RATE_WINDOW = 1.0
"""Seconds for which pictures are counted, to compute their rate."""

MIN_RATE = 12.0
"""Pictures per second below which a head follows faces late."""

MAX_BLACK_BRIGHTNESS, MAX_DARK_BRIGHTNESS, MIN_OVEREXPOSED_BRIGHTNESS = 6.0, 35.0, 225.0
"""Limits of the mean brightness, of 255: covered lens, dark room, lamp in the picture."""

MIN_CONTRAST = 2.0
"""Minimum standard deviation of the pixels in grey levels; a picture below it shows nothing, as with a covered lens."""


def checkup(keys: CameraKeys, site: DriverContext) -> Iterator[Finding]:
    """Read the pictures of a camera for a second; yield findings on size, rate and exposure.

    ``keys`` is the camera's section of a robot file.
    """
    frames, device = list[CameraFrame](), f"/dev/video{keys.source}" if is_number(keys.source) else str(keys.source)
    if source_kind(keys.source) is SourceKind.DEVICE and not Path(device).exists():
        yield failure("pictures", f"{device} does not exist", "mission robot camera list")
        return
    with closing(make(keys, site)) as camera:
        camera.open()
        end = site.clock.now() + FIRST_PICTURE_TIMEOUT
        while (left := end - site.clock.now()) > 0:
            frame = camera.read(min(left, 0.5))
            if frame is not None:
                end = end if frames else site.clock.now() + RATE_WINDOW
                frames.append(frame)
            elif (
                not frames
                and left < FIRST_PICTURE_TIMEOUT - FAILURE_TIMEOUT
                and not camera.health().detail.endswith(NOT_YET_TEXT)
            ):
                break
        health = camera.health()
    if not frames:
        yield failure("pictures", health.detail or "no picture arrived", health.hint or "mission robot camera list")
        return
    height, width = frames[-1].image.shape[:2]
    width, height = keys.orientation.size(width, height)  # of the camera itself
    if (width, height) != (keys.width, keys.height):
        cure = f"write width: {width} and height: {height}; supported sizes: mission robot camera list"
        yield warning("pictures", f"{width}x{height}, the robot file says {keys.width}x{keys.height}", cure)
    live = source_kind(keys.source) in {SourceKind.DEVICE, SourceKind.URL}
    yield from _check_rate(frames, device=device, live=live)
    yield from _check_exposure(frames[-1].image)


def _check_rate(frames: list[CameraFrame], device: str, *, live: bool) -> Iterator[Finding]:
    """Yield the picture rate, computed from frame numbers, so that pictures that were not read in time count too."""
    first, last = frames[0], frames[-1]
    span = last.stamp - first.stamp
    rate = (last.number - first.number) / span if span > 0 else 0.0
    if live and rate < MIN_RATE:
        cure = f"more light; or: v4l2-ctl -d {device} -c exposure_dynamic_framerate=0"
        yield warning("rate", f"{rate:.0f} pictures per second: many cameras halve the rate in the dark", cure)
    else:
        yield Finding("rate", f"{rate:.0f} pictures per second")


def _check_exposure(image: Image) -> Iterator[Finding]:
    brightness = float(image.mean())
    measured = f"mean brightness {brightness:.0f} of 255"
    if brightness < MAX_BLACK_BRIGHTNESS:
        yield failure("exposure", f"the pictures are black ({measured})", "take the cap off the lens, or add light")
    elif brightness < MAX_DARK_BRIGHTNESS:
        yield warning("exposure", f"the pictures are dark ({measured})", "add light in front of the robot")
    elif brightness > MIN_OVEREXPOSED_BRIGHTNESS:
        yield warning("exposure", f"the pictures are overexposed ({measured})", "turn it away from the lamp or window")
    elif float(image.std()) < MIN_CONTRAST:
        cure = "check for a covered lens; mission robot camera list  (is it another camera?)"
        yield failure("exposure", f"the pictures have a single colour ({measured})", cure)
    else:
        yield Finding("exposure", measured)
