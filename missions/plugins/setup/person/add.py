"""``mission person add``, ``list`` and ``remove``: face pictures, from files or taken with a camera."""

import functools
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from datetime import UTC, datetime
from shlex import quote
from typing import Any

import click
import cv2

from config.library import find_file
from drivers.api import DeviceStatus, ignore
from drivers.api.image_orientation import UPRIGHT
from drivers.api.sensor_sections import CameraKeys
from drivers.camera.make import open_source
from drivers.camera.picture_files import iter_pictures
from drivers.camera.source import SourceKind, is_live, source_kind
from drivers.clock import Clock, SystemClock
from drivers.errors import BadRequest, NotConnected
from drivers.voice.speech import VoiceSettings, make_voice
from missions.assembly.models import face_detector
from missions.cli.commands import SharingCommand, shared_option
from missions.cli.names import PERSON, ROBOT
from missions.cli.numbers import QuantityInUnit, WholeNumber
from missions.cli.printable import format_columns
from missions.cli.root import FAILURE, SUCCESS
from missions.library.drivers import load_robot
from missions.library.people import KnownPerson, People, PeopleError, people_of, picture_digest, proper_name
from perception.api import Image
from perception.crops import crop_face, portrait_face_box
from perception.elastic_matching import GalleryCalibration
from perception.face_finder import FaceDetector
from perception.patches import Patches, describe_face, likeness
from perception.people import MAX_PICTURES, MIN_PICTURES, RECOMMENDED_PICTURES, NotOneFaceError, PatchRecogniser, enrol

# Shared by the commands of ``mission person``.

robot_option = shared_option("--robot", type=ROBOT, help="Robot whose people are used; without it, yours.")


def camera_keys(robot: str | None) -> CameraKeys | None:
    """Return the camera section of a robot's file; None without a robot. Raises click.UsageError without a camera."""
    if robot is None:
        return None
    camera = load_robot(find_file("robots", robot)).camera
    if camera is None:
        raise click.UsageError(f"{robot} has no camera")
    return camera


def method_note(camera: CameraKeys | None) -> str:
    """Return a warning if the face recognition method of the robot file was not tested; else an empty text."""
    method = "patches" if camera is None else camera.identity.method
    return "" if method == "patches" else f"tested with patches; the robot's method {method} was not tested"


def people_for(robot: str | None) -> People:
    """Return the people that a robot knows; without a robot, the people in the user's default folder."""
    return people_of(camera_keys(robot))


def report_people_errors(command: Callable[..., int]) -> Callable[..., int]:
    """Decorate a command: if it raises PeopleError, print the error and return the exit code FAILURE."""

    @functools.wraps(command)
    def wrapped(*arguments: Any, **named: Any) -> int:
        try:
            return command(*arguments, **named)
        except PeopleError as error:
            print_people_error(error)
            return FAILURE

    return wrapped


def print_people_error(error: PeopleError) -> None:
    """Print an error about the pictures of people, with the command to try."""
    click.echo(f"mission: {error}" + (f"\n  try: {error.hint}" if error.hint else ""), err=True)


# ``mission person remove`` and ``list``.


@click.command(cls=SharingCommand, epilog="Example: mission person remove Anna")
@click.argument("names", type=PERSON, nargs=-1, required=True, metavar="NAMES...")
@click.option("--yes", is_flag=True, help="Do not ask for confirmation.")
@robot_option
@report_people_errors
def remove(names: tuple[str, ...], yes: bool, robot: str | None) -> int:
    """Remove people, and delete all their pictures."""
    people = people_for(robot)
    unknown = [name for name in names if people.find(name) is None]
    if unknown:
        known = ", ".join(each.name for each in people.known_people()) or "none"
        message = f"unknown person '{', '.join(unknown)}'; nothing was deleted; known: {known}"
        raise PeopleError(message, hint="mission person list")
    if not yes and not click.confirm(f"Delete all pictures of {', '.join(names)}?"):
        return FAILURE
    for name in dict.fromkeys(people.find(name) or name for name in names):
        click.echo(f"{name}: {people.remove(name)} pictures deleted")
        if (people.folder / name).exists():
            click.echo(f"{people.folder / name} is kept: it has other files", err=True)
    return SUCCESS


