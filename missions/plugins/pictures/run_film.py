"""Film of a run in simulated time: the camera's view, a plan of the room, and the robot's face.

A robot in physics is drawn too; without a camera, it takes the place of the camera's view.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

import click
import numpy as np

from drivers.screen.drawing import face_image
from drivers.screen.expression import face_expression
from drivers.sim.render import Renderer
from drivers.sim.topview import TopView
from missions.assembly.twins import Twins
from missions.cli.session import RunSession
from missions.plugins.pictures.movie import Movie, check_output
from missions.plugins.pictures.options import FilmOptions

if TYPE_CHECKING:
    from drivers.sim.rigid.body_camera import BodyCamera

FRAME_RATE = 12.5
"""Pictures of the film per second of simulated time."""


class RunFilm:
    """Films the simulated robot ``twins`` to a file or, for a suffix that is not a film's, to a folder of pictures.

    The film has a camera of its own, so filming does not change the run. Raises click.UsageError if the film cannot be
    written.
    """

    def __init__(self, path: Path, twins: Twins) -> None:
        self.path = path
        self._movie = Movie(path, rate=FRAME_RATE, option="--film")
        self._twins = twins
        self._renderer = Renderer(twins.world, twins.lens, noise=0.0)
        self._map = TopView(twins.world, (twins.lens.height * 4 // 3, twins.lens.height))
        self._body = self._body_camera()
        self._trail: list[tuple[float, float]] = []
        self._open = False

    @property
    def error(self) -> str:
        """Message with the time of the first picture that could not be written; empty without an error."""
        return self._movie.error

    @property
    def is_written(self) -> bool:
        """Whether any pictures were written."""
        return self._movie.is_written

    def __enter__(self) -> Self:
        self._movie.__enter__()
        self._open = True
        self._twins.timeline.call_every(1 / FRAME_RATE, self._take)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open = False
        if self._body is not None:
            self._body.close()
        self._movie.__exit__(kind, error, trace)

    def _body_camera(self) -> "BodyCamera | None":
        """Return the camera that draws the robot's body; None for a robot without physics."""
        if self._twins.scene is None:
            return None
        from drivers.sim.rigid.body_camera import BodyCamera  # noqa: PLC0415 - only for physics

        return BodyCamera(self._twins.scene, (self._twins.lens.width, self._twins.lens.height))

    def _take(self) -> None:
        if not self._open:
            return
        twins = self._twins
        now, pose, view = twins.timeline.clock.now(), twins.pose(), twins.viewpoint()
        self._trail.append((pose.x, pose.y))
        above = self._map.draw(now, pose, camera=view, field_of_view=twins.lens.field_of_view, trail=self._trail)
        panes = [above]
        if self._body is not None:
            panes.insert(0, self._body.draw(now))
        if self._body is None or "camera" in twins.parts:
            panes.insert(0, self._renderer.draw(view, now))
        if twins.screen is not None:
            shown, height = twins.screen.content(), twins.lens.height
            panes.append(face_image(face_expression(shown, now), shown.text, (height * 2 // 3, height)))
        self._movie.write(np.hstack(panes))


@contextmanager
def film_run(options: FilmOptions, session: RunSession) -> Iterator[None]:
    """Film a run in simulated time inside the context. Raises click.UsageError if the film cannot be started.

    A later write error is reported, and the run goes on.
    """
    path, twins = options.film, session.runner.twins
    if path is None or twins is None:
        raise click.UsageError("--film needs simulated time: add --simulate fast")
    check_output(path, "--film")
    film = RunFilm(path, twins)
    session.outputs.append(lambda: film.path if film.is_written else None)
    with film:
        yield
    if film.error:
        with suppress(OSError):
            click.echo(f"mission: {film.error}", err=True)
