"""``mission see``: what perception finds in pictures, videos and cameras, as text, as JSON, and drawn."""

import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from math import degrees, inf, isfinite, radians
from pathlib import Path

import click

from config.colours import COLOURS
from config.library import find
from config.robot import RobotConfig
from drivers.api.senses import CameraKeys
from drivers.api.turn import UPRIGHT, Turn
from drivers.camera.declared import OPENCV
from drivers.camera.pictures import pictures
from drivers.camera.source import Kind, kind_of, shown
from drivers.errors import BadRequest
from drivers.pictures.capture import turned
from missions.assembly.gallery import gallery
from missions.assembly.models import face_detector
from missions.cli.keys import interruptible
from missions.cli.names import ROBOT
from missions.cli.numbers import InUnit
from missions.cli.outputs import wrote
from missions.cli.root import SUCCESS
from missions.library.drivers import load_robot
from missions.library.things import wanted
from missions.plugins.pictures.movie import CODECS, Movie, check_place
from missions.plugins.records.replay.frames import steady
from missions.plugins.setup.camera_page.served import CameraPage
from missions.plugins.setup.drawings import Drawings
from missions.plugins.setup.through import tell, through, through_own
from perception.annotate import annotate
from perception.api import Box, Detection, Image, Marker, Scene, Thing, Wanted
from perception.change import measure
from perception.faults import BadModel
from perception.finder import FaceFinder
from perception.geometry import Pinhole
from perception.identity import Recogniser
from perception.markers import MarkerSense
from perception.pupils import EyeFinder
from perception.spots import ThingSense
from perception.tracks import MARKER_FAMILIES, MarkerKind

# Looking at pictures and films frame by frame, as a robot's eyes would, without a robot.

IDEAL = CameraKeys(source="", field_of_view=radians(60), width=640, height=480, position=(0.0, 0.0, 0.0))
"""The camera of pictures of which nobody says what has taken them."""

PERIOD = 0.04
"""Seconds that count as passing from frame to frame."""


@dataclass(frozen=True, slots=True)
class Still:
    """A frame: a picture, and its time in seconds."""

    image: Image
    stamp: float


@dataclass(frozen=True, slots=True)
class SeenFace:
    """A face, its eyes, how far away it may be in metres, and whose it is where that was asked and can be said."""

    box: Box
    eyes: tuple[Box, ...]
    distance: float
    name: str = ""


@dataclass(frozen=True, slots=True)
class Seen:
    """All that one frame shows."""

    faces: tuple[SeenFace, ...]
    things: tuple[Thing, ...]
    markers: tuple[Marker, ...]
    scene: Scene


class Looker:
    """Looks at one frame after another: at a picture for itself, at a film from frame to frame.

    ``camera`` is the lens and the detector; ``people`` knows whose the faces are.
    """

    def __init__(
        self,
        camera: CameraKeys,
        things: Sequence[Wanted] = (),
        markers: str | None = None,
        people: Recogniser | None = None,
    ) -> None:
        self._camera = camera
        self._wanted = tuple(things)
        self._family = markers
        self._people = people
        self._detector = face_detector(camera)
        self._eyes = EyeFinder()
        self._film: Path | None = None
        self._begin()

    def look(self, path: Path, number: int, image: Image) -> Seen:
        """Return what frame ``number`` of the file at ``path`` shows. Raises ValueError for a detector's bad file."""
        height, width = image.shape[:2]
        lens = self._lens(width, height)
        still = kind_of(path) is Kind.PICTURE
        if still or path != self._film or number == 0:
            self._begin()
        self._film = None if still else path
        found: Sequence[Detection] = (
            self._detector.detect(image)
            if still
            else [sighting.detection for sighting in self._finder.find(image) if sighting.believed]
        )
        faces = tuple(self._face(image, each.box, lens) for each in found)
        things: tuple[Thing, ...] = ()
        markers: tuple[Marker, ...] = ()
        for look in (0, 1) if still else (1,):  # what is followed counts once it was seen twice: a picture twice over
            frame = Still(image, (number + look) * PERIOD)
            things = self._things.sense(frame, lens, None)
            markers = () if self._markers is None else self._markers.sense(frame, lens, None)
        return Seen(faces, things, markers, measure(image, stamp=number * PERIOD))

    def _face(self, image: Image, box: Box, lens: Pinhole) -> SeenFace:
        look = None if self._people is None else self._people.look(image, box)
        name = "" if look is None else look.verdict
        return SeenFace(box, self._eyes.find(image, box), lens.distance(box), name)

    def _begin(self) -> None:
        """Forget what was followed: another file begins."""
        self._finder = FaceFinder(self._detector)
        self._things = ThingSense(self._wanted, COLOURS)
        self._markers = None if self._family is None else MarkerSense(MarkerKind(self._family))

    def _lens(self, width: int, height: int) -> Pinhole:
        camera, upright = self._camera, self._camera.upright()
        view = camera.turn.view(camera.field_of_view, width, height)
        return Pinhole(width, height, view, upright.centre, upright.bent)


