"""``mission see``: percepts in pictures, videos and cameras, as text, JSON and drawings."""

import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from math import degrees, inf, isfinite, radians
from pathlib import Path

import click

from config.colours import COLOURS
from config.library import find_file
from config.robot import RobotConfig
from drivers.api.image_orientation import UPRIGHT, ImageOrientation
from drivers.api.sensor_sections import CameraKeys
from drivers.camera.declared import OPENCV
from drivers.camera.picture_files import iter_pictures
from drivers.camera.source import SourceKind, display_name, source_kind
from drivers.errors import BadRequest
from drivers.pictures.capture import turn_image
from missions.assembly.gallery import gallery
from missions.assembly.models import face_detector
from missions.cli.keys import interruptible
from missions.cli.names import ROBOT
from missions.cli.numbers import QuantityInUnit
from missions.cli.outputs import written_message
from missions.cli.root import SUCCESS
from missions.library.drivers import load_robot
from missions.library.lookups import find_object
from missions.plugins.pictures.movie import CODECS, Movie, check_output
from missions.plugins.records.replay.frames import resample_frames
from missions.plugins.setup.annotated_pictures import AnnotatedPictures
from missions.plugins.setup.camera_frames import camera_frames, print_camera_status, robot_camera_frames
from missions.plugins.setup.camera_page.server import CameraPage
from perception.annotate import annotate
from perception.api import Box, Detection, Image, Marker, Scene, Thing, ThingSpec
from perception.colour_spots import ThingSense
from perception.eye_finder import EyeFinder
from perception.face_finder import FaceFinder
from perception.geometry import Pinhole
from perception.identity import FaceRecogniser
from perception.markers import MarkerSense
from perception.model_files import ModelFileError
from perception.scene_motion import measure_scene
from perception.tracks import MARKER_FAMILIES, MarkerSet

# Perception of pictures and videos without a robot.

DEFAULT_CAMERA = CameraKeys(source="", field_of_view=radians(60), width=640, height=480, position=(0.0, 0.0, 0.0))
"""Assumed camera of pictures if no robot is named."""

FRAME_INTERVAL = 0.04
"""Assumed seconds between two frames of a video."""


@dataclass(frozen=True, slots=True)
class StillFrame:
    """A frame: a picture, and its time in seconds."""

    image: Image
    stamp: float


@dataclass(frozen=True, slots=True)
class SeenFace:
    """A face, its eyes, its estimated distance in metres, and the person's name if requested and known."""

    box: Box
    eyes: tuple[Box, ...]
    distance: float
    name: str = ""


@dataclass(frozen=True, slots=True)
class FrameContents:
    """All percepts of a frame: faces, objects and markers."""

    faces: tuple[SeenFace, ...]
    things: tuple[Thing, ...]
    markers: tuple[Marker, ...]
    scene: Scene


