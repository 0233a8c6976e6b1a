"""The event stream of a run."""

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
"""A new status of a node: time (s), number of the tick, node, status word, reason."""

Reset = tuple[float, int, Sequence[Node]]
"""Nodes whose results were cleared: time, tick, nodes in order."""

CLOSE_TIMEOUT = 2.0
"""Seconds that slow listeners have at the end of a run."""

BATCH_INTERVAL = 0.03
"""Seconds between two deliveries of events to the listeners; events in between are delivered together."""

IDLE_TICK_DELAY = 0.2
"""Seconds by which tick events are delayed if no other event happens, to wake no thread for them alone."""

MAX_QUEUED_EVENTS = 200_000
"""Maximum number of events queued for slow listeners; further ones are dropped and counted."""


class EventStream:
    """Delivers each event to every listener in one order, from any thread.

    Between ``open`` and ``close``, a thread of the stream calls the listeners, so a slow or broken listener never
    delays a tick or a driver. Otherwise they are called at once. A listener that raises is removed and named in
    ``failed_listeners``.

    The stream is also the ``NodeObserver`` of a run: each new status of a node becomes a NodeChanged event. These are
    the most frequent events, so the tick only stores the values. The thread makes the events from them, and delivers
    them with the next event, at the latest at the end of the tick.
    """

    def __init__(self, listeners: Iterable[Listener] = ()) -> None:
        self.listeners = list(listeners)
        self.failed_listeners: list[str] = []
        self.dropped_count = 0
        self._queue: deque[Event | Change | Reset] = deque()
        # Wakes the thread; False ends it. An Event would not do: its lock can deadlock in a destructor that logs.
        self._wakeups: SimpleQueue[bool] = SimpleQueue()
        self._is_ending = Flag()
        self._has_node_changes = False  # a node has changed, and the thread was not woken for it
        self._woken_at = 0.0
        self._thread: Thread | None = None

    def open(self) -> None:
        """Start the thread that calls the listeners."""
        if self._thread is None:
            self._is_ending.clear()
            self._thread = Thread(target=self._run, name="events", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Deliver the queued events, for at most ``CLOSE_TIMEOUT``. May be called more than once."""
        if self._thread is not None:
            self._wakeups.put(False)
            self._is_ending.set()
            self._thread.join(CLOSE_TIMEOUT)
            if self._thread.is_alive():
                self.failed_listeners.append("a listener that did not finish")
            self._thread = None

    @property
    def has_listeners(self) -> bool:
        """False if an event would reach no listener, so that it need not be made."""
        return bool(self.listeners) or self._thread is not None

    def emit(self, event: Event) -> None:
        """Queue an event for all listeners; does not block or raise.

        If nothing but ticks happens, the tick events are delivered late and together.
        """
        if self._queue_event(event):
            if type(event) is Ticked and not self._has_node_changes and 0 <= event.t - self._woken_at < IDLE_TICK_DELAY:
                return
            self._has_node_changes, self._woken_at = False, event.t
            self._wakeups.put(True)

    def on_status(self, time: float, tick: int, node: Node, status: Status, reason: str) -> None:
        """Queue the new status of a node, delivered with the next event; does not block or raise."""
        del status
        word = status_word(node)
        if self._thread is not None and len(self._queue) < MAX_QUEUED_EVENTS:  # `_queue_event` inlined, for speed
            self._queue.append((time, tick, node, word, reason))
            self._has_node_changes = True
        else:
            self._queue_event((time, tick, node, word, reason))

    def on_reset(self, time: float, tick: int, nodes: Sequence[Node]) -> None:
        """Queue the reset of nodes, delivered with the next event; does not block or raise."""
        self._queue_event((time, tick, nodes))
        self._has_node_changes = True

    def _queue_event(self, told: Event | Change | Reset) -> bool:
        """Queue an item, or deliver it at once if the stream is not open; return True if it was queued."""
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
    """Yield the events that a queued item stands for: itself, or one for each node in it."""
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
