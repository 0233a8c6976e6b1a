"""Executes the commands of clients: stop, release, pause, step, end, drive, tune, and faults."""

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
"""Lower bound when a speed limit is tuned, as a share of the limit in the robot file."""

LIMIT_FIELDS = {"max_speed": "speed", "max_turn": "turn"}
"""Names of the tunable limits in the robot file, each with the field of ``base.limits`` that holds it."""


@dataclass(slots=True)
class TunableValue:
    """A value of the robot that can be changed in a run, such as a trim, with functions to read and write it.

    The bounds ``low`` and ``high`` are in SI units; ``is_tuned`` is true after a change.
    """

    dimension: str
    low: float
    high: float
    read_value: Callable[[], float]
    write_value: Callable[[float], object]
    is_tuned: bool = False


class TunableValues:
    """Values of a robot that can be changed in a run, by names such as ``head.pan.trim``. Not thread-safe."""

    def __init__(self, robot: RobotConfig, devices: Mapping[str, Device]) -> None:
        self._file = "" if robot.path is None else str(robot.path.resolve())
        self._values: dict[str, TunableValue] = {}
        for name, (_, dimension) in file_values(robot).items():
            part, *keys = name.split(".")
            knob = _make_tunable(devices.get(part), keys, dimension)
            if knob is not None:
                self._values[name] = knob

    def as_dict(self) -> Mapping[str, object]:
        """Return all values with their names and bounds as JSON data, the answer to the command `tuning`."""
        return {"file": self._file, "knobs": [_value_dict(name, knob) for name, knob in self._values.items()]}

    def tune(self, name: str, value: float) -> Mapping[str, object]:
        """Set the value ``name``, and return it as JSON data.

        Raises BadMessage if it is unknown or out of bounds, or if the device refuses.
        """
        knob = self._values.get(name)
        if knob is None:
            raise BadMessage("bad_field", f"unknown value '{name}'", did_you_mean(name, self._values))
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
    """Return a tuned value as text for the log: "head pan trim: 3 deg"."""
    return f"{value['name'].replace('.', ' ')}: {quantity_text(value['value'], value['dimension'])}"


def _make_tunable(device: Any, keys: list[str], dimension: str) -> TunableValue | None:
    """Return a tunable value of ``device``, a part of the robot; None if its driver does not support changes.

    ``keys`` is the name of the value split at its dots, such as ["pan", "trim"]; ``dimension`` is that of the value.
    """
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
"""Seconds of simulated time between two rounds in which the simulation thread calls functions queued by other threads.
"""

HALT_TIMEOUT = 5.0
"""Seconds that a run has to end after the command `halt`.

Then it gets SIGTERM, which ends it even if its main thread hangs.
"""

UNKNOWN_USER = "an unknown user"


class CommandHandler:
    """Executes the commands of clients and returns the results. Raises BadMessage. Not thread-safe."""

    def __init__(self, runner: Runner, wheels: WheelArbiter, clock: Clock) -> None:
        self._runner, self._tuning = runner, TunableValues(runner.config, runner.assembled_robot.devices)
        self._faults: Any = None
        self._world_queue: SimpleQueue[Callable[[], None]] = SimpleQueue()
        if runner.twins is not None:
            runner.twins.timeline.call_every(WORLD_INTERVAL, self._run_world_queue)
        self._executive, self._latch, self._wheels, self._clock = runner.executive, runner.latch, wheels, clock
        self._stream = runner.stream
        self.kill_at = inf
        """Time (s) at which the run is sent SIGTERM if it has not ended after the command `halt`; inf without one."""

    def execute(self, client: object, command: ClientCommand) -> Mapping[str, object] | None:
        """Execute the command of ``client``, any hashable key, and return the result for its answer."""
        match command:
            case StopCommand():
                return self._stop(command)
            case DriveCommand() | LookCommand():
                self._move_by_hand(client, command)
            case InjectFaultCommand():
                self._fault_injector().inject(command.what)
            case ListFaultsCommand():
                answer: Mapping[str, object] = self._fault_injector().examples_answer()
                return answer
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
        """Return the fault injector of the plug-in, imported on first use. Raises BadMessage if it is not installed."""
        if self._faults is None:
            faults = service("faults")
            if faults is None:
                raise BadMessage("unsupported", "faults need the plug-in 'testing', which is not installed")
            self._faults = faults(self._runner, self._world_queue.put)
        return self._faults

    def _run_world_queue(self) -> None:
        """Call the functions that are queued for the simulation thread."""
        while not self._world_queue.empty():
            self._world_queue.get_nowait()()

    def _stop(self, command: StopCommand) -> Mapping[str, object]:
        """Latch all parts; return the parts that confirmed it, and the ``missing`` ones, which may still move."""
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
                executive.step()
            case HaltCommand():
                executive.stop(f"halted by {command.by or UNKNOWN_USER}")
                self.kill_at = self._clock.now() + HALT_TIMEOUT
            case _:
                raise BadMessage("unknown_command", f"unknown command for a run: '{command.word}'")

    def _release_error(self) -> BadMessage:
        """Return the error of a release without effect: another stop followed, or nothing is stopped."""
        if self._latch.reason:
            return BadMessage("not_stopped", f"not released: it was {self._latch.reason} again", "release it again")
        hint = "mission stop --resume  (it is paused)" if self._executive.paused else ""
        return BadMessage("not_stopped", "not stopped: nothing to release", hint)

    def _move_by_hand(self, client: object, command: DriveCommand | LookCommand) -> None:
        self._require_released()
        if isinstance(command, DriveCommand):
            self._wheels.drive(client, command)
            return
        if "head" in self._executive.root.claims and not self._executive.paused:
            raise BadMessage("busy", "the mission moves the head itself", "pause")
        self._wheels.look(client, command)

    def _tune(self, command: TuneCommand) -> Mapping[str, object]:
        """Change a value of the robot, and log the change in the record of the run."""
        outcome = self._tuning.tune(command.name, command.value)
        text = f"{command.by or UNKNOWN_USER} has tuned {describe_tuning(outcome)}"
        self._stream.emit(Logged(self._executive.time(), "info", text))
        return outcome

    def kill_if_overdue(self, now: float) -> None:
        """Send SIGTERM to this process if its run has not ended in time after the command `halt`.

        It is not sent if SIGTERM has its default handler, as in a user's own program: that would end the process with
        the robot still open.
        """
        if now >= self.kill_at:
            self.kill_at = inf
            if signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
                os.kill(os.getpid(), signal.SIGTERM)

    def status(self) -> Mapping[str, object]:
        """Return the members of a state message about the last stop, and about the client that drives."""
        stopped = {"stops": self._latch.stop_count, "stopped": self._latch.reason}
        driving = {"driver": self._wheels.driver, "asking": self._wheels.waiting_names}
        return {**stopped, **driving, "stamp": self._wheels.stamp(), "round_trip": round(self._wheels.round_trip, 3)}

    def _require_released(self) -> None:
        if self._latch.reason:
            raise BadMessage("stopped", self._latch.reason, RELEASE_HINT)
