"""What clients of a run may have done: stop and release, pause and step, end, drive, tune, and let things go wrong."""

import os
import signal
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from math import inf
from queue import SimpleQueue
from typing import Any

from config.diagnostics import did_you_mean
from config.robot import RobotConfig
from config.units import quantity_text
from drivers.api import Device, Limitable
from drivers.api.fast_dataclass import dataclass
from drivers.api.sections import MAX_TRIM
from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.head.pantilt import Trimmable
from missions.control.commands import (  # fmt: skip
    BadMessage,
    ClientCommand,
    DriveCommand,
    GiveWheelsCommand,
    HaltCommand,
    InjectFaultCommand,
    ListFaultsCommand,
    ListTuningCommand,
    LookCommand,
    PauseCommand,
    ReleaseCommand,
    ResumeCommand,
    StepCommand,
    StopCommand,
    TakeWheelsCommand,
    TuneCommand,
)
from missions.control.wheels import RELEASE_HINT, WheelArbiter
from missions.executive.events import Logged
from missions.library.plugins import service
from missions.library.tuning import LIMIT_ENDS, file_values
from missions.runner import Runner

MIN_SPEED_SHARE = 0.05
"""The share of its speed that a part keeps at least: slower it gets nowhere."""

LIMIT_FIELDS = {"max_speed": "speed", "max_turn": "turn"}
"""What the limits of a base call the keys of its file."""


@dataclass(slots=True)
class TunableValue:
    """One value: within which bounds it may be, how it is read and how it is set. ``is_tuned`` once somebody has."""

    dimension: str
    low: float
    high: float
    read_value: Callable[[], float]
    write_value: Callable[[float], object]
    is_tuned: bool = False


class TunableValues:
    """The values of a robot's parts by their names, as ``missions.library.tuning`` has them. For one thread."""

    def __init__(self, robot: RobotConfig, devices: Mapping[str, Device]) -> None:
        self._file = "" if robot.path is None else str(robot.path.resolve())
        self._values: dict[str, TunableValue] = {}
        for name, (_, dimension) in file_values(robot).items():
            part, *keys = name.split(".")
            knob = _make_tunable(devices.get(part), keys, dimension)
            if knob is not None:
                self._values[name] = knob

    def as_dict(self) -> Mapping[str, object]:
        """Return what `tuning` is answered."""
        return {"file": self._file, "knobs": [_value_dict(name, knob) for name, knob in self._values.items()]}

    def tune(self, name: str, value: float) -> Mapping[str, object]:
        """Set a value; return what holds. Raises BadMessage."""
        knob = self._values.get(name)
        if knob is None:
            raise BadMessage("bad_field", f"nothing is called '{name}'", did_you_mean(name, self._values))
        if not knob.low <= value <= knob.high:
            ends = " to ".join(quantity_text(end, knob.dimension) for end in (knob.low, knob.high))
            raise BadMessage("bad_field", f"{name}: {quantity_text(value, knob.dimension)} is not within {ends}")
        try:
            knob.write_value(value)
        except DriverError as error:
            raise BadMessage("device", str(error), error.hint) from error
        knob.is_tuned = True
        return _value_dict(name, knob)


def _value_dict(name: str, tunable: TunableValue) -> Mapping[str, object]:
    about = {"name": name, "dimension": tunable.dimension, "low": tunable.low, "high": tunable.high}
    return {**about, "value": tunable.read_value(), "tuned": tunable.is_tuned}


def describe_tuning(value: Mapping[str, Any]) -> str:
    """Return what a value is now, for the log: "head pan trim: 3 deg"."""
    return f"{value['name'].replace('.', ' ')}: {quantity_text(value['value'], value['dimension'])}"


def _make_tunable(device: Any, keys: list[str], dimension: str) -> TunableValue | None:
    """Return how a value of a part is read and set; None where that part's driver does not let it."""
    match keys:
        case [axis, "trim"] if isinstance(device, Trimmable):
            at = ("pan", "tilt").index(axis)
            turn = partial(_set_trim, device, axis)
            return TunableValue(dimension, -MAX_TRIM, MAX_TRIM, lambda: device.trim()[at], turn)
        case ["joints", joint, end] if isinstance(device, Limitable):
            file = device.limits[joint]
            low, high = (file.lower, file.upper) if end in LIMIT_ENDS else (MIN_SPEED_SHARE * file.speed, file.speed)
            return TunableValue(
                dimension,
                low,
                high,
                lambda: getattr(device.limits[joint], end),
                partial(_set_joint_limit, device, joint, end),
            )
        case [key] if isinstance(device, Limitable):
            field = LIMIT_FIELDS.get(key, key)
            high = getattr(device.limits, field)
            return TunableValue(
                dimension,
                MIN_SPEED_SHARE * high,
                high,
                lambda: getattr(device.limits, field),
                partial(_set_limit, device, field),
            )
        case _:
            return None


def _set_trim(device: Trimmable, axis: str, value: float) -> None:
    device.trim(**{axis: value})


def _set_joint_limit(device: Any, joint: str, end: str, value: float) -> None:
    device.restrict_limits({joint: replace(device.limits[joint], **{end: value})})


def _set_limit(device: Any, field: str, value: float) -> None:
    device.restrict_limits(replace(device.limits, **{field: value}))


WORLD_INTERVAL = 0.02
"""Seconds of simulated time until a function that waits for the thread of the simulated world is called."""

