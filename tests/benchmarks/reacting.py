"""How long it takes from a frame's arrival to the head's command on the wire.

All of it is real: the eyes' thread, the executive at 20 Hz with ``track_face``, the Arduino driver, and a virtual board
behind a pseudo-terminal. Only what the camera sees is drawn, from where the head looks: a face that stays until the
head rests on it, and is then somewhere else, 3 degrees away, in frames that come at any time between two ticks.

The wire knows whole degrees. A tick soon after the one before moves the head's goal by little, for its rules say how
fast to turn; where the nearest degree is still the same, nothing can be sent until the next frame. So the delay to the
wire has two humps, one frame apart. How many reactions are in the second one depends on how far a resting head is from
where its degree changes: a quarter of a degree on one side, three quarters on the other, which is half on the average.
"""

import math
import statistics
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from random import Random
from threading import Event

import cv2

from behaviours.catalogue import LEAVES
from behaviours.robot import Robot
from behaviours.run import RunState
from config.diagnostics import SourceText
from config.library import DEFAULT_ROBOT, find_file
from drivers.api import Head, HeadPose
from drivers.api.driver import DriverContext
from drivers.arduino.declared import ArduinoKeys
from drivers.arduino.driver import make as make_head
from drivers.arduino.virtual import VirtualRodney
from drivers.clock import Clock, SystemClock
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import PinholeLens, Viewpoint
from drivers.sim.world import SimulatedWorld
from drivers.virtual.terminal import PseudoTerminal
from missions.executive.build import build
from missions.executive.executive import Executive
from missions.executive.proxied_robot import robot_for, with_proxies
from missions.executive.proxy import CommandReport
from missions.executive.stream import EventStream
from missions.executive.tick_cache import TickCache
from missions.language.document import check_plan
from missions.library.drivers import load_robot
from missions.library.lookups import LOOKUPS
from perception.api import Gaze, Image, View
from perception.eyes import Eyes, Vision
from perception.face_finder import FaceFinder
from perception.haar_faces import HaarFaceDetector
from perception.senses import ActiveSenses, FaceSense
from perception.tracks import Tracker
from tests.benchmarks.table import Row

REACTIONS = 150
PERIOD = 0.041
"""Seconds from frame to frame: not in step with the ticks, so that frames come at any time between two of them."""

PLACES = tuple(math.radians(angle) for angle in (1.75, -1.25))
"""Where the face is, by turns, in radians to the left of straight ahead."""

REST = 0.3
"""Seconds without a command after which the head rests."""

MISSION = "mission: react\ntree:\n  track_face: {patience: 60 s}\n"


@dataclass(frozen=True)
class Frame:
    """One picture."""

    image: Image
    stamp: float


class Stage:
    """Shows a face at one of two places from where the head looks: a ``perception.senses.FrameSource``."""

    def __init__(self, clock: Clock, head: Head) -> None:
        lens = PinholeLens(640, 480, math.radians(60))
        places = [(1.4 * math.cos(angle), 1.4 * math.sin(angle)) for angle in PLACES]
        worlds = [SimulatedWorld(people=(Person("Ben", look="ben", x=x, y=y),)) for x, y in places]
        self._renderers = [Renderer(world, lens) for world in worlds]
        self._clock = clock
        self._head = head
        self._due = 0.0
        self._place = 0
        self._arrived: float | None = None

    def leap(self) -> None:
        """Show the face at the other place from the next frame on."""
        self._arrived, self._place = None, 1 - self._place

    def arrived(self) -> float | None:
        """Return when the first frame after a leap was handed out, None before it was."""
        return self._arrived

    def read(self, timeout: float) -> Frame | None:
        """Wait for the next picture."""
        wait = self._due - self._clock.now()
        if wait > 0:
            Event().wait(min(wait, timeout))
        self._due = max(self._due + PERIOD, self._clock.now())
        place, pose = self._place, self._head.pose().value or HeadPose(0.0, 0.0)
        image = self._renderers[place].draw(Viewpoint(z=1.1, yaw=pose.pan, pitch=pose.tilt), 0.0)
        now = self._clock.now()
        if place == self._place and self._arrived is None:
            self._arrived = now
        return Frame(image, now)


class Board(VirtualRodney):
    """A board with a later sketch that notes when an angle came."""

    def __init__(self, clock: Clock, baud: int) -> None:
        super().__init__(baud=baud, tacho=True)
        self._clock = clock
        self.times: list[float] = []

    def feed(self, data: bytes, now: float) -> bytes:
        """Take bytes from the computer; return the answers."""
        count = len(self.commands)
        answer = super().feed(data, now)
        self.times += [self._clock.now()] * (len(self.commands) - count)
        return answer

    def rests(self, now: float) -> bool:
        """Whether the head has come to rest: where the driver led it first, or wherever it was told to look."""
        return bool(self.times) and now - self.times[-1] > REST


