"""The one stream of events that a run makes, and everything else listens to."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from queue import SimpleQueue
from threading import Event as Flag
from threading import Thread

from py_trees.common import Status

from behaviours.node import Node
from missions.executive.events import Event, NodeChanged, Ticked, status_word

Listener = Callable[[Event], None]

Change = tuple[float, int, Node, str, str]
"""A node's new status as the tick keeps it: when, in which tick, which node, its status then, and its reason then."""

Reset = tuple[float, int, Sequence[Node]]
"""Nodes that have forgotten their results: when, in which tick, and which, in order."""

CLOSE_TIMEOUT = 2.0
"""Seconds that slow listeners have, at the end of a run, to hear what is still to be told."""

BATCH_INTERVAL = 0.03
"""Seconds from one telling to the next: what happens meanwhile wakes no thread."""

IDLE_TICK_DELAY = 0.2
"""Seconds for which ticks in which nothing happens wait to be told."""

MAX_QUEUED_EVENTS = 200_000
"""What may wait for slow listeners; what comes on top is counted and lost."""


class EventStream:
    """Passes each event to every listener, in one order, from whichever thread it comes.

    Between ``open`` and ``close`` that happens on a thread of its own: a listener that is slow, stuck or broken never
    holds up a tick or a driver. Otherwise, listeners are told at once. One that raises anything is told no more, and
    named in ``failed_listeners``; the run goes on.

    It is a run's ``NodeObserver``: it makes a NodeChanged of every new status. That is a tick's most frequent event by far,
    so while the stream is open the tick only keeps what is true of the node at that moment; the event is made by the
    stream's thread, and told with whatever comes next: the end of the tick, at the latest.
    """

    def __init__(self, listeners: Iterable[Listener] = ()) -> None:
        self.listeners = list(listeners)
        self.failed_listeners: list[str] = []
        self.dropped_count = 0
        self._queue: deque[Event | Change | Reset] = deque()
        # Wakes the thread; False ends it. An Event would not do: its lock is not for a destructor that logs something.
        self._wakeups: SimpleQueue[bool] = SimpleQueue()
        self._is_ending = Flag()
        self._has_node_changes = False  # a node has, and nobody was woken for it
        self._woken_at = 0.0
        self._thread: Thread | None = None

    def open(self) -> None:
        """Start the thread that tells the listeners."""
        if self._thread is None:
            self._is_ending.clear()
            self._thread = Thread(target=self._run, name="events", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Tell what is still waiting, for ``CLOSE_TIMEOUT`` at most. Safe more than once."""
        if self._thread is not None:
            self._wakeups.put(False)
            self._is_ending.set()
            self._thread.join(CLOSE_TIMEOUT)
            if self._thread.is_alive():
                self.failed_listeners.append("a listener that did not come to an end")
            self._thread = None

    @property
    def has_listeners(self) -> bool:
        """False while an event, told now, would be heard by nobody: it need not even be made."""
        return bool(self.listeners) or self._thread is not None

    def emit(self, event: Event) -> None:
        """Tell all listeners, soon; returns at once and never raises. A tick in which nothing happened can wait."""
        if self._queue_event(event):
            if type(event) is Ticked and not self._has_node_changes and 0 <= event.t - self._woken_at < IDLE_TICK_DELAY:
                return
            self._has_node_changes, self._woken_at = False, event.t
            self._wakeups.put(True)

    def on_status(self, time: float, tick: int, node: Node, status: Status, reason: str) -> None:
        """Tell all listeners of a node's new status, with the next event; returns at once and never raises."""
        del status
        word = status_word(node)
        if (
            self._thread is not None and len(self._queue) < MAX_QUEUED_EVENTS
        ):  # as ``_queue_event`` does, without the call
            self._queue.append((time, tick, node, word, reason))
            self._has_node_changes = True
        else:
            self._queue_event((time, tick, node, word, reason))

    def on_reset(self, time: float, tick: int, nodes: Sequence[Node]) -> None:
        """Tell all listeners of nodes that were reset, with the next event; returns at once and never raises."""
        self._queue_event((time, tick, nodes))
        self._has_node_changes = True

    def _queue_event(self, told: Event | Change | Reset) -> bool:
        """Tell it at once, or keep it for the thread; True if it is kept."""
        if self._thread is None:
            self._deliver(told)
            return False
        if len(self._queue) < MAX_QUEUED_EVENTS:
            self._queue.append(told)
            return True
        self.dropped_count += 1
        return False

    def _run(self) -> None:
        go_on = True
        while go_on:
            go_on = self._wakeups.get()
            while not self._wakeups.empty():
                go_on &= self._wakeups.get()
            while self._queue:
                self._deliver(self._queue.popleft())
            if go_on:
                self._is_ending.wait(BATCH_INTERVAL)

    def _deliver(self, told: Event | Change | Reset) -> None:
        if not self.listeners:
            return
        for event in _expand(told):
            for listener in self.listeners:
                try:
                    listener(event)
                except BaseException as error:
                    self.listeners = [other for other in self.listeners if other is not listener]
                    self.failed_listeners.append(f"{type(listener).__name__}: {str(error) or type(error).__name__}")


def _expand(told: Event | Change | Reset) -> Iterator[Event]:
    """Yield the events that were kept as one."""
    match told:
        case Event():
            yield told
        case time, tick, node, word, reason:
            yield _node_changed(time, tick, node, word, reason)
        case time, tick, nodes:
            for node in nodes:
                yield _node_changed(time, tick, node, "idle", "")


def _node_changed(time: float, tick: int, node: Node, word: str, reason: str) -> NodeChanged:
    return NodeChanged(time, tick, node.key, node.name, node.kind, node.line, word, reason)
