"""What clients of a run may have done: stop and release, pause and step, end, drive, tune, and let things go wrong."""

import os
import signal
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from math import inf
from queue import SimpleQueue
from typing import Any

from config.faults import did_you_mean
from config.robot import RobotConfig
from config.units import written
from drivers.api import Curbed, Device
from drivers.api.quick import dataclass
from drivers.api.sections import LARGEST_TRIM
from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.head.pantilt import Trimmable
from missions.control.commands import (  # fmt: skip
    BadMessage,
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
)
from missions.control.wheels import RELEASE, Wheels
from missions.executive.events import Logged
from missions.library.plugins import service
from missions.library.tuning import LIMITS, filed
from missions.runner import Runner

SLOWEST = 0.05
"""The share of its speed that a part keeps at least: slower it gets nowhere."""

FIELDS = {"max_speed": "speed", "max_turn": "turn"}
"""What the limits of a base call the keys of its file."""


@dataclass(slots=True)
class Knob:
    """One value: within which bounds it may be, how it is read and how it is set. ``tuned`` once somebody has."""

    dimension: str
    low: float
    high: float
    now: Callable[[], float]
    turn: Callable[[float], object]
    tuned: bool = False


class Tuning:
    """The values of a robot's parts by their names, as ``missions.library.tuning`` has them. For one thread."""

    def __init__(self, robot: RobotConfig, devices: Mapping[str, Device]) -> None:
        self._file = "" if robot.path is None else str(robot.path.resolve())
        self._knobs: dict[str, Knob] = {}
        for name, (_, dimension) in filed(robot).items():
            part, *keys = name.split(".")
            knob = _knob(devices.get(part), keys, dimension)
            if knob is not None:
                self._knobs[name] = knob

    def told(self) -> Mapping[str, object]:
        """Return what `tuning` is answered."""
        return {"file": self._file, "knobs": [_told(name, knob) for name, knob in self._knobs.items()]}

    def tune(self, name: str, value: float) -> Mapping[str, object]:
        """Set a value; return what holds. Raises BadMessage."""
        knob = self._knobs.get(name)
        if knob is None:
            raise BadMessage("bad_field", f"nothing is called '{name}'", did_you_mean(name, self._knobs))
        if not knob.low <= value <= knob.high:
            ends = " to ".join(written(end, knob.dimension) for end in (knob.low, knob.high))
            raise BadMessage("bad_field", f"{name}: {written(value, knob.dimension)} is not within {ends}")
        try:
            knob.turn(value)
        except DriverError as error:
            raise BadMessage("device", str(error), error.hint) from error
        knob.tuned = True
        return _told(name, knob)


def _told(name: str, knob: Knob) -> Mapping[str, object]:
    about = {"name": name, "dimension": knob.dimension, "low": knob.low, "high": knob.high}
    return {**about, "value": knob.now(), "tuned": knob.tuned}


def tuned_in_words(told: Mapping[str, Any]) -> str:
    """Return what a value is now, for the log: "head pan trim: 3 deg"."""
    return f"{told['name'].replace('.', ' ')}: {written(told['value'], told['dimension'])}"


def _knob(device: Any, keys: list[str], dimension: str) -> Knob | None:
    """Return how a value of a part is read and set; None where that part's driver does not let it."""
    match keys:
        case [axis, "trim"] if isinstance(device, Trimmable):
            at = ("pan", "tilt").index(axis)
            turn = partial(_trim, device, axis)
            return Knob(dimension, -LARGEST_TRIM, LARGEST_TRIM, lambda: device.trim()[at], turn)
        case ["joints", joint, end] if isinstance(device, Curbed):
            file = device.limits[joint]
            low, high = (file.lower, file.upper) if end in LIMITS else (SLOWEST * file.speed, file.speed)
            return Knob(
                dimension, low, high, lambda: getattr(device.limits[joint], end), partial(_bend, device, joint, end)
            )
        case [key] if isinstance(device, Curbed):
            field = FIELDS.get(key, key)
            high = getattr(device.limits, field)
            return Knob(
                dimension, SLOWEST * high, high, lambda: getattr(device.limits, field), partial(_curb, device, field)
            )
        case _:
            return None