def rows() -> Iterator[Row]:
    """Yield the median and the 99th percentile, each against its bound: to the head's driver, and to the wire."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        found = measured()
    finally:
        cv2.setNumThreads(before)
    bound = 1.2 * statistics.median(each.search for each in found) + 0.005
    for what, delays in (("driver", [each.told for each in found]), ("wire", [each.sent for each in found])):
        median, slow = statistics.median(delays), sorted(delays)[math.ceil(0.99 * len(delays)) - 1]
        yield Row(f"frame to {what} (median; 1.2 searches + 5 ms)", median, bound, median / bound, 1.0)
        yield Row(f"frame to {what} (99th percentile; 60 ms)", slow, 0.06, slow / 0.06, 1.0)


@dataclass(frozen=True)
class Reaction:
    """Seconds from a frame's arrival until the head's driver was told, and until the board was; and of its search."""

    told: float
    sent: float
    search: float


def measured(count: int = REACTIONS) -> list[Reaction]:
    """Return how the head reacted to so many leaps."""
    clock = SystemClock()
    config = load_robot(find_file("robots", DEFAULT_ROBOT)).head
    if not isinstance(config, ArduinoKeys):
        raise TypeError(f"{DEFAULT_ROBOT}: has no head on an Arduino")
    board, run = Board(clock, config.baud), RunState(clock)
    terminal = PseudoTerminal("nano", board, clock)
    head = make_head(config, DriverContext(clock, terminal.path))
    stage = Stage(clock, head)
    searches = Searches(clock)
    vision = _vision(clock, head, lambda view: searches.note(view, vision, run))
    eyes = Eyes(stage, vision)
    told: list[float] = []
    robot = Robot(head_part=head, sight_part=vision)
    executive = _executive(run, robot, lambda *_: told.append(clock.now()))
    loop = threading.Thread(target=executive.loop)
    try:
        terminal.open()
        head.open()
        _until(lambda: board.rests(clock.now()))  # straight ahead: on the way there it could lose the face again
        eyes.open()
        loop.start()
        _until(lambda: bool(told) and board.times[-1] > told[0])  # it is turning to the face
        return [_reaction(stage, board, told, searches, clock, number) for number in range(count)]
    finally:
        executive.stop("measured")
        if loop.is_alive():
            loop.join()
        eyes.close()
        head.close()
        terminal.close()


def _vision(clock: Clock, head: Head, seen: Callable[[View], None]) -> Vision:
    def gaze(stamp: float) -> Gaze | None:
        pose = head.pose_at(stamp)
        return None if pose is None else Gaze(pose.pan, pose.tilt)

    senses = ActiveSenses(faces=FaceSense(FaceFinder(HaarFaceDetector()), Tracker()))
    return Vision(gaze, field_of_view=math.radians(60), senses=senses, now=clock.now, on_view=seen)


class Searches:
    """How long the search of each frame took, and when it was done, by the frame's stamp."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._sum = 0.0
        self.took: dict[float, float] = {}
        self.done: dict[float, float] = {}

    def note(self, view: View, vision: Vision, run: RunState) -> None:
        """Note the newest frame, and wake the mission, as a run does."""
        if view.looked is not None:
            self.took[view.looked] = vision.effort.seconds - self._sum
            self._sum = vision.effort.seconds
            self.done[view.looked] = self._clock.now()
        run.wake()


def _executive(run: RunState, robot: Robot, commanded: CommandReport) -> Executive:
    plan = check_plan(SourceText("react.yaml", MISSION), LEAVES, LOOKUPS)
    answers = TickCache()
    asking = with_proxies(robot, answers)
    root = build(plan, run, lambda leaf: robot_for(leaf, asking, commanded))
    return Executive(root, run, EventStream(), rate=20.0, cache=answers)


def _reaction(stage: Stage, board: Board, told: list[float], searches: Searches, clock: Clock, number: int) -> Reaction:
    """Let the head come to rest and the face leap; return how long it took until the driver and the board heard."""
    _until(lambda: board.rests(clock.now()))
    Event().wait(Random(number).uniform(0, 0.05))  # noqa: S311 - chance, not a secret
    stage.leap()
    _until(lambda: searches.done.get(stage.arrived() or -1.0, clock.now() + 1.0) <= min(board.times[-1], told[-1]))
    arrived = stage.arrived() or 0.0
    done = searches.done[arrived]
    # What the head was told before the search was done, it was not told because of it.
    first, sent = (next(time for time in times if time >= done) for times in (told, board.times))
    return Reaction(first - arrived, sent - arrived, searches.took[arrived])


def _until(holds: Callable[[], bool], seconds: float = 30.0) -> None:
    clock = SystemClock()
    while not holds():
        if clock.now() > seconds:
            raise TimeoutError(f"it did not come true within {seconds:g} s")
        Event().wait(0.005)


if __name__ == "__main__":
    for row in rows():
        print(row)
