"""``mission person add``: let the robot know somebody, from pictures or guided before the camera."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from shlex import quote

import click
import cv2

from drivers.api import DeviceStatus, ignore
from drivers.api.senses import CameraKeys
from drivers.api.turn import UPRIGHT
from drivers.camera.make import open_source
from drivers.camera.pictures import pictures
from drivers.camera.source import Kind, is_live, kind_of
from drivers.clock import Clock, SystemClock
from drivers.errors import BadRequest, NotConnected
from drivers.voice.make import Wish, make_voice
from missions.assembly.models import face_detector
from missions.cli.commands import SharingCommand
from missions.cli.names import PERSON
from missions.cli.numbers import InUnit, Whole
from missions.cli.root import SUCCESS
from missions.library.people import People, PeopleError, proper_name
from missions.library.portraits import digest
from missions.plugins.setup.person.asked import camera_of, judged_otherwise, people_for, robot_option, saying_why, tell
from perception.api import Image
from perception.crops import crop, face_in
from perception.finder import FaceDetector
from perception.patches import Patches, describe, likeness
from perception.people import ENOUGH, FEWEST, MAX_PICTURES, KnownPeople, NotOneFace, enrol

# Taking pictures of somebody who stands before a camera: which of them are good enough, and what to do next.

GUIDE = (
    "look straight into the camera",
    "turn your head a little to the left",
    "turn your head a little to the right",
    "look up a little",
    "look down a little",
    "take two steps back, and look into the camera",
    "come close again, and smile",
)
"""What somebody is asked to do, one after another: who is known from one side only is not known."""

SHARP = 30.0
"""Variance of the Laplacian of a face's crop: of faces up to 3 m away it was 33 to 1000, of the same ones blurred by a
thirtieth of their width 9 to 30 (drawn ones up to 45)."""

EVERY = 0.8
"""Seconds from one picture to the next: time to move."""


TOO_SOON = "it is too soon after the one before"

SAME = "it is the very picture of one before: does the camera stand still?"

NEAR = 0.88
"""Likeness from which on a picture is nearly one before: frames in a row, of somebody who holds still, were 0.8 to 0.98
alike, those 0.8 s apart 0.58 to 0.89, and pictures of one person that were taken to differ 0.58 to 0.83."""

NEARLY = "it is nearly the same as one before: move as you are asked to"


class Taking:
    """Takes ``count`` pictures that are worth it: ``portraits``."""

    def __init__(self, detector: FaceDetector, count: int) -> None:
        self.portraits: list[Image] = []
        self._detector = detector
        self._count = count
        self._digests: set[bytes] = set()
        self._shown: list[Patches] = []
        self._taken_at: float | None = None

    @property
    def done(self) -> bool:
        """Whether there are enough."""
        return len(self.portraits) >= self._count

    @property
    def guide(self) -> str:
        """What to do for the next one."""
        return GUIDE[min(len(self.portraits) * len(GUIDE) // self._count, len(GUIDE) - 1)]

    def offer(self, image: Image, stamp: float) -> str:
        """Take the picture of ``stamp`` (s) if it is good and not too soon; else say why it is not.

        Raises ValueError for what is no picture.
        """
        if self._taken_at is not None and stamp - self._taken_at < EVERY:
            return TOO_SOON
        try:
            portrait = enrol(image, self._detector)
        except NotOneFace as error:
            return str(error)
        shown = crop(portrait, face_in(portrait))
        if float(cv2.Laplacian(shown, cv2.CV_64F).var()) < SHARP:
            return "it is blurred: hold still, with more light"
        if digest(portrait) in self._digests:
            return SAME
        patches = describe(shown)
        if any(likeness(patches, other) > NEAR for other in self._shown):
            return NEARLY
        self._shown.append(patches)
        self._taken_at = stamp
        self._digests.add(digest(portrait))
        self.portraits.append(portrait)
        return ""


PICTURE_TIMEOUT = 5.0
"""Seconds in which a camera must show something."""


LIMIT = 200
"""Pictures that are taken in at a time."""


@click.command(cls=SharingCommand, epilog="Example: mission person add Anna anna1.jpg anna2.jpg anna3.jpg")
@click.argument("name", type=PERSON)
@click.argument("files", type=click.Path(), nargs=-1, metavar="[PICTURES...]")
@click.option("--camera", "source", metavar="SOURCE", help="Its number or device, or a film. Else the robot's, or 0.")
@click.option("--count", default=12, show_default=True, type=Whole(FEWEST, 100), help="Pictures to take.")
@click.option(
    "--seconds",
    type=InUnit("s", 1.0),
    default=120.0,
    show_default=True,
    help="How long a camera looks at most.",
)
@click.option("--say", "aloud", is_flag=True, help="Say aloud what to do before the camera, too.")
@robot_option
@saying_why
def add(
    name: str,
    files: tuple[str, ...],
    source: str | None,
    count: int,
    seconds: float,
    aloud: bool,
    robot: str | None,
) -> int:
    """Let a robot know somebody by their face.

    From PICTURES of them alone, all of which must show one face; or guided, before the camera. Only the face is kept,
    in a folder that nobody else may read. Ask them first.
    """
    people, camera = people_for(robot), camera_of(robot)
    proper_name(name)  # what cannot be one is said before anybody poses
    detector = face_detector(camera)
    try:
        if files:
            portraits = _from_pictures(files, detector)
        else:
            place = source or ("0" if camera is None else camera.source)
            portraits = _from_camera(place, camera, Taking(detector, count), seconds, aloud=aloud)
    except (BadRequest, FileNotFoundError, ValueError) as error:
        hint = error.hint if isinstance(error, BadRequest) else ""
        raise click.UsageError(f"{error}" + (f"\n  try: {hint}" if hint else "")) from error
    fresh = people.new_ones(name, portraits)
    before = people.find(name)
    there = sum(each.pictures for each in people.known() if each.name == before)
    kept = people.add(name, fresh)
    click.echo(f"{kept}: {len(fresh)} pictures kept in {people.where / kept}" + f", {there} before" * bool(there))
    if len(fresh) < len(portraits):
        click.echo(f"{len(portraits) - len(fresh)} pictures were there already, or given twice", err=True)
    for line in _advice(people, kept):
        click.echo(line, err=True)
    if otherwise := judged_otherwise(camera):
        click.echo(otherwise, err=True)
    return SUCCESS


def _from_pictures(files: Sequence[str], detector: FaceDetector) -> list[Image]:
    """Return a portrait from each picture. Raises PeopleError with all those that do not show one face, or too many."""
    found, faults = list[Image](), list[str]()
    hints = dict[str, None]()
    for path, number, image in pictures(files):
        if len(found) + len(faults) >= LIMIT:
            hint = f"some tens, from different sides and days, teach more; {MAX_PICTURES} are used at most"
            raise PeopleError(f"nothing was kept: these are more than {LIMIT} pictures", hint=hint)
        try:
            found.append(enrol(image, detector))
        except NotOneFace as error:
            film = kind_of(path) is not Kind.PICTURE
            faults.append(f"{path}" + f" frame {number}" * film + f": {error}")
            hints[error.hint] = None
    if faults:
        raise PeopleError("nothing was kept:\n  " + "\n  ".join(faults), hint="\n       ".join(hints))
    return found


def _from_camera(source: str, camera: CameraKeys | None, taking: Taking, seconds: float, *, aloud: bool) -> list[Image]:
    """Return portraits of who stands before a camera, telling them what to do.

    Raises NotConnected for a camera that shows nothing, PeopleError when the time is over before there are enough.
    """
    clock, size = SystemClock(), None if camera is None else (camera.width, camera.height)
    turn = camera.turn if camera is not None and is_live(source) else UPRIGHT
    seen, guide, why = False, "", ""
    with ExitStack() as stack:
        eye = stack.enter_context(closing(open_source(source, clock, size=size, loop=False, report=_report, turn=turn)))
        eye.open()
        say = stack.enter_context(_speaking(clock)) if aloud else ignore
        while not taking.done and clock.now() < seconds:
            if taking.guide != guide:
                guide = taking.guide
                click.echo(f"{guide[:1].upper()}{guide[1:]}.", err=True)
                say(guide)
            frame = eye.read(0.2)
            if frame is None:
                if not seen and clock.now() > PICTURE_TIMEOUT:
                    health = eye.health()
                    raise NotConnected(health.detail, hint=health.hint)
                if seen and not eye.health().online and not is_live(source):
                    break  # a film is over
                continue
            seen, before = True, why
            why = taking.offer(frame.image, frame.stamp)
            if not why:
                click.echo(f"  picture {len(taking.portraits)}", err=True)
            elif why not in (before, TOO_SOON):
                click.echo(f"  waiting: {why}", err=True)
    if len(taking.portraits) < FEWEST:
        hint = why or "more time: --seconds 300"
        raise PeopleError(f"nothing was kept: {len(taking.portraits)} good pictures, and it takes {FEWEST}", hint=hint)
    return taking.portraits


@contextmanager
def _speaking(clock: Clock) -> Iterator[Callable[[str], object]]:
    """Yield what says a text aloud; where nothing here can, only the printed words are there."""
    voice = make_voice(Wish(), clock, ignore, report=_report)
    voice.open()
    try:
        yield voice.say
    finally:
        voice.close()


def _advice(people: People, name: str) -> Iterator[str]:
    """Yield whether the pictures of somebody are enough, and for whom the robot may take them."""
    portraits = people.portraits(tell)
    if name not in portraits:
        return  # there is no room, and that was told
    calibration, count = KnownPeople(portraits).calibration, len(portraits[name])
    if count < ENOUGH:
        yield f"{count} of {ENOUGH} pictures that are enough: with fewer, {name} is more often taken for a stranger"
        yield f"  try: mission person add {quote(name)}, with pictures from other sides"
    else:
        yield f"{count} pictures are enough; pictures of other days, light and glasses still help"
    if name in calibration.alike:
        yield f"the pictures of {name} are nearly alike: on another day {name} may be taken for a stranger"
        yield "  try: pictures in other light, from other sides and of other days"
    alike = {each for pair in calibration.near.items() if name in pair for each in pair} - {name}
    if alike:
        yield f"{name} looks like {' and '.join(sorted(alike))}: the robot may take one for the other"
        yield "  try: more pictures of both, in other light and from other sides"


def _report(notice: DeviceStatus) -> None:
    if notice.kind != "online":
        click.echo(notice.what + (f"\n  try: {notice.hint}" if notice.hint else ""), err=True)
