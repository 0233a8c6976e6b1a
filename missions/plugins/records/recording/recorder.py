"""Hands what happens in a run to the process that writes its record, so that no tick ever waits for that.

Whoever has something to keep only puts it into a queue. A thread sends that on in batches; what it does between two
pieces of C is little, since it takes the interpreter from the ticks. All real work is the other process's.
"""

import shlex
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from threading import Condition, Lock, Thread
from threading import Event as Flag
from types import TracebackType
from typing import Self

import cv2
from py_trees.common import Status

from behaviours.node import Node
from drivers.api import DeviceStatus, Health, Report, ignore
from drivers.clock import Clock, SystemClock
from missions.executive.events import Event, NodeChanged
from missions.executive.tick_record import TickRecord
from missions.plugins.records.recording.budget import FRAMES, LIMIT, FrameBudget
from missions.plugins.records.recording.head import Contents
from missions.plugins.records.recording.items import EVENTS, Checked, Feedback, Missed, Picture, Seen, packed, topic_of
from missions.plugins.records.recording.outlet import Loss, Outlet
from missions.trees.drawing import ACTIVE
from perception.api import Frame, Gaze, View

# The pictures of a record: some of the frames that were searched, as JPEG, packed where nobody waits for it.

QUALITY = 80
"""Of the JPEG, in percent."""

Keep = Callable[[Picture], None]


class Pictures:
    """Packs the frames that are due by ``budget``, and hands them to ``keep``.

    On a thread of its own, with one frame waiting at most: a newer one takes its place, and ``missed`` is told. Where
    time is simulated (``patient``), at once instead.
    """

    def __init__(
        self, keep: Keep, budget: FrameBudget, *, patient: bool, missed: Callable[[], None] = lambda: None
    ) -> None:
        self._keep = keep
        self._budget = budget
        self._patient = patient
        self._missed = missed
        self._newest: tuple[Frame, Gaze | None] | None = None
        self._open = False
        self._news = Condition()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Begin to take frames."""
        self._open = True
        if not self._patient:
            self._thread = Thread(target=self._run, name="record pictures", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Pack what waits, then take no more. Safe more than once."""
        with self._news:
            self._open = False
            self._news.notify()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def take(self, frame: Frame, gaze: Gaze | None) -> None:
        """Take a frame, if one is due; returns at once. ``gaze`` is where the camera looked."""
        if not self._open or not self._budget.due(frame.stamp):
            return
        if self._patient:
            self._pack(frame, gaze)
            return
        with self._news:
            late, self._newest = self._newest, (frame, gaze)
            self._news.notify()
        if late is not None:
            self._missed()

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._newest is not None or not self._open)
                newest, self._newest = self._newest, None
            if newest is None:
                return
            self._pack(*newest)

    def _pack(self, frame: Frame, gaze: Gaze | None) -> None:
        try:
            done, packed = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        except cv2.error:  # a picture of a form that JPEG does not have
            done = False
        if done:
            self._budget.used(len(packed))
            self._keep(Picture(frame.stamp, packed.tobytes(), gaze))
        else:
            self._missed()


PERIOD = 0.15
"""Seconds from one batch to the next: each wakes two processes."""

BATCH = 150
"""Items in a batch, at most: packing them keeps the interpreter for about a millisecond."""

MAX_WAITING = 20_000
"""Items that may wait: 30 s or more of a run, whatever the disk does."""

MAX_PICTURE_BYTES = 64_000_000
"""Bytes of pictures that may wait."""

FEEDBACK_PERIOD = 0.2
"""Seconds of the run from one look at the messages of running nodes to the next: the median tick has none."""

CHECK_PERIOD = 2.0
"""Seconds from one look at the devices' health to the next."""

START_TIME, PATIENT_START = 20.0, 120.0
"""Seconds that the writer has to begin: half of one will do, but machines are busy; in simulated time nothing waits."""

FAREWELL, PATIENT_FAREWELL = 5.0, 120.0
"""Seconds that the writer has in the end; in simulated time, where it may be far behind and nothing waits."""

SLOW, FOREIGN, BEHIND = "the disk is too slow", "a value cannot be packed", "a newer picture was there first"
"""Why something was not even sent to the writer."""

Check = Callable[[], Mapping[str, Health]]


