"""Token by which an utterance is cancelled, from any thread, during synthesis or playback."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, RLock


class CancelToken:
    """Cancellation flag of an utterance, with a callback that ``on_cancel`` sets for the current stage."""

    def __init__(self) -> None:
        self._cancelled = Event()
        self._lock = RLock()  # over what is done, which so happens within ``on_cancel`` or not at all
        self._callback: Callable[[], None] | None = None

    @property
    def is_cancelled(self) -> bool:
        """True once ``cancel`` was called."""
        return self._cancelled.is_set()

    def cancel(self) -> None:
        """Cancel, and call the current callback. Safe more than once, from any thread."""
        with self._lock:
            self._cancelled.set()
            if self._callback is not None:
                self._callback()

    def wait(self, timeout: float) -> bool:
        """Wait for the cancellation, at most ``timeout`` seconds; return whether it was cancelled."""
        return self._cancelled.wait(max(0.0, timeout))

    @contextmanager
    def on_cancel(self, callback: Callable[[], None]) -> Iterator[None]:
        """Context in which ``callback`` is called when the token is cancelled; at once if it already is."""
        with self._lock:
            self._callback = callback
            if self.is_cancelled:
                callback()
        try:
            yield
        finally:
            with self._lock:
                self._callback = None