Shot = tuple[str, int, float, Image]
"""Where a picture is from, its number there and its time, and the picture."""

RATE = 12.5
"""Pictures a second of a film."""

EYES = ("", ", one eye", ", both eyes")


def _objects(ctx: click.Context, option: click.Parameter, values: tuple[str, ...]) -> tuple[Wanted, ...]:
    try:
        return tuple(wanted(value) for value in values)
    except LookupError as error:
        raise click.BadParameter(str(error.args[0]), ctx=ctx, param=option) from error


@click.command(epilog="Example: mission see 0 --things 'red ball' --annotate seen.webm")
@click.argument("files", type=click.Path(), nargs=-1, metavar="[FILES|CAMERA]...")
@click.option(
    "--things", multiple=True, metavar='"red ball"', callback=_objects, help="Look for an object too. Repeat for more."
)
@click.option(
    "--markers",
    is_flag=False,
    flag_value="4x4_50",
    type=click.Choice(list(MARKER_FAMILIES)),
    metavar="[FAMILY]",
    help="Look for markers too: 4x4_50, apriltag_36h11...",
)
@click.option("--people", is_flag=True, help="Say whose faces they are, of those whom `mission person` knows.")
@click.option("--robot", type=ROBOT, help="Whose camera: its lens, for distances, and its detector of faces.")
@click.option("--rotate", type=click.Choice(["0", "90", "180", "270"]), help="Turn the pictures clockwise, in degrees.")
@click.option(
    "--flip", type=click.Choice(["horizontal", "vertical", "both"]), help="Mirror the pictures, once they are turned."
)
@click.option("--json", "as_json", is_flag=True, help="One line of JSON a frame; boxes are [x, y, width, height].")
@click.option("--annotate", "folder", type=click.Path(path_type=Path), metavar="OUT",
              help="Draw it all: into the folder OUT, or a film (OUT.webm).")  # fmt: skip
@click.option(
    "--seconds", type=InUnit("s", 0.1), metavar="N", help="Look through a camera for so long; else until Ctrl-C."
)
@click.option("--view/--no-view", default=None, help="Serve a page that shows it live; the default on a terminal.")
def command(
    files: tuple[str, ...],
    things: tuple[Wanted, ...],
    markers: str | None,
    people: bool,
    robot: str | None,
    rotate: str | None,
    flip: str | None,
    as_json: bool,
    folder: Path | None,
    seconds: float | None,
    view: bool | None,
) -> int:
    """Look for faces, and for more, in pictures, videos and folders of them, or through a camera.

    A camera is a number, a device or an address (0, /dev/video2, http://...); with --robot and nothing else, it is that
    of the robot. It tells of one picture a second, with --json of each, and prints the link of a page that shows what
    it sees, for browsers of this computer. While a mission runs, its camera is taken: the page of `mission studio`
    shows it.
    """
    config = None if robot is None else load_robot(find("robots", robot))
    camera = None if config is None else config.camera
    if robot is not None and camera is None:
        raise click.UsageError(f"{robot} has no camera")
    if not files and camera is None:
        raise click.UsageError("which pictures, or which camera?\n  try: mission see 0")
    own = None if files or config is None or config.sections["camera"].driver == OPENCV else config
    files = files or (str(camera.source) if camera and own is None else "camera",)
    live = own is not None or (len(files) == 1 and kind_of(files[0]) in {Kind.DEVICE, Kind.URL})
    if view and not live:
        raise click.UsageError("--view is for a camera\n  try: mission see 0 --view")
    lens = _mounted(camera or IDEAL, rotate, flip)
    looker = Looker(lens, things, markers, gallery(lens, tell) if people else None)
    try:
        if live:
            device = files[0] if own is None else own.with_keys("camera", lens)
            shots = _live(device, None if camera is None else (camera.width, camera.height), lens.turn, seconds or inf)
        else:  # what a robot has filmed is upright
            shots = _stills(files, UPRIGHT if rotate is None and flip is None else lens.turn)
        asked = sys.stdout.isatty() and not as_json if view is None else view
        with interruptible(), _served() if live and asked else nullcontext() as page:
            written = _draw(_looked(shots, looker, page, as_json=as_json, live=live), folder, files)
    except BadRequest as error:
        raise click.UsageError(f"{error}" + (f"\n  try: {error.hint}" if error.hint else "")) from error
    except (FileNotFoundError, BadModel) as error:  # of a detector
        raise click.UsageError(f"{error}") from error
    if folder is not None:
        click.echo(wrote(folder, what=f"{written} pictures to "), err=as_json)
    return SUCCESS