class FrameAnalyser:
    """Analyses pictures independently, and videos with tracking from frame to frame.

    ``camera`` has the lens and the detector; ``people`` recognises faces.
    """

    def __init__(
        self,
        camera: CameraKeys,
        things: Sequence[ThingSpec] = (),
        markers: str | None = None,
        people: FaceRecogniser | None = None,
    ) -> None:
        self._camera = camera
        self._objects = tuple(things)
        self._family = markers
        self._people = people
        self._detector = face_detector(camera)
        self._eyes = EyeFinder()
        self._film_path: Path | None = None
        self._reset()

    def analyse(self, path: Path, number: int, image: Image) -> FrameContents:
        """Return the percepts of frame ``number`` of the file at ``path``.

        Raises ValueError for an invalid detector file.
        """
        height, width = image.shape[:2]
        lens = self._lens(width, height)
        still = source_kind(path) is SourceKind.PICTURE
        if still or path != self._film_path or number == 0:
            self._reset()
        self._film_path = None if still else path
        found: Sequence[Detection] = (
            self._detector.detect(image)
            if still
            else [sighting.detection for sighting in self._finder.find(image) if sighting.is_believed]
        )
        faces = tuple(self._face(image, each.box, lens) for each in found)
        things: tuple[Thing, ...] = ()
        markers: tuple[Marker, ...] = ()
        for look in (0, 1) if still else (1,):  # trackers confirm on the second frame, so analyse a picture twice
            frame = StillFrame(image, (number + look) * FRAME_INTERVAL)
            things = self._things.sense(frame, lens, None)
            markers = () if self._markers is None else self._markers.sense(frame, lens, None)
        return FrameContents(faces, things, markers, measure_scene(image, stamp=number * FRAME_INTERVAL))

    def _face(self, image: Image, box: Box, lens: Pinhole) -> SeenFace:
        look = None if self._people is None else self._people.match(image, box)
        name = "" if look is None else look.verdict
        return SeenFace(box, self._eyes.find(image, box), lens.face_distance(box), name)

    def _reset(self) -> None:
        """Reset the trackers, because the next frame is from another file."""
        self._finder = FaceFinder(self._detector)
        self._things = ThingSense(self._objects, COLOURS)
        self._markers = None if self._family is None else MarkerSense(MarkerSet(self._family))

    def _lens(self, width: int, height: int) -> Pinhole:
        camera, upright = self._camera, self._camera.upright()
        view = camera.orientation.field_of_view(camera.field_of_view, width, height)
        return Pinhole(width, height, view, upright.centre, upright.distortion_coefficients)


FrameShot = tuple[str, int, float, Image]
"""A picture to analyse: source, frame number, time (s) and image."""

FILM_RATE = 12.5
"""Frames per second at which annotated videos are exported."""

EYE_TEXTS = ("", ", one eye", ", both eyes")


def _parse_objects(ctx: click.Context, option: click.Parameter, values: tuple[str, ...]) -> tuple[ThingSpec, ...]:
    try:
        return tuple(find_object(value) for value in values)
    except LookupError as error:
        raise click.BadParameter(str(error.args[0]), ctx=ctx, param=option) from error


@click.command(epilog="Example: mission see 0 --things 'red ball' --annotate seen.webm")
@click.argument("files", type=click.Path(), nargs=-1, metavar="[FILES|CAMERA]...")
@click.option(
    "--things",
    multiple=True,
    metavar='"red ball"',
    callback=_parse_objects,
    help="Also find this object; repeatable.",
)
@click.option(
    "--markers",
    is_flag=False,
    flag_value="4x4_50",
    type=click.Choice(list(MARKER_FAMILIES)),
    metavar="[FAMILY]",
    help="Also find markers: 4x4_50, apriltag_36h11...",
)
@click.option("--people", is_flag=True, help="Recognise the people added with `mission person`.")
@click.option("--robot", type=ROBOT, help="Robot with the lens (for distances) and the face detector.")
@click.option(
    "--rotate", type=click.Choice(["0", "90", "180", "270"]), help="Clockwise rotation of the pictures, in degrees."
)
@click.option(
    "--flip",
    type=click.Choice(["horizontal", "vertical", "both"]),
    help="Mirroring of the pictures, after the rotation.",
)
@click.option(
    "--json", "as_json", is_flag=True, help="Print one line of JSON per frame; boxes are [x, y, width, height]."
)
@click.option("--annotate", "folder", type=click.Path(path_type=Path), metavar="OUT",
              help="Write annotated pictures to the folder OUT, or a film (OUT.webm).")  # fmt: skip
