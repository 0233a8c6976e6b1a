"""Writer of annotated pictures that never overwrites its inputs."""

import itertools
from pathlib import Path

import click
import cv2

from config.file_io import PRIVATE_MODE, save_file
from drivers.api import Image
from drivers.camera.source import SourceKind, source_kind
from missions.cli.outputs import report_write_errors


class AnnotatedPictures:
    """Writer of annotated pictures to a folder; never overwrites an input or another picture of this run."""

    def __init__(self, folder: Path, inputs: tuple[str, ...]) -> None:
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            raise click.BadParameter(f"{folder}: {error.strerror}", param_hint="--annotate") from error
        self._folder = folder
        self._inputs = [Path(name) for name in inputs]
        self._names: dict[Path, str] = {}

    def write(self, path: Path, number: int, image: Image) -> None:
        """Write the annotated ``image`` of frame ``number`` of the file at ``path``."""
        stem = self._stem(path)
        target = self._folder / (
            f"{stem}.png" if source_kind(path) is SourceKind.PICTURE else f"{stem}_{number:05d}.png"
        )
        looked_at = (path, *self._inputs)
        if target.exists() and any(target.samefile(each) for each in looked_at if each.exists()):
            raise click.UsageError(f"--annotate: {target} is an input; choose another folder")
        done, packed = cv2.imencode(".png", image)
        if not done:
            raise click.ClickException(f"{target}: cannot be written")
        with report_write_errors(target, "--annotate"):
            save_file(target, packed.tobytes(), PRIVATE_MODE)

    def _stem(self, path: Path) -> str:
        """Return a stem for the file names of an input file's pictures, unique to this file, such as "astro-2"."""
        if path not in self._names:
            taken = set(self._names.values())
            tries = (path.stem if n == 1 else f"{path.stem}-{n}" for n in itertools.count(1))
            self._names[path] = next(name for name in tries if name not in taken)
        return self._names[path]