def _stills(files: tuple[str, ...], turn: Turn) -> Iterator[Shot]:
    return ((str(path), number, number * PERIOD, turned(image, turn)) for path, number, image in pictures(files))


def _mounted(camera: CameraKeys, rotate: str | None, flip: str | None) -> CameraKeys:
    """Return the keys of a camera with the turn of the options, where they are given."""
    angle = camera.rotate if rotate is None else radians(float(rotate))
    return replace(camera, rotate=angle, flip=flip or camera.flip)


def _live(source: str | RobotConfig, size: tuple[int, int] | None, turn: Turn, seconds: float) -> Iterator[Shot]:
    """Yield what a source shows, or the camera of a robot that has none of OpenCV's sources."""
    if not isinstance(source, str):
        return ((source.name, number, *seen) for number, seen in enumerate(through_own(source, seconds)))
    return ((shown(source), number, *seen) for number, seen in enumerate(through(source, seconds, size, turn)))


@contextmanager
def _served() -> Iterator[CameraPage]:
    """Serve a page, and say where."""
    with closing(CameraPage()) as page:
        page.open()
        click.echo(f"live: {page.link}", err=True)
        yield page


def _looked(
    shots: Iterable[Shot], looker: Looker, page: CameraPage | None, *, as_json: bool, live: bool
) -> Iterator[tuple[Shot, Seen]]:
    """Look at pictures as they come, and say what each shows; of a camera, one a second in words. Ctrl-C ends that.

    A ``page`` shows each while somebody looks at it.
    """
    due = 0.0
    with suppress(KeyboardInterrupt) if live else nullcontext():
        for shot in shots:
            name, number, stamp, image = shot
            seen = looker.look(Path(name), number, image)
            if as_json or not live or stamp >= due:
                due = stamp + 1.0
                click.echo(
                    json.dumps(_data(name, number, seen)) if as_json else f"{name} frame {number}: {_words(seen)}"
                )
            if page is not None and page.watched:
                page.show(annotate(image, _marks(seen)), _words(seen))
            yield shot, seen


def _draw(looked: Iterable[tuple[Shot, Seen]], out: Path | None, files: tuple[str, ...]) -> int:
    """Write what was seen into ``out``, where there is one; return how many pictures that made."""
    if out is None:
        return sum(1 for _ in looked)
    if out.suffix in CODECS:
        check_place(out, "--annotate")
        marked = ((stamp, annotate(image, _marks(seen))) for (_, _, stamp, image), seen in looked)
        with Movie(out, rate=RATE, option="--annotate") as movie:
            for picture in steady(marked, RATE):
                movie.write(picture)
        if movie.trouble:
            raise click.ClickException(movie.trouble)
        return movie.pictures
    drawn, count = Drawings(out, files), 0
    for count, ((name, number, _, image), seen) in enumerate(looked, 1):  # noqa: B007 - they are counted
        drawn.write(Path(name), number, annotate(image, _marks(seen)))
    return count


def _data(name: str, number: int, seen: Seen) -> dict[str, object]:
    """Return what a frame shows for JSON."""
    return {
        "file": name,
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