@click.option(
    "--seconds",
    type=QuantityInUnit("s", 0.1),
    metavar="N",
    help="Duration for a camera; by default until Ctrl-C.",
)
@click.option("--view/--no-view", default=None, help="Serve a live page; the default on a terminal.")
def command(
    files: tuple[str, ...],
    things: tuple[ThingSpec, ...],
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
    """Find faces, objects and markers in pictures, videos, folders, or through a camera.

    A camera is a number, a device or an address (0, /dev/video2, http://...); with --robot alone, it is the robot's.
    Prints the detections once per second (with --json, of every picture), and the link of a live page. While a
    mission runs, its camera is in use: the page of `mission studio` shows it.
    """
    config = None if robot is None else load_robot(find_file("robots", robot))
    camera = None if config is None else config.camera
    if robot is not None and camera is None:
        raise click.UsageError(f"{robot} has no camera")
    if not files and camera is None:
        raise click.UsageError("no pictures and no camera given\n  try: mission see 0")
    own = None if files or config is None or config.sections["camera"].driver == OPENCV else config
    files = files or (str(camera.source) if camera and own is None else "camera",)
    live = own is not None or (len(files) == 1 and source_kind(files[0]) in {SourceKind.DEVICE, SourceKind.URL})
    if view and not live:
        raise click.UsageError("--view needs a camera\n  try: mission see 0 --view")
    lens = _with_turn(camera or DEFAULT_CAMERA, rotate, flip)
    looker = FrameAnalyser(lens, things, markers, gallery(lens, print_camera_status) if people else None)
    try:
        if live:
            device = files[0] if own is None else own.with_keys("camera", lens)
            shots = _live_shots(
                device, None if camera is None else (camera.width, camera.height), lens.orientation, seconds or inf
            )
        else:  # recorded pictures of a robot are upright already
            shots = _file_shots(files, UPRIGHT if rotate is None and flip is None else lens.orientation)
        show_page = sys.stdout.isatty() and not as_json if view is None else view
        with interruptible(), _serve_page() if live and show_page else nullcontext() as page:
            written = _write_annotated(_analyse_shots(shots, looker, page, as_json=as_json, live=live), folder, files)
    except BadRequest as error:
        raise click.UsageError(f"{error}" + (f"\n  try: {error.hint}" if error.hint else "")) from error
    except (FileNotFoundError, ModelFileError) as error:  # the model file of a detector
        raise click.UsageError(f"{error}") from error
    if folder is not None:
        click.echo(written_message(folder, subject=f"{written} pictures to "), err=as_json)
    return SUCCESS


def _file_shots(files: tuple[str, ...], turn: ImageOrientation) -> Iterator[FrameShot]:
    return (
        (str(path), number, number * FRAME_INTERVAL, turn_image(image, turn))
        for path, number, image in iter_pictures(files)
    )


def _with_turn(camera: CameraKeys, rotate: str | None, flip: str | None) -> CameraKeys:
    """Return the keys of a camera, with the rotation and flip of the options."""
    angle = camera.rotate if rotate is None else radians(float(rotate))
    return replace(camera, rotate=angle, flip=flip or camera.flip)


def _live_shots(
    source: str | RobotConfig, size: tuple[int, int] | None, turn: ImageOrientation, seconds: float
) -> Iterator[FrameShot]:
    """Yield the pictures of a camera source, or of a robot's own camera."""
    if not isinstance(source, str):
        return ((source.name, number, *seen) for number, seen in enumerate(robot_camera_frames(source, seconds)))
    return (
        (display_name(source), number, *seen) for number, seen in enumerate(camera_frames(source, seconds, size, turn))
    )


@contextmanager
def _serve_page() -> Iterator[CameraPage]:
    """Serve the live page, and print its link."""
    with closing(CameraPage()) as page:
        page.open()
        click.echo(f"live: {page.link}", err=True)
        yield page


def _analyse_shots(
    shots: Iterable[FrameShot], analyser: FrameAnalyser, page: CameraPage | None, *, as_json: bool, live: bool
) -> Iterator[tuple[FrameShot, FrameContents]]:
    """Analyse pictures and print their percepts; yield each picture with its percepts.

    Of a ``live`` source, only one picture a second is printed, but all with ``as_json``; Ctrl-C ends it. A ``page``
    shows each picture while it has viewers.
    """
    due = 0.0
    with suppress(KeyboardInterrupt) if live else nullcontext():
        for shot in shots:
            name, number, stamp, image = shot
            seen = analyser.analyse(Path(name), number, image)
            if as_json or not live or stamp >= due:
                due = stamp + 1.0
                click.echo(
                    json.dumps(_frame_data(name, number, seen))
                    if as_json
                    else f"{name} frame {number}: {_frame_text(seen)}"
                )
            if page is not None and page.has_viewers:
                page.show(annotate(image, _labelled_boxes(seen)), _frame_text(seen))
            yield shot, seen


def _write_annotated(
    analysed: Iterable[tuple[FrameShot, FrameContents]], out: Path | None, files: tuple[str, ...]
) -> int:
    """Write annotated pictures to ``out``, if given; return their number."""
    if out is None:
        return sum(1 for _ in analysed)
    if out.suffix in CODECS:
        check_output(out, "--annotate")
        marked = ((stamp, annotate(image, _labelled_boxes(seen))) for (_, _, stamp, image), seen in analysed)
        with Movie(out, rate=FILM_RATE, option="--annotate") as movie:
            for picture in resample_frames(marked, FILM_RATE):
                movie.write(picture)
        if movie.error:
            raise click.ClickException(movie.error)
        return movie.pictures
    drawn, count = AnnotatedPictures(out, files), 0
    for count, ((name, number, _, image), seen) in enumerate(analysed, 1):  # noqa: B007 - they are counted
        drawn.write(Path(name), number, annotate(image, _labelled_boxes(seen)))
    return count


def _frame_data(name: str, number: int, contents: FrameContents) -> dict[str, object]:
    """Return the percepts of a frame for JSON."""
    return {
        "file": name,
        "frame": number,
        "faces": [_box_numbers(face.box) for face in contents.faces],
        "names": [face.name for face in contents.faces],
        "eyes": [[_box_numbers(eye) for eye in face.eyes] for face in contents.faces],
        "things": [
            {"name": each.name, "shape": each.shape, "box": _box_numbers(each.box), "distance": _metres(each.distance)}
            for each in contents.things
        ],
        "markers": [
            {"number": each.number, "box": _box_numbers(each.box), "distance": _metres(each.distance),
             "heading": round(each.heading, 3)}
            for each in contents.markers
        ],
        "brightness": round(contents.scene.brightness, 1),
        "contrast": round(contents.scene.contrast, 1),
    }  # fmt: skip


def _box_numbers(box: Box) -> list[int]:
    return [round(value) for value in (box.x, box.y, box.width, box.height)]


def _metres(distance: float) -> float | None:
    return round(distance, 2) if isfinite(distance) else None


def _frame_text(contents: FrameContents) -> str:
    """Return the percepts of a frame as text."""
    count = len(contents.faces)
    faces = f"{count} face{'s' if count > 1 else ''}" if count else "no face"
    places = [f"{_name_text(face)}{_box_text(face.box)}{EYE_TEXTS[len(face.eyes)]}" for face in contents.faces]
    others = [f"{each.name} {_box_text(each.box)}{_distance_text(each)}" for each in contents.things]
    others += [
        f"marker {each.number} {_box_text(each.box)}{_distance_text(each)}, {_heading_text(each)}"
        for each in contents.markers
    ]
    scene = f"brightness {contents.scene.brightness:.0f}, contrast {contents.scene.contrast:.0f}"
    return "; ".join([faces + (": " + places[0] if places else ""), *places[1:], *others, scene])


def _name_text(face: SeenFace) -> str:
    return f"{face.name}, " if face.name else ""


def _box_text(box: Box) -> str:
    return f"{box.width:.0f} x {box.height:.0f} at ({box.x:.0f}, {box.y:.0f})"


def _distance_text(percept: Thing | Marker | SeenFace) -> str:
    return f", {percept.distance:.1f} m" if isfinite(percept.distance) else ""


def _heading_text(marker: Marker) -> str:
    return f"turned {degrees(marker.heading):+.0f} deg"


def _labelled_boxes(contents: FrameContents) -> Iterator[tuple[Box, str]]:
    """Yield the box and label of each percept of a frame, to be drawn."""
    for face in contents.faces:
        yield face.box, f"{face.name or 'face'}{_distance_text(face)}"
        yield from ((eye, "") for eye in face.eyes)
    yield from ((each.box, f"{each.name}{_distance_text(each)}") for each in contents.things)
    yield from ((each.box, f"{each.number}{_distance_text(each)}") for each in contents.markers)
