"""``mission see``: what perception finds in pictures and videos, as text, as JSON, and drawn."""

import itertools
import json
from collections.abc import Iterator
from pathlib import Path

import click
import cv2

from drivers.camera.pictures import pictures
from drivers.camera.source import Kind, kind_of
from drivers.errors import BadRequest
from perception.annotate import annotate
from perception.api import Box, Image
from perception.faces import HaarFaces
from perception.finder import FaceFinder


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option("--json", "as_json", is_flag=True, help="One line of JSON a frame; boxes are [x, y, width, height].")
@click.option("--annotate", "folder", type=click.Path(path_type=Path), metavar="OUT", help="Draw the faces, into OUT.")
def command(files: tuple[str, ...], as_json: bool, folder: Path | None) -> int:
    """Look for faces in pictures, videos and folders of them."""
    drawn = None if folder is None else Drawings(folder, files)
    try:
        for path, number, image, boxes in _seen(files):
            if as_json:
                faces = [[round(value) for value in (box.x, box.y, box.width, box.height)] for box in boxes]
                click.echo(json.dumps({"file": str(path), "frame": number, "faces": faces}))
            else:
                click.echo(f"{path} frame {number}: {_words(boxes)}")
            if drawn is not None:
                drawn.write(path, number, annotate(image, ((box, "face") for box in boxes)))
    except BadRequest as error:
        raise click.UsageError(f"{error}" + (f"\n  try: {error.hint}" if error.hint else "")) from error
    return 0


def _seen(files: tuple[str, ...]) -> Iterator[tuple[Path, int, Image, list[Box]]]:
    """Search a picture for itself, a video from frame to frame."""
    detector, finder, video = HaarFaces(), None, None
    for path, number, image in pictures(files):
        if kind_of(path) is Kind.PICTURE:
            yield path, number, image, [found.box for found in detector.detect(image)]
            continue
        if finder is None or path != video or number == 0:
            finder, video = FaceFinder(detector), path
        yield path, number, image, [sighting.detection.box for sighting in finder.find(image)]


class Drawings:
    """Pictures with faces drawn in, in a folder; never over what was looked at, nor one over another."""

    def __init__(self, folder: Path, inputs: tuple[str, ...]) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise click.BadParameter(f"{folder}: {error.strerror}", param_hint="--annotate") from error
        self._folder = folder
        self._inputs = [Path(name) for name in inputs]
        self._names: dict[Path, str] = {}

    def write(self, path: Path, number: int, image: Image) -> None:
        """Write one picture."""
        stem = self._stem(path)
        target = self._folder / (f"{stem}.png" if kind_of(path) is Kind.PICTURE else f"{stem}_{number:05d}.png")
        looked_at = (path, *self._inputs)
        if target.exists() and any(target.samefile(each) for each in looked_at if each.exists()):
            raise click.UsageError(f"--annotate: {target} is one of the pictures themselves; choose another folder")
        if not cv2.imwrite(str(target), image):
            raise click.ClickException(f"{target}: cannot be written")

    def _stem(self, path: Path) -> str:
        """Return a name of its own for each file that is looked at: "astro", then "astro-2"."""
        if path not in self._names:
            taken = set(self._names.values())
            tries = (path.stem if n == 1 else f"{path.stem}-{n}" for n in itertools.count(1))
            self._names[path] = next(name for name in tries if name not in taken)
        return self._names[path]


def _words(boxes: list[Box]) -> str:
    if not boxes:
        return "no face"
    places = "; ".join(f"{box.width:.0f} x {box.height:.0f} at ({box.x:.0f}, {box.y:.0f})" for box in boxes)
    return f"{len(boxes)} face{'s' if len(boxes) > 1 else ''}: {places}"
