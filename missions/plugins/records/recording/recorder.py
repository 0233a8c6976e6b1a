"""Sends the data of a run to the process that writes its record, so that no tick waits for the disk.

The run only appends to a queue. A thread sends the queue in batches, and holds the GIL only briefly. All other work is
done in the writer process.
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
from drivers.api import DeviceStatus, Health, StatusCallback, ignore
from drivers.clock import Clock, SystemClock
from missions.executive.events import Event, NodeChanged
from missions.executive.tick_record import TickRecord
from missions.plugins.records.recording.budget import DEFAULT_FRAME_RATE, DEFAULT_MAX_BYTES, FrameBudget
from missions.plugins.records.recording.items import (
    EVENT_TOPICS,
    FeedbackItem,
    HealthItem,
    LossItem,
    PictureItem,
    ViewItem,
    pack_items,
    topic_of,
)
from missions.plugins.records.recording.record_header import RecordContents
from missions.plugins.records.recording.writer_client import SUPERSEDED, RecordLoss, RecordWriterClient
from missions.trees.drawing import ACTIVE
from perception.api import Frame, Gaze, View

# Encoding of some of the searched frames as JPEG, off the run's threads.

JPEG_QUALITY = 80
"""JPEG quality in percent of the pictures in a record."""

PictureCallback = Callable[[PictureItem], None]


class PictureEncoder:
    """Encodes the frames that ``budget`` accepts as JPEG, and passes them to ``on_picture``.

    It works on its own thread with a queue of one frame. A newer frame replaces the queued one, which is then lost, and
    ``on_miss`` is called. With ``lossless``, for simulated time, ``offer`` encodes the frame at once.
    """

    def __init__(
        self,
        on_picture: PictureCallback,
        budget: FrameBudget,
        *,
        lossless: bool,
        on_miss: Callable[[], None] = lambda: None,
    ) -> None:
        self._on_picture = on_picture
        self._budget = budget
        self._lossless = lossless
        self._on_miss = on_miss
        self._newest: tuple[Frame, Gaze | None] | None = None
        self._open = False
        self._condition = Condition()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Start the encoder's thread, and accept frames."""
        self._open = True
        if not self._lossless:
            self._thread = Thread(target=self._run, name="record pictures", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Encode the queued frame, then accept no more. Idempotent."""
        with self._condition:
            self._open = False
            self._condition.notify()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def offer(self, frame: Frame, gaze: Gaze | None) -> None:
        """Queue a frame if the budget accepts it. ``gaze`` is the direction of the camera.

        It does not wait for the encoder, except with ``lossless``.
        """
        if not self._open or not self._budget.accept(frame.stamp):
            return
        if self._lossless:
            self._encode(frame, gaze)
            return
        with self._condition:
            late, self._newest = self._newest, (frame, gaze)
            self._condition.notify()
        if late is not None:
            self._on_miss()

    def _run(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._newest is not None or not self._open)
                newest, self._newest = self._newest, None
            if newest is None:
                return
            self._encode(*newest)

    def _encode(self, frame: Frame, gaze: Gaze | None) -> None:
        try:
            done, packed = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        except cv2.error:  # a shape or type that JPEG does not support
            done = False
        if done:
            self._budget.consume(len(packed))
            self._on_picture(PictureItem(frame.stamp, packed.tobytes(), gaze))
        else:
            self._on_miss()


BATCH_INTERVAL = 0.15
"""Seconds between two batches to the writer process; each batch wakes two processes."""

MAX_BATCH_ITEMS = 150
"""Maximum number of items in a batch to the writer process: packing holds the GIL for about a millisecond."""

MAX_QUEUED_ITEMS = 20_000
"""Maximum number of items queued for the writer process; at least 30 s of a run fit into the queue.

When the queue is full, further items are dropped, and counted as lost.
"""

MAX_QUEUED_PICTURE_BYTES = 64_000_000
"""Maximum size in bytes of the pictures queued for the writer process."""

FEEDBACK_INTERVAL = 0.2
"""Seconds of the run between two checks for new messages of running nodes; most ticks have no check."""

HEALTH_INTERVAL = 2.0
"""Seconds between two checks of the devices' health."""

START_TIMEOUT, LOSSLESS_START_TIMEOUT = 20.0, 120.0
"""``START_TIMEOUT`` in simulated time, where nothing waits. Half a second is usual, but computers may be busy."""

CLOSE_TIMEOUT, LOSSLESS_CLOSE_TIMEOUT = 5.0, 120.0
"""``CLOSE_TIMEOUT`` in simulated time, where the writer may be far behind and nothing waits."""

SLOW_DISK, NOT_PACKABLE = "the disk is too slow", "a value cannot be pickled"
"""Reasons of items that were never sent to the writer process."""

HealthCheck = Callable[[], Mapping[str, Health]]


class Recorder:
    """Records one run at ``path``: receives its events, tick records, views and frames.

    ``limit`` is the maximum size (bytes), ``frame_rate`` is in pictures per second. With ``lossless``, for simulated
    time, the run waits between ticks so that no tick record is lost. If recording fails after ``open``, the run goes
    on, and the next ``on_tick`` reports the failure.
    """

    def __init__(
        self,
        path: Path,
        *,
        limit: float = DEFAULT_MAX_BYTES,
        frame_rate: float = DEFAULT_FRAME_RATE,
        lossless: bool = False,
        overwrite: bool = False,
    ) -> None:
        self._lossless = lossless
        start_time = LOSSLESS_START_TIMEOUT if lossless else START_TIMEOUT
        self._writer = RecordWriterClient(path, limit=limit, overwrite=overwrite, start_timeout=start_time)
        budget, overtaken = FrameBudget(limit / 2, frame_rate), partial(self._count_loss, "/camera", SUPERSEDED)
        self._pictures = PictureEncoder(self._enqueue_picture, budget, lossless=lossless, on_miss=overtaken)
        self._queue: deque[object] = deque()
        self._queued_picture_bytes = 0  # modified by several threads, under the lock
        self._open = self._overflowed = False
        self._unreported_losses: dict[str, Counter[str]] = {}  # by reason; not yet sent to the writer
        self._nodes: Mapping[str, Node] = {}
        self._running_reasons: dict[str, str] = {}  # last recorded message of each running node
        self._feedback_at = float("-inf")
        self._lock = Lock()
        self._queue_shrank, self._closing = Flag(), Flag()
        self._thread: Thread | None = None
        self._clock: Clock | None = None
        self._report: StatusCallback = ignore
        self._health_check: HealthCheck | None = None

    @property
    def path(self) -> Path:
        """Path of the record.

        It is another one than requested if the new record is incomplete, so that an earlier record keeps the requested
        path.
        """
        return self._writer.path

    # --- from beginning to end ----------------------------------------------------------------------------------------

    def open(
        self,
        contents: RecordContents,
        clock: Clock,
        *,
        report: StatusCallback = ignore,
        health_check: HealthCheck | None = None,
    ) -> None:
        """Start the writer process, and wait until the contents are in its file.

        ``clock`` is the run's; ``health_check`` is called in real time only. Raises CannotRecordError.
        """
        self._clock, self._report, self._health_check = clock, report, None if self._lossless else health_check
        self._writer.open(contents)
        self._open = True
        self._pictures.open()
        self._thread = Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def watch_tree(self, root: Node) -> None:
        """Also record the messages of the nodes below ``root`` while they run."""
        self._nodes = {node.key: node for node in root.iterate() if isinstance(node, Node)}

    def close(self) -> RecordLoss:
        """Close the record and end the writer process; return the losses. Safe in any state, idempotent."""
        self._pictures.close()
        self._open = False
        self._closing.set()
        if self._thread is not None:
            farewell = LOSSLESS_CLOSE_TIMEOUT if self._lossless else CLOSE_TIMEOUT
            self._thread.join(farewell)
            if self._thread.is_alive():
                self._writer.abandon(f"the disk was too slow: writing had not ended {farewell:.0f} s after the end")
                self._thread.join()
            self._thread = None
            self._report_problems()
        return self.loss

    @property
    def process_id(self) -> int | None:
        """ID of the writer process; None if it does not run."""
        return self._writer.process_id

    @property
    def loss(self) -> RecordLoss:
        """Number of messages that are known to be missing from the record, by topic, and the reasons."""
        outlet = self._writer
        with self._lock:
            missed = dict(self._unreported_losses)
        why = "; ".join(dict.fromkeys(filter(None, (outlet.reason, *missed))))
        return RecordLoss(dict(sum(missed.values(), Counter(outlet.lost))), why, outlet.limit_reached_at)

    @property
    def counts(self) -> Mapping[str, int]:
        """Number of messages in the record by topic; empty until ``close``."""
        return self._writer.counts

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # --- called by the run, from any thread ---------------------------------------------------------------------------

    def __call__(self, event: Event) -> None:
        """Record an event if ``EVENT_TOPICS`` has a topic for its class.

        Events of other classes are not recorded, because other items, such as those of ticks, contain the same data.
        """
        if type(event).__name__ in EVENT_TOPICS:
            self._enqueue(event)
            if isinstance(event, NodeChanged):
                if event.status in ACTIVE:
                    self._running_reasons[event.node] = event.reason
                else:
                    self._running_reasons.pop(event.node, None)

    def on_tick(self, tick_record: TickRecord) -> None:
        """Record a tick record, and report problems of the writer process on the calling thread."""
        self._enqueue(tick_record)
        if tick_record.t >= self._feedback_at:
            self._feedback_at = tick_record.t + FEEDBACK_INTERVAL
            self._record_feedback(tick_record)
        if self._overflowed and len(self._queue) < MAX_QUEUED_ITEMS // 2:
            self._overflowed = False  # only at the start of a tick, so that no tick is recorded in part
        while (
            self._lossless and self._open and self._writer.accepts_items and len(self._queue) >= MAX_QUEUED_ITEMS // 2
        ):
            self._queue_shrank.clear()
            self._queue_shrank.wait(BATCH_INTERVAL)
        if self._writer.problems:
            self._report_problems()

    def on_view(self, view: View) -> None:
        """Record the percepts of a picture."""
        self._enqueue(ViewItem(0.0 if self._clock is None else self._clock.now(), view))

    def on_frame(self, frame: Frame, gaze: Gaze | None = None) -> None:
        """Record a frame that perception has searched, if the budget accepts it; ``gaze`` is its direction."""
        self._pictures.offer(frame, gaze)

    # --- inside -------------------------------------------------------------------------------------------------------

    def _record_feedback(self, tick_record: TickRecord) -> None:
        """Record new messages of running nodes, for which there is no event."""
        for key, known_reason in list(self._running_reasons.items()):  # a copy: another thread modifies it
            node = self._nodes.get(key)
            if node is not None and node.status is Status.RUNNING and node.reason != known_reason:
                self._running_reasons[key] = node.reason
                self._enqueue(FeedbackItem(tick_record.t, tick_record.tick, key, node.reason))

    def _enqueue(self, item: object) -> bool:
        """Queue an item for the writer, or count it as lost; return whether it is queued."""
        if not self._open:
            return False
        if self._overflowed or len(self._queue) >= MAX_QUEUED_ITEMS or not self._writer.accepts_items:
            self._overflowed = self._writer.accepts_items
            if self._writer.limit_reached_at is None:
                self._count_loss(topic_of(item), self._writer.reason or SLOW_DISK)
            return False
        self._queue.append(item)
        return True

    def _enqueue_picture(self, picture: PictureItem) -> None:
        if self._queued_picture_bytes > MAX_QUEUED_PICTURE_BYTES:
            self._count_loss("/camera", SLOW_DISK)
            return
        if self._enqueue(picture):
            with self._lock:
                self._queued_picture_bytes += len(picture.jpeg)

    def _count_loss(self, topic: str, reason: str) -> None:
        with self._lock:
            self._unreported_losses[reason] = self._unreported_losses.get(reason, Counter()) + Counter({topic: 1})

    def _report_problems(self) -> None:
        """Report new problems of the writer process as faults of the part "record"."""
        while self._writer.problems:
            hint = f"mission record info {shlex.quote(str(self.path))}"
            self._report(DeviceStatus("record", "fault", self._writer.problems.popleft(), hint))

    def _run(self) -> None:
        wall = SystemClock()
        check_at = 0.0
        while not self._closing.wait(BATCH_INTERVAL):
            if self._health_check is not None and wall.now() >= check_at:
                check_at = wall.now() + HEALTH_INTERVAL
                self._record_health(self._health_check)
            self._send_queue()
        self._send_queue()
        if self._writer.limit_reached_at is None:
            self._count_losses(self._queue, self._writer.reason)
        self._writer.finish()

    def _record_health(self, health_check: HealthCheck) -> None:
        with suppress(Exception):  # an exception of a driver must not end the record
            self._enqueue(HealthItem(0.0 if self._clock is None else self._clock.now(), health_check()))

    def _send_queue(self) -> None:
        """Send the queued items and the counts of lost ones to the writer process, then read its status lines."""
        outlet = self._writer
        while self._queue and outlet.accepts_items:
            items = [self._queue.popleft() for _ in range(min(len(self._queue), MAX_BATCH_ITEMS))]
            with self._lock:
                self._queued_picture_bytes -= sum(len(item.jpeg) for item in items if type(item) is PictureItem)
            self._send_batch(items)
            self._queue_shrank.set()
        if outlet.accepts_items and self._unreported_losses and not self._overflowed:
            with self._lock:
                missed, self._unreported_losses = self._unreported_losses, {}
            if not outlet.send(pack_items([LossItem(counts, why) for why, counts in missed.items()])):
                with self._lock:
                    self._unreported_losses = {
                        why: counts + self._unreported_losses.get(why, Counter()) for why, counts in missed.items()
                    }
        outlet.receive()

    def _send_batch(self, items: Sequence[object]) -> None:
        try:
            batch = pack_items(items)
        except Exception:  # a user's value may raise anything when it is pickled: only this item is lost
            if len(items) == 1:
                self._count_losses(items, NOT_PACKABLE)
            else:
                for item in items:
                    self._send_batch([item])
            return
        if not self._writer.send(batch) and self._writer.limit_reached_at is None:
            self._count_losses(items, self._writer.reason)

    def _count_losses(self, items: Iterable[object], reason: str) -> None:
        for item in items:
            self._count_loss(topic_of(item), reason)
