"""Client of a worker process: blocking requests with cancellation and timeouts."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import Enum
from threading import Condition
from typing import Final

from drivers.api import DeviceStatus, StatusCallback, ignore
from drivers.clock import Clock
from drivers.errors import NoReply, NotConnected
from drivers.sound.cancel_token import CancelToken
from drivers.transport.loop import guard_callback
from drivers.transport.worker_process import Message, WorkerProcess

START_TIMEOUT = 5.0
"""Seconds that a request waits for a worker program to become ready, also if it must be started again."""

HANG_TIMEOUT = 10.0
"""Seconds from the start of a worker program after which it counts as hanging if it is not ready."""

MAX_DEATHS = 3
"""Number of consecutive exits of the worker program after which requests fail at once.

The program is still restarted.
"""


class ProgramState(Enum):
    """State of a worker program. In the state DEAD, the ``WorkerProcess`` restarts it."""

    CLOSED, STARTING, READY, DEAD = range(4)


class ProgramEvent(Enum):
    """Event of a worker program or of its ``WorkerProcess``."""

    OPEN, START, READY, DIE, CLOSE = range(5)


TRANSITIONS: Final = {
    **{(state, ProgramEvent.CLOSE): ProgramState.CLOSED for state in ProgramState},
    (ProgramState.CLOSED, ProgramEvent.OPEN): ProgramState.STARTING,
    (ProgramState.STARTING, ProgramEvent.START): ProgramState.STARTING,
    (ProgramState.STARTING, ProgramEvent.READY): ProgramState.READY,
    (ProgramState.STARTING, ProgramEvent.DIE): ProgramState.DEAD,
    (ProgramState.READY, ProgramEvent.DIE): ProgramState.DEAD,
    (ProgramState.DEAD, ProgramEvent.START): ProgramState.STARTING,
}
"""Next state of a worker program by state and event. Other pairs change nothing.

They occur if a message arrives late from a program that is being closed.
"""


class WorkerClient(ABC):
    """Client of the worker process ``worker``: waits for its replies. Subclasses handle its messages.

    It is a ``drivers.transport.worker_process.WorkerHandler``. ``hint`` is the hint in its errors.
    """

    def __init__(self, worker: WorkerProcess, clock: Clock, *, report: StatusCallback = ignore, hint: str = "") -> None:
        self._worker = worker
        self._clock = clock
        self._report = guard_callback(report)
        self._hint = hint
        self._condition = Condition()  # guards all messages and states
        self._program_state = ProgramState.CLOSED
        self._started_at = 0.0  # when it was started last
        self._deaths = 0  # in a row
        self._missing_reason = ""
        self._reported: set[DeviceStatus] = set()

    def open(self) -> None:
        """Start the program; returns at once. Safe more than once."""
        if self._program_state is ProgramState.CLOSED:
            self._handle_program(ProgramEvent.OPEN)
            self._worker.open(self)

    def close(self) -> None:
        """End the program. Safe from any state, more than once."""
        self._handle_program(ProgramEvent.CLOSE)
        self._worker.close()
        with self._condition:
            self._deaths, self._missing_reason = 0, ""
            self._condition.notify_all()

    @property
    def _is_ready(self) -> bool:
        return self._program_state is ProgramState.READY

    def _handle_program(self, event: ProgramEvent) -> None:
        with self._condition:
            self._program_state = TRANSITIONS.get((self._program_state, event), self._program_state)
            self._condition.notify_all()

    @property
    def failure_reason(self) -> str:
        """Reason of a permanent failure, or an empty string."""
        health = self._worker.health()
        return self._missing_reason or (health.detail if self._deaths >= MAX_DEATHS and not health.online else "")

    def _wait_until_ready(self, token: CancelToken) -> bool:
        """Wait until the program is ready; return False if cancelled. Raises NotConnected and NoReply."""
        with token.on_cancel(self._wake), self._condition:
            settled = ProgramState.READY, ProgramState.CLOSED
            self._condition.wait_for(
                lambda: self._program_state in settled or token.is_cancelled or self.failure_reason, START_TIMEOUT
            )
            if self._is_ready or token.is_cancelled:
                return not token.is_cancelled
            stuck = self._worker.health().online and self._clock.now() - self._started_at > HANG_TIMEOUT
        if stuck and not self.failure_reason:
            self._worker.kill()
            raise NoReply(f"{self._worker.name}: its program hangs while it starts", hint=self._hint)
        raise NotConnected(self.failure_reason or self._worker.health().detail or "it does not start", hint=self._hint)

    def _wait_until(self, condition: Callable[[], object], token: CancelToken, timeout: float) -> bool:
        """Wait until ``condition`` is true; return False after ``timeout`` seconds or when cancelled.

        Raises NotConnected if the program dies meanwhile.
        """
        with token.on_cancel(self._wake), self._condition:
            self._condition.wait_for(lambda: condition() or token.is_cancelled or not self._is_ready, timeout)
            if condition():
                return True
            if not self._is_ready and not token.is_cancelled:
                raise NotConnected(self._worker.health().detail or "the program died", hint=self._hint)
            return False

    def _wake(self) -> None:
        with self._condition:
            self._condition.notify_all()

    @abstractmethod
    def _handle_message(self, message: Message, body: bytes) -> DeviceStatus | None:
        """Handle a message of the worker; return a fault to report once, or None. Called with the lock held."""

    # --- the worker's thread ------------------------------------------------------------------------------------------

    def on_started(self) -> None:
        """Start the timeout of the worker program, which has been started and sends a message when it is ready."""
        self._started_at = self._clock.now()
        self._handle_program(ProgramEvent.START)

    def on_message(self, message: Message, body: bytes) -> None:
        """Handle a message of the worker, and wake the threads that wait for it."""
        with self._condition:
            notice = self._process_message(message, body)
            self._condition.notify_all()
        if notice is not None and notice not in self._reported:
            self._reported.add(notice)
            self._report(notice)

    def _process_message(self, message: Message, body: bytes) -> DeviceStatus | None:
        if "ready" in message:
            self._handle_program(ProgramEvent.READY)
            self._deaths = 0
            return None
        if "absent" in message:
            self._missing_reason = f"{self._worker.name}: {message['absent']}"
            return DeviceStatus(self._worker.name, "fault", self._missing_reason, self._hint)
        return self._handle_message(message, body)

    def on_exit(self, reason: str) -> None:  # noqa: ARG002 - the worker reports it
        """Store that the worker program has exited."""
        self._deaths += 1
        self._handle_program(ProgramEvent.DIE)
