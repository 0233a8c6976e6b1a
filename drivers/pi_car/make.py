"""From the keys of a robot file to the drivers of a Raspberry Pi car; each has a guardian of its own."""

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

# From a link to a guardian: a process is started as a port is opened, and its pipes are the line.

COMMAND = (sys.executable, "-I", "-W", "ignore", "-m", "drivers.pi_car.guardian")
"""The program, in Python's isolated mode; what it is to hold comes behind."""

EXIT_TIMEOUT = 1.0
"""Seconds that it is given to let all rest and end, once its standard input has ended."""

SKIPPED_STARTS = 8
"""How often none is started after one that has ended with words: every 5 s or so, one tries anew."""


def offline_hint() -> str:
    """Return what to try where no guardian can hold the pins."""
    return extra_hint("pi", "sudo raspi-config (I2C on)", "i2cdetect -y 1", "does another program use the pins?")


class GuardianLauncher:
    """Starts guardians that hold what ``told`` is about: a ``drivers.transport.link.PortOpener``.

    ``last_message`` are the last ones of a guardian that has ended, until another one answers.
    """

    def __init__(self, config: Mapping[str, Any], command: Sequence[str] = COMMAND) -> None:
        self.last_message = ""
        self._starts_to_skip = 0
        self._command = (*command, json.dumps(config))

    def __call__(self, part: str, port: str, baud: int) -> "GuardianProcess":  # noqa: ARG002 - a pipe has no rate
        """Start one. Raises NotConnected, also for a while after one that could not do its work."""
        if self._starts_to_skip > 0:
            self._starts_to_skip -= 1
            raise NotConnected(f"{part}: {port}: {self.last_message}", hint=offline_hint())
        try:
            return GuardianProcess(self._command, self._on_message)
        except OSError as error:
            raise NotConnected(f"{part}: {port}: {error}", hint="look at the memory and the processes") from error

    def _on_message(self, words: str) -> None:
        self.last_message = words
        self._starts_to_skip = SKIPPED_STARTS if words else 0


class GuardianProcess:
    """A ``drivers.transport.link.LinkPort`` that is a process. All but ``close`` raise OSError when it has ended.

    ``heard`` is told its last words, and nothing whenever it says something else.
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
        """Its number."""
        return self._process.pid

    def read_available(self, timeout: float) -> bytes:
        """Return what it has said; wait up to ``patience`` seconds for the first byte."""
        if not select.select([self._out], [], [], timeout)[0]:
            return b""
        data = os.read(self._out.fileno(), 4096)
        if not data:
            raise PortLostError(self._last_message or "the process that holds the pins has ended", offline_hint())
        if data.startswith(b"! "):  # written whole, as its last words
            self._last_message = data[2:].decode("utf-8", "replace").strip()
        self._on_message(self._last_message)
        return data

    def write(self, data: bytes) -> None:
        """Send ``data`` whole."""
        try:
            whole = os.write(self._in.fileno(), data) == len(data)
        except BrokenPipeError:
            return  # it has ended: what it has said about that is read first
        if not whole:
            raise PortLostError("the process that holds the pins reads nothing", offline_hint())

    def set_dtr(self, *, on: bool) -> None:
        """Do nothing: a pipe has no such line."""

    def close(self) -> None:
        """Let it go: it lets all rest, and ends."""
        with suppress(OSError):
            self._in.close()
        try:
            self._process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        with suppress(OSError):
            self._out.close()


def base(keys: PiCarKeys, site: DriverContext) -> DiffDriveBase:
    """Return the driver of the car."""
    dials = GuardianLauncher(motor_config(keys))
    protocol = GuardianProtocol(
        keys.track, keys.speed_at_full, offline_reason=lambda: dials.last_message, hint=offline_hint()
    )
    return DiffDriveBase(_link(dials, site), site.clock, protocol, **settings_of(keys, site))


def head(keys: PiHeadKeys, site: DriverContext) -> GuardianHead:
    """Return the driver of its pan/tilt."""
    told = {"bus": keys.bus, "address": keys.address, "pan": keys.pan.servo, "tilt": keys.tilt.servo}
    dials = GuardianLauncher(told)
    return GuardianHead(
        _link(dials, site),
        site.clock,
        pan=make_servo_axis(keys.pan),
        tilt=make_servo_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        away=keys.away,
        report=site.report,
        name=site.part,
        offline_reason=lambda: dials.last_message,
        hint=offline_hint(),
    )


def motor_config(keys: PiCarKeys) -> Mapping[str, Any]:
    """Return what a guardian is told of the motors."""
    return {
        "motors": keys.motors,
        "bus": keys.bus,
        "address": keys.address,
        "left": _motor(keys.left),
        "right": _motor(keys.right),
    }


def _motor(keys: CarMotorKeys) -> Mapping[str, int | None]:
    return {"forward": keys.forward, "backward": keys.backward, "enable": keys.enable}


def _link(launcher: GuardianLauncher, site: DriverContext) -> SerialLink:
    """Return a link to a guardian, or to whoever plays it at a port."""
    port = site.port or "the guardian"
    return SerialLink(
        site.part, port, guardian_wire.BAUD, report=site.report, opener=open_link_port if site.port else launcher
    )
