"""What clients of a run may have done: stop and release, pause and step, end, and drive."""

import os
import signal
from collections.abc import Mapping
from math import inf

from drivers.clock import Clock
from missions.executive.events import Logged
from missions.runner import Runner
from missions.studio.commands import (
    Command,
    Drive,
    Fault,
    Faulty,
    Give,
    Halt,
    Look,
    Pause,
    Release,
    Resume,
    Step,
    Stop,
    Take,
    Tune,
    Tuned,
)  # fmt: skip
from missions.studio.faults import Faults
from missions.studio.form import BadMessage
from missions.studio.tuning import Tuning, tuned_in_words
from missions.studio.wheels import Wheels

HALT_TIME = 5.0
"""Seconds that a run has to end that was told to; then it gets a SIGTERM, which its watchdog hears as well."""

SOMEBODY = "somebody"


class Doing:
    """Does what the client of a ``key`` commands, and returns what is answered. Raises BadMessage. For one thread."""

    def __init__(self, runner: Runner, wheels: Wheels, clock: Clock) -> None:
        self._faults, self._tuning = Faults(runner), Tuning(runner.config, runner.assembled.devices)
        self._executive, self._latch, self._wheels, self._clock = runner.executive, runner.latch, wheels, clock
        self._stream = runner.stream
        self.kill_at = inf
        """When a run that was to end, and does not, gets a signal."""

    def do(self, key: object, command: Command) -> Mapping[str, object] | None:
        """Do a command."""
        match command:
            case Stop():
                parts = self._latch.stop(command.by or SOMEBODY, command.press)
                self._wheels.stop()
                return {"parts": parts, "stops": self._latch.number}
            case Drive() | Look():
                self._steer(key, command)
            case Fault():
                self._faults.strike(command.what)
            case Faulty():
                return self._faults.told()
            case Tuned():
                return self._tuning.told()
            case Tune():
                return self._tune(command)
            case Take():
                return {"yours": self._wheels.take(key, command.by or SOMEBODY)}
            case Give():
                self._wheels.give(key)
            case _:
                self._do_to_mission(command)
        return None

    def _do_to_mission(self, command: Command) -> None:
        executive = self._executive
        match command:
            case Release():
                if not self._latch.release(command.stop):
                    which = f"the last one is {self._latch.number}" if self._latch.reason else "none is"
                    raise BadMessage("not_stopped", f"stop {command.stop} is not latched: {which}")
            case Pause():
                executive.pause()
            case Resume():
                self._check_released()
                executive.resume()
            case Step():
                self._check_released()
                if executive.paused:
                    executive.step()
            case Halt():
                executive.stop(f"halted by {command.by or SOMEBODY}")
                self.kill_at = self._clock.now() + HALT_TIME
            case _:
                raise BadMessage("unknown_command", f"a run does not know '{command.word}'")

    def _steer(self, key: object, command: Drive | Look) -> None:
        self._check_released()
        if isinstance(command, Drive):
            self._wheels.drive(key, command)
            return
        if "head" in self._executive.root.claims and not self._executive.paused:
            raise BadMessage("busy", "the mission moves the head itself", "pause")
        self._wheels.look(key, command)

    def _tune(self, command: Tune) -> Mapping[str, object]:
        """Change a value of the robot, and have that in the log and the record of the run."""
        told = self._tuning.tune(command.name, command.value)
        text = f"{command.by or SOMEBODY} has tuned {tuned_in_words(told)}"
        self._stream.emit(Logged(self._executive.time(), "info", text))
        return told

    def look(self, now: float) -> None:
        """Send a run that does not end the signal by which even one that hangs does.

        A program of a user's own that has not taken that signal would die of it as it is, its robot open.
        """
        if now >= self.kill_at:
            self.kill_at = inf
            if signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
                os.kill(os.getpid(), signal.SIGTERM)

    def told(self) -> Mapping[str, object]:
        """Return what clients are told of all this."""
        stopped = {"stops": self._latch.number, "stopped": self._latch.reason}
        return {**stopped, "driver": self._wheels.driver, "asking": self._wheels.asking}

    def _check_released(self) -> None:
        if self._latch.reason:
            raise BadMessage("stopped", self._latch.reason, "release it first")