HALT_TIMEOUT = 5.0
"""Seconds that a run has to end that was told to; then it gets a SIGTERM, which its watchdog hears as well."""

UNKNOWN_USER = "somebody"


class CommandHandler:
    """Does what the client of a ``key`` commands, and returns what is answered. Raises BadMessage. For one thread."""

    def __init__(self, runner: Runner, wheels: WheelArbiter, clock: Clock) -> None:
        self._runner, self._tuning = runner, TunableValues(runner.config, runner.assembled_robot.devices)
        self._faults: Any = None
        self._world_queue: SimpleQueue[Callable[[], None]] = SimpleQueue()
        if runner.twins is not None:
            runner.twins.timeline.call_every(WORLD_INTERVAL, self._run_world_queue)
        self._executive, self._latch, self._wheels, self._clock = runner.executive, runner.latch, wheels, clock
        self._stream = runner.stream
        self.kill_at = inf
        """When a run that was to end, and does not, gets a signal."""

    def execute(self, client: object, command: ClientCommand) -> Mapping[str, object] | None:
        """Do a command."""
        match command:
            case StopCommand():
                return self._stop(command)
            case DriveCommand() | LookCommand():
                self._move_by_hand(client, command)
            case InjectFaultCommand():
                self._fault_injector().inject(command.what)
            case ListFaultsCommand():
                told: Mapping[str, object] = self._fault_injector().examples_answer()
                return told
            case ListTuningCommand():
                return self._tuning.as_dict()
            case TuneCommand():
                return self._tune(command)
            case TakeWheelsCommand():
                return {"yours": self._wheels.take(client, command.by or UNKNOWN_USER)}
            case GiveWheelsCommand():
                self._wheels.give(client)
            case _:
                self._control_mission(command)
        return None

    def _fault_injector(self) -> Any:
        """Return the plug-in's part that injects faults, imported for the first one. Raises BadMessage without it."""
        if self._faults is None:
            faults = service("faults")
            if faults is None:
                raise BadMessage("unsupported", "faults need the plug-in 'testing', which is not installed")
            self._faults = faults(self._runner, self._world_queue.put)
        return self._faults

    def _run_world_queue(self) -> None:
        """Call the functions that wait for the thread of the simulated world."""
        while not self._world_queue.empty():
            self._world_queue.get_nowait()()

    def _stop(self, command: StopCommand) -> Mapping[str, object]:
        """Latch all, and return which parts have been told, and which are missing: they may move on."""
        parts = self._latch.stop(command.by or UNKNOWN_USER, command.press)
        self._wheels.stop()
        missing = [part for part in self._latch.parts if part not in parts]
        return {"parts": parts, "stops": self._latch.stop_count, **({"missing": missing} if missing else {})}

    def _control_mission(self, command: ClientCommand) -> None:
        executive = self._executive
        match command:
            case ReleaseCommand():
                if not self._latch.release(command.stop):
                    raise self._release_error()
            case PauseCommand():
                executive.pause()
            case ResumeCommand():
                self._require_released()
                executive.resume()
            case StepCommand():
                self._require_released()
                if executive.paused:
                    executive.step()
            case HaltCommand():
                executive.stop(f"halted by {command.by or UNKNOWN_USER}")
                self.kill_at = self._clock.now() + HALT_TIMEOUT
            case _:
                raise BadMessage("unknown_command", f"a run does not know '{command.word}'")

    def _release_error(self) -> BadMessage:
        """Return why a release does nothing: another stop came since, or nothing is stopped."""
        if self._latch.reason:
            return BadMessage("not_stopped", f"not released: it was {self._latch.reason} once more", "release it again")
        hint = "mission stop --resume  (it is paused)" if self._executive.paused else ""
        return BadMessage("not_stopped", "it is not stopped, so there is nothing to release", hint)

    def _move_by_hand(self, client: object, command: DriveCommand | LookCommand) -> None:
        self._require_released()
        if isinstance(command, DriveCommand):
            self._wheels.drive(client, command)
            return
        if "head" in self._executive.root.claims and not self._executive.paused:
            raise BadMessage("busy", "the mission moves the head itself", "pause")
        self._wheels.look(client, command)

    def _tune(self, command: TuneCommand) -> Mapping[str, object]:
        """Change a value of the robot, and have that in the log and the record of the run."""
        told = self._tuning.tune(command.name, command.value)
        text = f"{command.by or UNKNOWN_USER} has tuned {describe_tuning(told)}"
        self._stream.emit(Logged(self._executive.time(), "info", text))
        return told

    def kill_if_overdue(self, now: float) -> None:
        """Send a run that does not end the signal by which even one that hangs does.

        A program of a user's own that has not taken that signal would die of it as it is, its robot open.
        """
        if now >= self.kill_at:
            self.kill_at = inf
            if signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
                os.kill(os.getpid(), signal.SIGTERM)

    def status(self) -> Mapping[str, object]:
        """Return what clients are told of all this."""
        stopped = {"stops": self._latch.stop_count, "stopped": self._latch.reason}
        driving = {"driver": self._wheels.driver, "asking": self._wheels.waiting_names}
        return {**stopped, **driving, "stamp": self._wheels.stamp(), "round_trip": round(self._wheels.round_trip, 3)}

    def _require_released(self) -> None:
        if self._latch.reason:
            raise BadMessage("stopped", self._latch.reason, RELEASE_HINT)