@click.command("list", cls=SharingCommand, epilog="Example: mission person list --robot turtlebot2_arm")
@click.option("--json", "as_json", is_flag=True, help="Print one line of JSON.")
@robot_option
@report_people_errors
def list_people(as_json: bool, robot: str | None) -> int:
    """List the people that a robot knows.

    Shows how reliably their faces are told apart.

    Reliability is measured for the method `patches` only.
    """
    people = people_for(robot)
    known = people.known_people()
    portraits = people.portraits(print_people_error)
    calibration = PatchRecogniser(portraits).calibration if portraits else None
    if as_json:
        click.echo(json.dumps(_list_data(known, calibration)))
        return SUCCESS
    if not known:
        click.echo("no people yet\n  try: mission person add NAME", err=True)
        return SUCCESS
    click.echo(
        format_columns(("name", "pictures", "since"), [_person_row(each) for each in known], left=frozenset({"name"}))
    )
    if calibration is not None:
        click.echo(f"\n{_calibration_text(calibration)}")
        if otherwise := method_note(camera_keys(robot)):
            click.echo(otherwise)
    return SUCCESS


def _person_row(known: KnownPerson) -> list[str]:
    return [known.name, str(known.pictures), datetime.fromtimestamp(known.since, UTC).astimezone().strftime("%Y-%m-%d")]


def _list_data(known: list[KnownPerson], calibration: GalleryCalibration | None) -> dict[str, object]:
    rates = None
    if calibration is not None:
        threshold = round(min(calibration.thresholds.values()), 3)
        rates = {"method": "patches", "threshold": threshold, "refused": calibration.refusal_rate,
                 "accepted": calibration.acceptance_rate, "looks": calibration.look_count}  # fmt: skip
    people = [{"name": each.name, "pictures": each.pictures, "since": each.since} for each in known]
    return {"people": people, "rates": rates}


def _calibration_text(calibration: GalleryCalibration) -> str:
    """Return the measured error rates of the face recognition as text."""
    if calibration.refusal_rate is None:
        return "too few pictures to measure the error rates"
    refused = f"of 100 looks at known people, {100 * calibration.refusal_rate:.0f} are not recognised"
    if calibration.acceptance_rate is None:
        accepted = "strangers can be tested only with a second person in the list"
    else:
        accepted = f"of 100 looks at strangers, {100 * calibration.acceptance_rate:.0f} are taken for a known person"
    doubt = "all of these pictures and people: expect worse on other days and with other strangers"
    return f"{refused},\n{accepted} ({calibration.look_count} looks, {doubt})"


# Selection of good pictures of a person before a camera.

INSTRUCTIONS = (
    "look straight into the camera",
    "turn your head a little to the left",
    "turn your head a little to the right",
    "look up a little",
    "look down a little",
    "take two steps back, and look into the camera",
    "come close again, and smile",
)
"""Instructions for the person before the camera, in order: pictures from several sides are needed."""

MIN_SHARPNESS = 30.0
"""Minimum sharpness of a face's picture, measured as the variance of its Laplacian.

Sharp faces up to 3 m away had values of 33 to 1000. The same faces, blurred by a thirtieth of their width, had 9 to 30.
Blurred drawings of faces reached 45.
"""

PICTURE_INTERVAL = 0.8
"""Seconds between two accepted pictures, so that the person can move."""


TOO_SOON = "too soon after the last picture"

SAME_PICTURE = "identical to an earlier picture: is the camera frozen?"

MAX_LIKENESS = 0.88
"""Likeness of two pictures of a face from which on they are too similar to store both.

Consecutive frames of a person who holds still had a likeness of 0.8 to 0.98, frames 0.8 s apart 0.58 to 0.89. Pictures
of one person in intentionally different poses had 0.58 to 0.83.
"""

TOO_SIMILAR = "too similar to an earlier picture: follow the instructions"


