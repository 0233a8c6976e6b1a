"""Pictures read through OpenCV: of a webcam, a network stream, or a video file.

Calls of OpenCV may block without a time limit, so they are made in a process of their own (``drivers.camera.reader``).
"""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import cv2

from drivers.api import Image
from drivers.camera.source import Source, SourceKind, display_name, is_live, is_number, source_hint, source_kind
from drivers.errors import BadRequest, NotConnected
from drivers.finding.video import CSI_HINT, CSI_TROUBLE, is_csi
from drivers.pictures.decode import grab_picture, open_video
from drivers.transport.programs import explain_denied

_FALLBACK_RATE = 25.0  # frames a second of a video that does not say
_STREAM_TIMEOUT_MS = 3000


class VideoFeed:
    """Pictures read through ``cv2.VideoCapture``.

    ``name`` is the part in error messages. ``size`` (width, height in pixels) is requested from a device.
    ``connection`` is the file descriptor of a stream that is already open, else None.
    """

    def __init__(
        self, name: str, source: Source, size: tuple[int, int] | None = None, connection: int | None = None
    ) -> None:
        self._name = name
        self._kind = source_kind(source)
        self._source_name = display_name(source)
        self._is_live = is_live(source)
        self._source = int(str(source)) if is_number(source) else str(source)
        self._size = size
        self._connection = connection
        self._video: cv2.VideoCapture | None = None

    def start(self) -> float | None:
        """Open the source; return the seconds between the pictures of a file, None for a live source.

        Raises NotConnected. The error has the reason if it can be read from the file system; OpenCV gives none.
        """
        self._check_path()
        try:
            video = self._open_video()
        except BadRequest as error:
            raise NotConnected(f"{self._name}: {error}", hint=error.hint) from error
        if not video.isOpened():
            video.release()
            what = f"{self._name}: {self._source_name}: cannot be opened as a {self._kind}"
            raise NotConnected(what, hint=source_hint(self._source))
        self._video = video
        if self._is_live:
            return None
        rate = video.get(cv2.CAP_PROP_FPS)
        return 1.0 / (rate if 1.0 <= rate <= 240.0 else _FALLBACK_RATE)

    def grab(self, is_needed: Callable[[], bool]) -> Image | None:
        return None if self._video is None else grab_picture(self._video, is_needed)

    def stop(self) -> None:
        video, self._video = self._video, None
        if video is not None:
            video.release()

    def _check_path(self) -> None:
        """Raise NotConnected if the path is missing or not readable: OpenCV reports all failures alike."""
        if self._kind is SourceKind.URL or (self._kind is SourceKind.DEVICE and not self._source_name.startswith("/")):
            return
        device = self._kind is SourceKind.DEVICE
        if not Path(self._source_name).exists():
            what, hint = ("no such device", "`mission ports` lists the cameras that are there") if device else (
                "no such file", f"`ls {Path(self._source_name).parent}` lists what is there")  # fmt: skip
            raise NotConnected(f"{self._name}: {self._source_name}: {what}", hint=hint)
        if device and is_csi(Path(self._source_name)):
            raise NotConnected(f"{self._name}: {self._source_name}: {CSI_TROUBLE}", hint=CSI_HINT)
        if not os.access(self._source_name, os.R_OK):
            why, hint = (
                explain_denied(Path(self._source_name))
                if device
                else ("permission denied", f"`ls -l {self._source_name}`")
            )
            raise NotConnected(f"{self._name}: {self._source_name}: {why}", hint=hint)

    def _open_video(self) -> cv2.VideoCapture:
        if self._kind is SourceKind.DEVICE:
            backend = cv2.CAP_V4L2 if sys.platform == "linux" else cv2.CAP_ANY
            video = open_video(self._source, backend, [], name=self._source_name)
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
        source = self._source if self._connection is None else f"pipe:{self._connection}"
        return open_video(source, cv2.CAP_FFMPEG, limits, name=self._source_name)
