"""A film of a run in simulated time: what the camera sees, beside the room from above."""

from pathlib import Path
from types import TracebackType
from typing import Self

import click
import cv2
import numpy as np

from drivers.api import Image
from drivers.sim.render import Renderer
from drivers.sim.topview import TopView
from missions.assembly.twins import Twins
from missions.cli.orders import FILMS

RATE = 12.5
"""Pictures per second of simulated time."""

CODECS = {".mp4": "mp4v", ".avi": "MJPG"}
"""By the ending of a film: codecs that come with OpenCV's wheels."""


class Film:
    """Films ``twins`` into a file or, for any other name, into a folder of numbered pictures.

    Its camera is one of its own, in the place of the robot's: filming changes nothing of the run.
    Raises click.UsageError where the film cannot be written.
    """

    def __init__(self, path: Path, twins: Twins) -> None:
        self._path = path
        self._twins = twins
        self._renderer = Renderer(twins.world, twins.lens, noise=0.0)
        self._map = TopView(twins.world, (twins.lens.height * 4 // 3, twins.lens.height))
        self._trail: list[tuple[float, float]] = []
        self._writer: cv2.VideoWriter | None = None
        self._number = 0
        self._open = False

    def __enter__(self) -> Self:
        if self._path.suffix not in FILMS:
            self._path.mkdir(parents=True, exist_ok=True)
        self._open = True
        self._twins.timeline.every(1 / RATE, self._take)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open = False
        if self._writer is not None:
            self._writer.release()

    def _take(self) -> None:
        if not self._open:
            return
        twins = self._twins
        now, pose, view = twins.timeline.clock.now(), twins.pose(), twins.viewpoint()
        self._trail.append((pose.x, pose.y))
        above = self._map.draw(now, pose, camera=view, field_of_view=twins.lens.field_of_view, trail=self._trail)
        self._write(np.hstack((self._renderer.draw(view, now), above)))
        self._number += 1

    def _write(self, picture: Image) -> None:
        if self._path.suffix not in FILMS:
            written = cv2.imwrite(str(self._path / f"{self._number:05d}.jpg"), picture)
        else:
            if self._writer is None:
                codec = cv2.VideoWriter.fourcc(*CODECS[self._path.suffix])
                self._writer = cv2.VideoWriter(str(self._path), codec, RATE, (picture.shape[1], picture.shape[0]))
            written = self._writer.isOpened()
            self._writer.write(picture)
        if not written:
            raise click.UsageError(f"--film: cannot write {self._path}")