def _trim(device: Trimmable, axis: str, value: float) -> None:
    device.trim(**{axis: value})


def _bend(device: Any, joint: str, end: str, value: float) -> None:
    device.curb({joint: replace(device.limits[joint], **{end: value})})


def _curb(device: Any, field: str, value: float) -> None:
    device.curb(replace(device.limits, **{field: value}))


WORLD_INTERVAL = 0.02
"""Seconds of simulated time until a function that waits for the thread of the simulated world is called."""

HALT_TIME = 5.0
"""Seconds that a run has to end that was told to; then it gets a SIGTERM, which its watchdog hears as well."""

SOMEBODY = "somebody"


class Doing:
    """Does what the client of a ``key`` commands, and returns what is answered. Raises BadMessage. For one thread."""

    def __init__(self, runner: Runner, wheels: Wheels, clock: Clock) -> None:
        self._runner, self._tuning = runner, Tuning(runner.config, runner.assembled.devices)
        self._faults: Any = None
        self._in_world: SimpleQueue[Callable[[], None]] = SimpleQueue()
        if runner.twins is not None:
            runner.twins.timeline.every(WORLD_INTERVAL, self._do_in_world)
        self._executive, self._latch, self._wheels, self._clock = runner.executive, runner.latch, wheels, clock
        self._stream = runner.stream
        self.kill_at = inf
        """When a run that was to end, and does not, gets a signal."""

    def do(self, key: object, command: Command) -> Mapping[str, object] | None:
        """Do a command."""
        match command:
            case Stop():
                return self._stop(command)
            case Drive() | Look():
                self._steer(key, command)
            case Fault():
                self._faults_of_run().strike(command.what)
            case Faulty():
                told: Mapping[str, object] = self._faults_of_run().told()
                return told
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

    def _faults_of_run(self) -> Any:
        """Return the plug-in's part that injects faults, imported for the first one. Raises BadMessage without it."""
        if self._faults is None:
            faults = service("faults")
            if faults is None:
                raise BadMessage("unsupported", "faults need the plug-in 'testing', which is not installed")
            self._faults = faults(self._runner, self._in_world.put)
        return self._faults

    def _do_in_world(self) -> None:
        """Call the functions that wait for the thread of the simulated world."""
        while not self._in_world.empty():
            self._in_world.get_nowait()()

    def _stop(self, command: Stop) -> Mapping[str, object]:
        """Latch all, and return which parts have been told, and which are missing: they may move on."""
        parts = self._latch.stop(command.by or SOMEBODY, command.press)
        self._wheels.stop()
        missing = [part for part in self._latch.parts if part not in parts]
        return {"parts": parts, "stops": self._latch.number, **({"missing": missing} if missing else {})}

    def _do_to_mission(self, command: Command) -> None:
        executive = self._executive
        match command:
            case Release():
                if not self._latch.release(command.stop):
                    raise self._not_released()
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

    def _not_released(self) -> BadMessage:
        """Return why a release does nothing: another stop came since, or nothing is stopped."""
        if self._latch.reason:
            return BadMessage("not_stopped", f"not released: it was {self._latch.reason} once more", "release it again")
        hint = "mission stop --resume  (it is paused)" if self._executive.paused else ""
        return BadMessage("not_stopped", "it is not stopped, so there is nothing to release", hint)

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
        driving = {"driver": self._wheels.driver, "asking": self._wheels.asking}
        return {**stopped, **driving, "stamp": self._wheels.stamp(), "round_trip": round(self._wheels.round_trip, 3)}

    def _check_released(self) -> None:
        if self._latch.reason:
            raise BadMessage("stopped", self._latch.reason, RELEASE)
