"""A camera over OpenCV: a webcam, a stream from the network, or a video file that stands in for one."""

import os
import re
import sys
from collections.abc import Callable
from math import radians
from pathlib import Path

import cv2

from drivers.api import Image, Report, ignore
from drivers.camera.decode import grab, opened
from drivers.camera.source import Kind, Source, is_number, kind_of
from drivers.camera.threaded import ThreadedCamera
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected

_FALLBACK_RATE = 25.0  # frames a second of a video that does not say
_STREAM_TIMEOUT_MS = 3000


class VideoFeed:
    """Pictures through ``cv2.VideoCapture``. ``size`` (width, height in pixels) is asked of a device."""

    def __init__(self, name: str, source: Source, size: tuple[int, int] | None = None) -> None:
        self._name = name
        self._kind = kind_of(source)
        self.what = re.sub(r"//[^/@]*@", "//***@", str(source))  # no password in a message
        if is_number(source):  # OpenCV's numbers are those of /dev/video* on Linux, and nameless elsewhere
            self.what = f"/dev/video{self.what}" if sys.platform == "linux" else f"camera {self.what}"
        self._source = int(str(source)) if is_number(source) else str(source)
        self._size = size
        self._video: cv2.VideoCapture | None = None

    @property
    def hint(self) -> str:
        """What to type next when it opens and yet gives no picture."""
        if self._kind is Kind.DEVICE:
            return f"`fuser -v {self.what}` shows who else uses it; one camera often has several numbers: try the next"
        if self._kind is Kind.URL:
            return f"`ffplay {self.what}` shows whether the stream runs"
        return f"`ffprobe {self.what}` shows what is in it"

    def start(self) -> float | None:
        """Open the source; return the seconds between the pictures of a file, None for a live source.

        Raises NotConnected with the reason as far as the file system can tell it.
        """
        self._check()
        try:
            video = self._opened()
        except BadRequest as error:
            raise NotConnected(f"{self._name}: {error}", hint=error.hint) from error
        if not video.isOpened():
            video.release()
            raise NotConnected(f"{self._name}: {self.what}: cannot be opened as a {self._kind}", hint=self.hint)
        self._video = video
        if self._kind is not Kind.VIDEO:
            return None
        rate = video.get(cv2.CAP_PROP_FPS)
        return 1.0 / (rate if 1.0 <= rate <= 240.0 else _FALLBACK_RATE)

    def grab(self, wanted: Callable[[], bool]) -> Image | None:
        """Return the next picture, None when there is no more: see Feed."""
        return None if self._video is None else grab(self._video, wanted)

    def stop(self) -> None:
        """Release the source."""
        video, self._video = self._video, None
        if video is not None:
            video.release()

    def _check(self) -> None:
        """Raise NotConnected for a path that is absent or forbidden: OpenCV says the same of all failures."""
        if self._kind is Kind.URL or (self._kind is Kind.DEVICE and not self.what.startswith("/")):
            return
        device = self._kind is Kind.DEVICE
        if not Path(self.what).exists():
            what, hint = ("no such device", "`ls -l /dev/video*` lists the cameras that are there") if device else (
                "no such file", f"`ls {Path(self.what).parent}` lists what is there")  # fmt: skip
            raise NotConnected(f"{self._name}: {self.what}: {what}", hint=hint)
        if not os.access(self.what, os.R_OK):
            cure = "`sudo usermod -aG video $USER`, then log in again" if device else f"`ls -l {self.what}`"
            raise NotConnected(f"{self._name}: {self.what}: permission denied", hint=cure)

    def _opened(self) -> cv2.VideoCapture:
        if self._kind is Kind.DEVICE:
            backend = cv2.CAP_V4L2 if sys.platform == "linux" else cv2.CAP_ANY
            video = opened(self._source, backend, [], what=self.what)
            video.set(cv2.CAP_PROP_BUFFERSIZE, 1)
            if self._size is not None:
                video.set(cv2.CAP_PROP_FRAME_WIDTH, self._size[0])
                video.set(cv2.CAP_PROP_FRAME_HEIGHT, self._size[1])
            return video
        limits = [
            cv2.CAP_PROP_OPEN_TIMEOUT_MSEC,
            _STREAM_TIMEOUT_MS,
            cv2.CAP_PROP_READ_TIMEOUT_MSEC,
            _STREAM_TIMEOUT_MS,
        ]
        return opened(self._source, cv2.CAP_FFMPEG, limits, what=self.what)


class OpenCVCamera(ThreadedCamera):
    """A webcam (number or device path), a stream (address) or a video file; meets ``drivers.api.Camera``.

    A file plays at its own rate on the clock, and with ``loop`` again and again: a clip stands in for a camera that
    goes on. A stream counts as live. ``size`` (width, height) is a wish that only devices hear. Stamps are the time
    at which the picture arrived, a few tens of milliseconds after its exposure.
    """

    def __init__(
        self,
        source: Source,
        clock: Clock,
        *,
        name: str = "camera",
        field_of_view: float = radians(60.0),
        size: tuple[int, int] | None = None,
        loop: bool = True,
        retry: float = 1.0,
        report: Report = ignore,
    ) -> None:
        super().__init__(
            lambda: VideoFeed(name, source, size),
            clock,
            name=name,
            field_of_view=field_of_view,
            loop=loop,
            retry=retry,
            report=report,
        )
