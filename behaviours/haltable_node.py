"""Halting of a leaf: terminate, grace period, forced stop of its actuators."""

from threading import Lock
from typing import ClassVar

from py_trees.common import Status

from behaviours.node import Node
from behaviours.run import log
from drivers.api import COMMAND_TIMEOUT
from drivers.errors import DeviceFault, NotConnected

IDLE = Status.INVALID

UNPAUSED_PARTS = frozenset({"base", "voice", "screen"})
"""Parts that are not stopped when their leaf is not ticked for a while.

A base stops by itself after COMMAND_TIMEOUT. A voice finishes its text, and a screen keeps its content.
"""

TIME_TOLERANCE = 1e-6
"""Tolerance in seconds for rounding errors when tick periods are added up."""

AT_REST, STARTING, WORKING, HALTING = range(4)
"""Stages of a leaf: at rest; ``initialise`` called; ``initialise`` returned; ``terminate`` called by a halt."""


MOVED_PARTS_LOCK = Lock()
"""Held to add to the moved parts of a leaf, so that two threads of it do not lose a part of each other."""


class HaltableNode(Node):
    """Base class of ``behaviours.leaf.Leaf`` that halts a leaf: waits for its end, or stops its actuators."""

    drives: ClassVar[frozenset[str]] = frozenset()
    halt_limit: ClassVar[float] = 1.0
    _has_terminate: ClassVar[bool] = False  # it has a terminate of its own
    _leaf_stage = AT_REST
    _halt_by: float | None = None
    _halt_tick = -1
    _unticked_since = 0.0
    _unticked = -2  # the newest tick in which it was not ticked, or suspended
    _paused = False
    _moved_late = False  # it moved something after its end, or after a halt had begun
    moved_parts: frozenset[str] = frozenset()
    """Parts that the leaf has moved since its start, whether it claims them or not."""

    @property
    def is_acting(self) -> bool:
        """True from the start until the leaf has ended or come to rest, so while it may drive its actuators."""
        return self._leaf_stage != AT_REST

    @property
    def claims(self) -> frozenset[str]:
        """Actuators that the leaf drives, or has moved without a claim."""
        return self.drives | self.moved_parts

    @property
    def may_move(self) -> bool:
        """True while the leaf is ticked or halted; for its threads also between two ticks, unless those are paused."""
        run, works = self.run, self._leaf_stage in (STARTING, WORKING)
        return run.active_leaf is self or (works and not run.is_held and run.tick - self.visited_tick <= 1)

    def permit_motion(self) -> None:
        """Permit a command that moves a part. Raises DeviceFault if the leaf must not move anything now.

        A leaf within a ``finally`` never may. Of another leaf, such a command comes from a thread that the leaf has
        left behind, or from a leaf that uses its robot.
        """
        if self.in_finally:
            detail = "kept still: a behaviour in 'finally' must not move anything"
            raise DeviceFault(detail, hint="do it before the end")
        if not self.may_move:
            hint = "let a behaviour move only parts of its own robot, and only while it runs"
            raise DeviceFault(f"kept still: {self.label} is not ticked now", hint=hint)

    def on_motion(self, part: str) -> None:
        """Note that a command has moved ``part``; stop it, and raise DeviceFault, if the leaf was halted meanwhile."""
        # Noted before the check: a halt in another thread stops the part, or the check sees the halt.
        if part not in self.moved_parts:
            with MOVED_PARTS_LOCK:
                self.moved_parts |= {part}
        self._moved_late |= self._leaf_stage not in (STARTING, WORKING)
        if not self.may_move:
            self.run.safe_stop(frozenset({part}))
            self.permit_motion()

    @property
    def label(self) -> str:
        """Name and line of the leaf for messages: "drive (line 4)"."""
        return f"{self.name} (line {self.line})" if self.line else self.name

    def halting(self) -> bool:
        """Return True while the leaf still needs time to stop. Called at each tick after ``terminate(INVALID)``.

        After ``halt_limit`` seconds its actuators are stopped anyway.
        """
        return False

    def on_pause(self) -> None:
        """Stop the actuators of a leaf that was not ticked, or was suspended, for ``COMMAND_TIMEOUT`` seconds.

        The next tick resumes the leaf. By default a base (it stops by itself), voice and screen are left alone.
        """
        if moving := self.claims - UNPAUSED_PARTS:
            self.run.safe_stop(moving)

    def _count_unticked_time(self) -> None:
        """Count the time without a tick, and call ``on_pause`` once after COMMAND_TIMEOUT."""
        now, tick = self.run.now(), self.run.tick
        if tick - self._unticked > 1:  # it was ticked in between
            self._unticked_since, self._paused = now if self.run.last_tick_at is None else self.run.last_tick_at, False
        self._unticked = tick
        if self._paused or now - self._unticked_since < COMMAND_TIMEOUT - TIME_TOLERANCE:
            return
        self._paused = True
        try:
            self.on_pause()
        except BaseException as error:  # as in _terminate
            if not isinstance(error, NotConnected):
                log.exception("%s raised while it paused", self.label)
            self._stop_safely()
            if self._is_interrupt(error):
                raise

    def _terminate(self, status: Status) -> None:
        if not self._has_terminate:  # it says nothing of what it moves: that holds still
            self._stop_safely()
            return
        try:
            self.terminate(status)
        except BaseException as error:  # what cannot be stopped politely is stopped by its driver
            if not isinstance(error, NotConnected):
                log.exception("%s raised while it stopped", self.label)
            self._stop_safely()
            if self._is_interrupt(error):
                raise

    def _is_interrupt(self, error: BaseException) -> bool:
        """Return True for a Ctrl-C of the user, which is not an error of the leaf."""
        return self.run.interruptible and isinstance(error, KeyboardInterrupt)

    def _stop_safely(self) -> None:
        if claims := self.claims:
            try:
                self.run.safe_stop(claims)
            except Exception:  # as in _terminate
                log.exception("%s: its actuators could not be stopped", self.label)

    def abandon_halt(self) -> None:
        """Mark the leaf as at rest, even if it is starting or halting; the caller has stopped its actuators."""
        self._leaf_stage, self._halt_by = AT_REST, None

    def _has_stopped(self) -> bool:
        now = self.run.now()
        if self._halt_by is None:
            self._leaf_stage, self._halt_by = HALTING, now + self.halt_limit
            self._terminate(IDLE)
        elif self._halt_tick == self.run.tick:
            return False
        self._halt_tick = self.run.tick
        if self._is_still_halting():
            if now < self._halt_by:
                return False
            self._stop_safely()
        elif self._moved_late:
            self._stop_safely()
        self._leaf_stage, self._halt_by = AT_REST, None
        return True

    def _is_still_halting(self) -> bool:
        try:
            return self.halting()
        except BaseException as error:  # as in _terminate
            log.exception("%s raised while it stopped", self.label)
            self._stop_safely()
            if self._is_interrupt(error):
                raise
            return False
