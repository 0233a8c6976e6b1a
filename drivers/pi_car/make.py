"""Factories for the drivers of a Raspberry Pi car; each driver starts a guardian process."""

import json
import os
import select
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from drivers.api.driver import DriverContext
from drivers.base.arbitrated import settings_of
from drivers.base.diff_drive import DiffDriveBase
from drivers.errors import NotConnected
from drivers.extras import extra_hint
from drivers.head.axis import make_servo_axis
from drivers.head.guardian_head import GuardianHead
from drivers.pi_car.declared import CarMotorKeys, PiCarKeys, PiHeadKeys
from drivers.pi_car.driver import GuardianProtocol
from drivers.transport import guardian_wire
from drivers.transport.link import SerialLink, open_link_port
from drivers.transport.ports import PortLostError

# Connection of a link to a guardian: opening the port starts the process, and its pipes are the port.

COMMAND = (sys.executable, "-I", "-W", "ignore", "-m", "drivers.pi_car.guardian")
"""Command line that starts a guardian, in Python's isolated mode; the config is appended as JSON."""

EXIT_TIMEOUT = 1.0
"""Seconds in which the guardian must stop the actuators and exit, after its standard input has ended."""

SKIPPED_STARTS = 8
"""Number of starts of a guardian that are left out after a guardian has exited with an error.

So a guardian is started again about every 5 s, although the link tries more often.
"""


def offline_hint() -> str:
    """Return the hint for a guardian that cannot hold the pins."""
    return extra_hint("pi", "sudo raspi-config (I2C on)", "i2cdetect -y 1", "does another program use the pins?")


class GuardianLauncher:
    """Starts guardian processes for ``config``: a ``drivers.transport.link.PortOpener``.

    ``last_message`` is the last error of a guardian that has exited; empty once a guardian has replied.
    """

    def __init__(self, config: Mapping[str, Any], command: Sequence[str] = COMMAND) -> None:
        self.last_message = ""
        self._starts_to_skip = 0
        self._command = (*command, json.dumps(config))

    def __call__(self, part: str, port: str, baud: int) -> "GuardianProcess":  # noqa: ARG002 - a pipe has no rate
        """Start a guardian. Raises NotConnected, also for a while after a guardian that exited with an error."""
        if self._starts_to_skip > 0:
            self._starts_to_skip -= 1
            raise NotConnected(f"{part}: {port}: {self.last_message}", hint=offline_hint())
        try:
            return GuardianProcess(self._command, self._on_message)
        except OSError as error:
            raise NotConnected(
                f"{part}: {port}: {error}", hint="check the free memory and the number of processes"
            ) from error

    def _on_message(self, words: str) -> None:
        self.last_message = words
        self._starts_to_skip = SKIPPED_STARTS if words else 0


class GuardianProcess:
    """Guardian process as a ``drivers.transport.link.LinkPort``.

    All methods but ``close`` raise OSError after the process has exited. ``on_message`` is called with the last line of
    output if that is an error, else with an empty text.
    """

    def __init__(self, command: Sequence[str], on_message: Callable[[str], None]) -> None:
        self._process = subprocess.Popen(  # noqa: S603 - no shell; a program of ours
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True
        )
        if self._process.stdin is None or self._process.stdout is None:
            raise OSError("a process without pipes")
        self._in, self._out = self._process.stdin, self._process.stdout
        os.set_blocking(self._in.fileno(), False)
        os.set_blocking(self._out.fileno(), False)
        self._on_message = on_message
        self._last_message = ""

    @property
    def pid(self) -> int:
        """Process id of the guardian."""
        return self._process.pid

    def read_available(self, timeout: float) -> bytes:
        """Return the output so far; wait up to ``timeout`` seconds for the first byte."""
        if not select.select([self._out], [], [], timeout)[0]:
            return b""
        data = os.read(self._out.fileno(), 4096)
        if not data:
            raise PortLostError(self._last_message or "the process that holds the pins has ended", offline_hint())
        if data.startswith(b"! "):  # the last error, written in one piece
            self._last_message = data[2:].decode("utf-8", "replace").strip()
        self._on_message(self._last_message)
        return data

    def write(self, data: bytes) -> None:
        """Send ``data`` completely."""
        try:
            whole = os.write(self._in.fileno(), data) == len(data)
        except BrokenPipeError:
            return  # it has exited: its last error is read first
        if not whole:
            raise PortLostError("the process that controls the GPIO pins does not respond", offline_hint())

    def set_dtr(self, *, on: bool) -> None:
        """Do nothing: a pipe has no DTR."""

    def close(self) -> None:
        """Close the guardian's input, so that it stops the actuators and exits; kill it after ``EXIT_TIMEOUT``."""
        with suppress(OSError):
            self._in.close()
        try:
            self._process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        with suppress(OSError):
            self._out.close()


def base(keys: PiCarKeys, context: DriverContext) -> DiffDriveBase:
    """Return the driver of the car."""
    launcher = GuardianLauncher(motor_config(keys))
    protocol = GuardianProtocol(
        keys.track, keys.speed_at_full, offline_reason=lambda: launcher.last_message, hint=offline_hint()
    )
    return DiffDriveBase(_link(launcher, context), context.clock, protocol, **settings_of(keys, context))


def head(keys: PiHeadKeys, context: DriverContext) -> GuardianHead:
    """Return the driver of the car's pan/tilt head."""
    config = {"bus": keys.bus, "address": keys.address, "pan": keys.pan.servo, "tilt": keys.tilt.servo}
    launcher = GuardianLauncher(config)
    return GuardianHead(
        _link(launcher, context),
        context.clock,
        pan=make_servo_axis(keys.pan),
        tilt=make_servo_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        away=keys.away,
        report=context.report,
        name=context.part,
        offline_reason=lambda: launcher.last_message,
        hint=offline_hint(),
    )


def motor_config(keys: PiCarKeys) -> Mapping[str, Any]:
    """Return the config of the motors for a guardian."""
    return {
        "motors": keys.motors,
        "bus": keys.bus,
        "address": keys.address,
        "left": _motor(keys.left),
        "right": _motor(keys.right),
    }


def _motor(keys: CarMotorKeys) -> Mapping[str, int | None]:
    return {"forward": keys.forward, "backward": keys.backward, "enable": keys.enable}


def _link(launcher: GuardianLauncher, context: DriverContext) -> SerialLink:
    """Return a link to a guardian that ``launcher`` starts, or to a virtual guardian if the context has a port."""
    port = context.port or "the guardian"
    return SerialLink(
        context.part,
        port,
        guardian_wire.BAUD,
        report=context.report,
        opener=open_link_port if context.port else launcher,
    )