class Recorder:
    """Records one run at ``path``: give it the run's events (it is a listener), moments, views and frames.

    ``limit`` bounds the file (bytes), ``frames`` the pictures a second. A ``patient`` one, for simulated time, lets the
    run wait between moments rather than lose one. What goes wrong once it is open is reported, from within ``moment``,
    and ends no run.
    """

    def __init__(
        self,
        path: Path,
        *,
        limit: float = LIMIT,
        frames: float = FRAMES,
        patient: bool = False,
        overwrite: bool = False,
    ) -> None:
        self._patient = patient
        start_time = PATIENT_START if patient else START_TIME
        self._outlet = Outlet(path, limit=limit, overwrite=overwrite, start_time=start_time)
        budget, overtaken = FrameBudget(limit / 2, frames), partial(self._miss, "/camera", BEHIND)
        self._pictures = Pictures(self._keep_picture, budget, patient=patient, missed=overtaken)
        self._waiting: deque[object] = deque()
        self._picture_bytes = 0  # of those that wait; changed by += in more than one thread, under the lock
        self._open = self._full = False
        self._missed: dict[str, Counter[str]] = {}  # by the reason; of which the writer does not know yet
        self._nodes: Mapping[str, Node] = {}
        self._running: dict[str, str] = {}  # by the keys of nodes that run, the reasons that the record has of them
        self._listen_at = float("-inf")
        self._lock = Lock()
        self._room, self._ending = Flag(), Flag()
        self._thread: Thread | None = None
        self._clock: Clock | None = None
        self._report: Report = ignore
        self._check: Check | None = None

    @property
    def path(self) -> Path:
        """Where the record is; renamed where it is incomplete and an earlier one has its name."""
        return self._outlet.path

    # --- from beginning to end ----------------------------------------------------------------------------------------

    def open(self, contents: Contents, clock: Clock, *, report: Report = ignore, check: Check | None = None) -> None:
        """Start the process that writes, and wait until the beginning of the record is in its file.

        ``clock`` is the run's; ``check`` tells, in real time, how the devices are. Raises CannotRecordError.
        """
        self._clock, self._report, self._check = clock, report, None if self._patient else check
        self._outlet.open(contents)
        self._open = True
        self._pictures.open()
        self._thread = Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def watch(self, root: Node) -> None:
        """Keep the messages of this tree's nodes, too, as they change while they run."""
        self._nodes = {node.key: node for node in root.iterate() if isinstance(node, Node)}

    def close(self) -> Loss:
        """Close the record and end the process; return what is missing. Safe from any state, more than once."""
        self._pictures.close()
        self._open = False
        self._ending.set()
        if self._thread is not None:
            farewell = PATIENT_FAREWELL if self._patient else FAREWELL
            self._thread.join(farewell)
            if self._thread.is_alive():
                self._outlet.give_up(f"its disk was too slow: not all was written {farewell:.0f} s after the end")
                self._thread.join()
            self._thread = None
            self._tell()
        return self.loss

    @property
    def process(self) -> int | None:
        """The number of the process that writes; None where there is none."""
        return self._outlet.process

    @property
    def loss(self) -> Loss:
        """What is missing, as far as that is known."""
        outlet = self._outlet
        with self._lock:
            missed = dict(self._missed)
        why = "; ".join(dict.fromkeys(filter(None, (outlet.why, *missed))))
        return Loss(dict(sum(missed.values(), Counter(outlet.lost))), why, outlet.ended)

    @property
    def counts(self) -> Mapping[str, int]:
        """How many messages are in the record by topic; known once it is closed."""
        return self._outlet.counts

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # --- called by the run, from any thread ---------------------------------------------------------------------------

    def __call__(self, event: Event) -> None:
        """Keep an event, unless what it tells is in the record anyway."""
        if type(event).__name__ in EVENTS:
            self._keep(event)
            if isinstance(event, NodeChanged):
                if event.status in ACTIVE:
                    self._running[event.node] = event.reason
                else:
                    self._running.pop(event.node, None)

    def moment(self, moment: TickRecord) -> None:
        """Keep a moment, in whose thread troubles are reported."""
        self._keep(moment)
        if moment.t >= self._listen_at:
            self._listen_at = moment.t + FEEDBACK_PERIOD
            self._listen(moment)
        if self._full and len(self._waiting) < MAX_WAITING // 2:
            self._full = False  # from the beginning of a moment on, so that of each there is all or nothing
        while self._patient and self._open and self._outlet.takes and len(self._waiting) >= MAX_WAITING // 2:
            self._room.clear()
            self._room.wait(PERIOD)
        if self._outlet.troubles:
            self._tell()

    def view(self, view: View) -> None:
        """Keep what perception has found."""
        self._keep(Seen(0.0 if self._clock is None else self._clock.now(), view))

    def frame(self, frame: Frame, gaze: Gaze | None = None) -> None:
        """Keep a frame that was searched, if one is due; ``gaze`` is where the camera looked then."""
        self._pictures.take(frame, gaze)

    # --- inside -------------------------------------------------------------------------------------------------------

    def _listen(self, moment: TickRecord) -> None:
        """Keep the new messages of nodes that run on: of those there is no event."""
        for key, told in list(self._running.items()):  # another thread tells of changes meanwhile
            node = self._nodes.get(key)
            if node is not None and node.status is Status.RUNNING and node.reason != told:
                self._running[key] = node.reason
                self._keep(Feedback(moment.t, moment.tick, key, node.reason))

    def _keep(self, item: object) -> bool:
        """Let an item wait for the writer, or count it as missing; say whether it waits."""
        if not self._open:
            return False
        if self._full or len(self._waiting) >= MAX_WAITING or not self._outlet.takes:
            self._full = self._outlet.takes
            if self._outlet.ended is None:
                self._miss(topic_of(item), self._outlet.why or SLOW)
            return False
        self._waiting.append(item)
        return True

    def _keep_picture(self, picture: Picture) -> None:
        if self._picture_bytes > MAX_PICTURE_BYTES:
            self._miss("/camera", SLOW)
            return
        if self._keep(picture):
            with self._lock:
                self._picture_bytes += len(picture.jpeg)

    def _miss(self, topic: str, why: str) -> None:
        with self._lock:
            self._missed[why] = self._missed.get(why, Counter()) + Counter({topic: 1})

    def _tell(self) -> None:
        """Report what nobody has been told of."""
        while self._outlet.troubles:
            hint = f"mission record info {shlex.quote(str(self.path))}"
            self._report(DeviceStatus("record", "fault", self._outlet.troubles.popleft(), hint))

    def _run(self) -> None:
        wall = SystemClock()
        check_at = 0.0
        while not self._ending.wait(PERIOD):
            if self._check is not None and wall.now() >= check_at:
                check_at = wall.now() + CHECK_PERIOD
                self._look(self._check)
            self._pass_on()
        self._pass_on()
        if self._outlet.ended is None:
            self._lose(self._waiting, self._outlet.why)
        self._outlet.finish()

    def _look(self, check: Check) -> None:
        """Keep how the devices are."""
        with suppress(Exception):  # what a driver has to say of itself must not end a record
            self._keep(Checked(0.0 if self._clock is None else self._clock.now(), check()))

    def _pass_on(self) -> None:
        """Send what waits, and hear what became of it."""
        outlet = self._outlet
        while self._waiting and outlet.takes:
            items = [self._waiting.popleft() for _ in range(min(len(self._waiting), BATCH))]
            with self._lock:
                self._picture_bytes -= sum(len(item.jpeg) for item in items if type(item) is Picture)
            self._send(items)
            self._room.set()
        if outlet.takes and self._missed and not self._full:
            with self._lock:
                missed, self._missed = self._missed, {}
            if not outlet.send(packed([Missed(counts, why) for why, counts in missed.items()])):
                with self._lock:
                    self._missed = {why: counts + self._missed.get(why, Counter()) for why, counts in missed.items()}
        outlet.hear()

    def _send(self, items: Sequence[object]) -> None:
        try:
            batch = packed(items)
        except Exception:  # whatever a value of a user's own raises that cannot be packed: it costs itself alone
            if len(items) == 1:
                self._lose(items, FOREIGN)
            else:
                for item in items:
                    self._send([item])
            return
        if not self._outlet.send(batch) and self._outlet.ended is None:
            self._lose(items, self._outlet.why)

    def _lose(self, items: Iterable[object], why: str) -> None:
        for item in items:
            self._miss(topic_of(item), why)
