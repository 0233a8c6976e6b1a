"""A film of a run in simulated time: what the camera sees, beside the room from above and the robot's face."""

from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from drivers.screen.expression import expression
from drivers.screen.frame import frame
from drivers.sim.render import Renderer
from drivers.sim.topview import TopView
from missions.assembly.twins import Twins
from missions.cli.movie import Movie

RATE = 12.5
"""Pictures per second of simulated time."""


class Film:
    """Films ``twins`` into a file or, for any other name, into a folder of numbered pictures.

    Its camera is one of its own, in the place of the robot's: filming changes nothing of the run.
    Raises click.UsageError where the film cannot be written.
    """

    def __init__(self, path: Path, twins: Twins) -> None:
        self._movie = Movie(path, rate=RATE, option="--film")
        self._twins = twins
        self._renderer = Renderer(twins.world, twins.lens, noise=0.0)
        self._map = TopView(twins.world, (twins.lens.height * 4 // 3, twins.lens.height))
        self._trail: list[tuple[float, float]] = []
        self._open = False

    @property
    def trouble(self) -> str:
        """From when on it could not be written, and why; empty while all is well."""
        return self._movie.trouble

    def __enter__(self) -> Self:
        self._movie.__enter__()
        self._open = True
        self._twins.timeline.every(1 / RATE, self._take)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open = False
        self._movie.__exit__(kind, error, trace)

    def _take(self) -> None:
        if not self._open:
            return
        twins = self._twins
        now, pose, view = twins.timeline.clock.now(), twins.pose(), twins.viewpoint()
        self._trail.append((pose.x, pose.y))
        above = self._map.draw(now, pose, camera=view, field_of_view=twins.lens.field_of_view, trail=self._trail)
        panes = [self._renderer.draw(view, now), above]
        if twins.screen is not None:
            shown, height = twins.screen.shown(), twins.lens.height
            panes.append(frame(expression(shown, now), shown.text, (height * 2 // 3, height)))
        self._movie.write(np.hstack(panes))
