"""``mission see``: what perception finds in pictures and videos, as text, as JSON, and drawn."""

import json
from collections.abc import Iterator
from math import degrees, isfinite
from pathlib import Path

import click

from config.library import find
from drivers.api import DeviceStatus
from drivers.camera.pictures import pictures
from drivers.errors import BadRequest
from missions.assembly.gallery import gallery
from missions.cli.drawings import Drawings
from missions.cli.looking import IDEAL, Looker, Seen, SeenFace
from missions.cli.names import ROBOT
from missions.library.drivers import load_robot
from missions.library.things import wanted
from perception.annotate import annotate
from perception.api import Box, Marker, Thing
from perception.faults import BadModel
from perception.markers import DICTIONARIES
from perception.wanted import Wanted

EYES = ("", ", one eye", ", both eyes")


def _objects(ctx: click.Context, option: click.Parameter, values: tuple[str, ...]) -> tuple[Wanted, ...]:
    try:
        return tuple(wanted(value) for value in values)
    except LookupError as error:
        raise click.BadParameter(str(error.args[0]), ctx=ctx, param=option) from error


@click.command(epilog="Example: mission see photo.jpg --annotate drawn")
@click.argument("files", type=click.Path(), nargs=-1, required=True, metavar="FILES...")
@click.option(
    "--things", multiple=True, metavar='"red ball"', callback=_objects, help="Look for an object too. Repeat for more."
)
@click.option(
    "--markers",
    is_flag=False,
    flag_value="4x4_50",
    type=click.Choice(list(DICTIONARIES)),
    metavar="[FAMILY]",
    help="Look for markers too: 4x4_50, apriltag_36h11...",
)
@click.option("--people", is_flag=True, help="Say whose faces they are, of those whom `mission person` knows.")
@click.option("--robot", type=ROBOT, help="Whose camera: its lens, for distances, and its detector of faces.")
@click.option("--json", "as_json", is_flag=True, help="One line of JSON a frame; boxes are [x, y, width, height].")
@click.option("--annotate", "folder", type=click.Path(path_type=Path), metavar="OUT", help="Draw it all, into OUT.")
def command(
    files: tuple[str, ...],
    things: tuple[Wanted, ...],
    markers: str | None,
    people: bool,
    robot: str | None,
    as_json: bool,
    folder: Path | None,
) -> int:
    """Look for faces, and for more, in pictures, videos and folders of them."""
    camera = None if robot is None else load_robot(find("robots", robot)).camera
    known = gallery(camera or IDEAL, _warn) if people else None
    looker = Looker(camera or IDEAL, things, markers, known)
    drawn = None if folder is None else Drawings(folder, files)
    try:
        for path, number, image in pictures(files):
            seen = looker.look(path, number, image)
            click.echo(json.dumps(_data(path, number, seen)) if as_json else f"{path} frame {number}: {_words(seen)}")
            if drawn is not None:
                drawn.write(path, number, annotate(image, _marks(seen)))
    except BadRequest as error:
        raise click.UsageError(f"{error}" + (f"\n  try: {error.hint}" if error.hint else "")) from error
    except (FileNotFoundError, BadModel) as error:  # of a detector
        raise click.UsageError(f"{error}") from error
    return 0


def _warn(notice: DeviceStatus) -> None:
    click.echo(notice.what + (f"\n  try: {notice.hint}" if notice.hint else ""), err=True)


def _data(path: Path, number: int, seen: Seen) -> dict[str, object]:
    """Return what a frame shows for JSON."""
    return {
        "file": str(path),
        "frame": number,
        "faces": [_numbers(face.box) for face in seen.faces],
        "names": [face.name for face in seen.faces],
        "eyes": [[_numbers(eye) for eye in face.eyes] for face in seen.faces],
        "things": [
            {"name": each.name, "shape": each.shape, "box": _numbers(each.box), "distance": _metres(each.distance)}
            for each in seen.things
        ],
        "markers": [
            {"number": each.number, "box": _numbers(each.box), "distance": _metres(each.distance),
             "heading": round(each.heading, 3)}
            for each in seen.markers
        ],
        "brightness": round(seen.scene.brightness, 1),
        "contrast": round(seen.scene.contrast, 1),
    }  # fmt: skip


def _numbers(box: Box) -> list[int]:
    return [round(value) for value in (box.x, box.y, box.width, box.height)]


def _metres(distance: float) -> float | None:
    return round(distance, 2) if isfinite(distance) else None


def _words(seen: Seen) -> str:
    """Say what a frame shows."""
    count = len(seen.faces)
    faces = f"{count} face{'s' if count > 1 else ''}" if count else "no face"
    places = [f"{_named(face)}{_size(face.box)}{EYES[len(face.eyes)]}" for face in seen.faces]
    others = [f"{each.name} {_size(each.box)}{_away(each)}" for each in seen.things]
    others += [f"marker {each.number} {_size(each.box)}{_away(each)}, {_turned(each)}" for each in seen.markers]
    scene = f"brightness {seen.scene.brightness:.0f}, contrast {seen.scene.contrast:.0f}"
    return "; ".join([faces + (": " + places[0] if places else ""), *places[1:], *others, scene])


def _named(face: SeenFace) -> str:
    return f"{face.name}, " if face.name else ""


def _size(box: Box) -> str:
    return f"{box.width:.0f} x {box.height:.0f} at ({box.x:.0f}, {box.y:.0f})"


def _away(what: Thing | Marker | SeenFace) -> str:
    return f", {what.distance:.1f} m" if isfinite(what.distance) else ""


def _turned(marker: Marker) -> str:
    return f"turned {degrees(marker.heading):+.0f} deg"


def _marks(seen: Seen) -> Iterator[tuple[Box, str]]:
    """Yield what is drawn: boxes with their labels."""
    for face in seen.faces:
        yield face.box, f"{face.name or 'face'}{_away(face)}"
        yield from ((eye, "") for eye in face.eyes)
    yield from ((each.box, f"{each.name}{_away(each)}") for each in seen.things)
    yield from ((each.box, f"{each.number}{_away(each)}") for each in seen.markers)