class PortraitCollector:
    """Collects ``count`` sharp and different pictures of a person's face as ``portraits``."""

    def __init__(self, detector: FaceDetector, count: int) -> None:
        self.portraits: list[Image] = []
        self._detector = detector
        self._count = count
        self._digests: set[bytes] = set()
        self._patches: list[Patches] = []
        self._taken_at: float | None = None

    @property
    def is_complete(self) -> bool:
        """Whether there are enough portraits."""
        return len(self.portraits) >= self._count

    @property
    def instruction(self) -> str:
        """Instruction to the person for the next picture, such as to turn the head a little."""
        return INSTRUCTIONS[min(len(self.portraits) * len(INSTRUCTIONS) // self._count, len(INSTRUCTIONS) - 1)]

    def offer(self, image: Image, stamp: float) -> str:
        """Take the picture of time ``stamp`` (s) if it is good enough; return the reason if it is not, else "".

        Raises ValueError for an invalid picture.
        """
        if self._taken_at is not None and stamp - self._taken_at < PICTURE_INTERVAL:
            return TOO_SOON
        try:
            portrait = enrol(image, self._detector)
        except NotOneFaceError as error:
            return str(error)
        shown = crop_face(portrait, portrait_face_box(portrait))
        if float(cv2.Laplacian(shown, cv2.CV_64F).var()) < MIN_SHARPNESS:
            return "blurred: hold still, with more light"
        if picture_digest(portrait) in self._digests:
            return SAME_PICTURE
        patches = describe_face(shown)
        if any(likeness(patches, other) > MAX_LIKENESS for other in self._patches):
            return TOO_SIMILAR
        self._patches.append(patches)
        self._taken_at = stamp
        self._digests.add(picture_digest(portrait))
        self.portraits.append(portrait)
        return ""


PICTURE_TIMEOUT = 5.0
"""Maximum seconds until the first picture of a camera."""


MAX_ADDED_PICTURES = 200
"""Maximum number of pictures that one `mission person add` takes."""


@click.command(cls=SharingCommand, epilog="Example: mission person add Anna anna1.jpg anna2.jpg anna3.jpg")
@click.argument("name", type=PERSON)
@click.argument("files", type=click.Path(), nargs=-1, metavar="[PICTURES...]")
@click.option(
    "--camera", "source", metavar="SOURCE", help="Camera number, device or video; by default the robot's camera, or 0."
)
@click.option(
    "--count", default=12, show_default=True, type=WholeNumber(MIN_PICTURES, 100), help="Number of pictures to take."
)
@click.option(
    "--seconds",
    type=QuantityInUnit("s", 1.0),
    default=120.0,
    show_default=True,
    help="Maximum time for the camera.",
)
@click.option("--say", "aloud", is_flag=True, help="Also say the instructions aloud.")
@robot_option
@report_people_errors
def add(
    name: str,
    files: tuple[str, ...],
    source: str | None,
    count: int,
    seconds: float,
    aloud: bool,
    robot: str | None,
) -> int:
    """Add a person's face, so that a robot recognises them.

    From PICTURES that show only their face, or with instructions before the camera. Only the face is stored, in a
    folder that no other user can read. Ask them first.
    """
    people, camera = people_for(robot), camera_keys(robot)
    proper_name(name)  # reject an invalid name before anyone poses
    detector = face_detector(camera)
    try:
        if files:
            portraits = _portraits_from_files(files, detector)
        else:
            place = source or ("0" if camera is None else camera.source)
            portraits = _portraits_from_camera(place, camera, PortraitCollector(detector, count), seconds, aloud=aloud)
    except (BadRequest, FileNotFoundError, ValueError) as error:
        hint = error.hint if isinstance(error, BadRequest) else ""
        raise click.UsageError(f"{error}" + (f"\n  try: {hint}" if hint else "")) from error
    fresh = people.select_new(name, portraits)
    before = people.find(name)
    there = sum(each.pictures for each in people.known_people() if each.name == before)
    kept = people.add(name, fresh)
    click.echo(f"{kept}: {len(fresh)} pictures saved in {people.folder / kept}" + f", {there} before" * bool(there))
    if len(fresh) < len(portraits):
        click.echo(f"{len(portraits) - len(fresh)} duplicate pictures skipped", err=True)
    for line in _advice(people, kept):
        click.echo(line, err=True)
    if otherwise := method_note(camera):
        click.echo(otherwise, err=True)
    return SUCCESS


def _portraits_from_files(files: Sequence[str], detector: FaceDetector) -> list[Image]:
    """Return a portrait from each picture. Raises PeopleError for too many pictures, or those without one face."""
    found, faults = list[Image](), list[str]()
    hints = dict[str, None]()
    for path, number, image in iter_pictures(files):
        if len(found) + len(faults) >= MAX_ADDED_PICTURES:
            hint = f"a few dozen from different sides and days work better; {MAX_PICTURES} are used at most"
            raise PeopleError(f"nothing was saved: more than {MAX_ADDED_PICTURES} pictures", hint=hint)
        try:
            found.append(enrol(image, detector))
        except NotOneFaceError as error:
            film = source_kind(path) is not SourceKind.PICTURE
            faults.append(f"{path}" + f" frame {number}" * film + f": {error}")
            hints[error.hint] = None
    if faults:
        raise PeopleError("nothing was saved:\n  " + "\n  ".join(faults), hint="\n       ".join(hints))
    return found


def _portraits_from_camera(
    source: str, camera: CameraKeys | None, collector: PortraitCollector, seconds: float, *, aloud: bool
) -> list[Image]:
    """Return portraits of the person in front of a camera, who gets printed instructions, also spoken if ``aloud``.

    ``collector`` decides which pictures are good enough. Raises NotConnected for a camera without pictures, PeopleError
    if there are too few portraits after ``seconds``.
    """
    clock, size = SystemClock(), None if camera is None else (camera.width, camera.height)
    turn = camera.orientation if camera is not None and is_live(source) else UPRIGHT
    seen, guide, refusal = False, "", ""
    with ExitStack() as stack:
        eye = stack.enter_context(
            closing(open_source(source, clock, size=size, loop=False, report=_print_status, turn=turn))
        )
        eye.open()
        say = stack.enter_context(_open_voice(clock)) if aloud else ignore
        while not collector.is_complete and clock.now() < seconds:
            if collector.instruction != guide:
                guide = collector.instruction
                click.echo(f"{guide[:1].upper()}{guide[1:]}.", err=True)
                say(guide)
            frame = eye.read(0.2)
            if frame is None:
                if not seen and clock.now() > PICTURE_TIMEOUT:
                    health = eye.health()
                    raise NotConnected(health.detail, hint=health.hint)
                if seen and not eye.health().online and not is_live(source):
                    break  # end of the film
                continue
            seen, before = True, refusal
            refusal = collector.offer(frame.image, frame.stamp)
            if not refusal:
                click.echo(f"  picture {len(collector.portraits)}", err=True)
            elif refusal not in (before, TOO_SOON):
                click.echo(f"  waiting: {refusal}", err=True)
    if len(collector.portraits) < MIN_PICTURES:
        hint = refusal or "more time: --seconds 300"
        raise PeopleError(
            f"nothing was saved: {len(collector.portraits)} good pictures, at least {MIN_PICTURES}", hint=hint
        )
    return collector.portraits


@contextmanager
def _open_voice(clock: Clock) -> Iterator[Callable[[str], object]]:
    """Yield a function that says a text; without a speech synthesiser it does nothing."""
    voice = make_voice(VoiceSettings(), clock, ignore, report=_print_status)
    voice.open()
    try:
        yield voice.say
    finally:
        voice.close()


def _advice(people: People, name: str) -> Iterator[str]:
    """Yield advice on the number of pictures of a person, and on people who look alike."""
    portraits = people.portraits(print_people_error)
    if name not in portraits:
        return  # no room for it, which portraits() has printed
    calibration, count = PatchRecogniser(portraits).calibration, len(portraits[name])
    if count < RECOMMENDED_PICTURES:
        yield f"{count} of {RECOMMENDED_PICTURES} recommended pictures: with fewer, {name} is less often recognised"
        yield f"  try: mission person add {quote(name)}, with pictures from other sides"
    else:
        yield f"{count} pictures are enough; pictures of other days, light and glasses still help"
    if name in calibration.uniform_people:
        yield f"the pictures of {name} are too similar: on another day {name} may not be recognised"
        yield "  try: pictures in other light, from other sides and of other days"
    alike = {each for pair in calibration.lookalikes.items() if name in pair for each in pair} - {name}
    if alike:
        yield f"{name} looks like {' and '.join(sorted(alike))}: the robot may confuse them"
        yield "  try: more pictures of both, in other light and from other sides"


def _print_status(notice: DeviceStatus) -> None:
    if notice.kind != "online":
        click.echo(notice.message + (f"\n  try: {notice.hint}" if notice.hint else ""), err=True)
