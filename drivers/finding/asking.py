"""Who answers on a serial port: asked by the probes that drivers declare, politely.

Nothing is sent to a port that somebody has open, that is no adapter of robots, or whose opening would start a board
anew, unless the user names that port.
"""

from collections.abc import Generator, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

from drivers.api.driver import BrokenDriver, Driver, resolved
from drivers.api.probing import Answer, Ask, Probe
from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.finding.serial_ports import ADAPTERS, SerialPort, Trouble
from drivers.transport.adapter import quicken
from drivers.transport.ports import SerialPort as OpenPort
from drivers.transport.ports import explain, open_port

PATIENCE = 0.002
"""Seconds beyond what a question waits that this computer may be late."""


class Wire(Protocol):
    """A port that is open."""

    def ask(self, question: Ask) -> bytes:
        """Send what is to be sent and return what came back, without the echo. Raises NotConnected when it has gone."""
        ...


@dataclass(frozen=True, slots=True)
class Found:
    """A driver whose device has answered, and what it said."""

    driver: Driver
    answer: Answer

    @property
    def title(self) -> str:
        """The driver, as `mission list drivers` has it."""
        return f"{self.driver.kind}.{self.driver.name}"


@dataclass(frozen=True, slots=True)
class Heard:
    """What came of asking a port: who answered, or why it was not asked, or that nobody did."""

    found: Found | None = None
    unasked: Trouble | None = None
    trouble: Trouble | None = None


class OpenedPort:
    """A real port, at the rate of the newest question; nobody else may have it meanwhile."""

    def __init__(self, path: str, clock: Clock, *, patience: float = PATIENCE) -> None:
        self._path = path
        self._clock = clock
        self._extra = self._patience = patience
        self._port: OpenPort | None = None

    def ask(self, question: Ask) -> bytes:
        """Ask."""
        try:
            port = self._opened(question.baud)
            port.write(question.send)
            heard, echo, end = b"", b"", self._clock.now() + question.wait + self._extra
            while not question.enough(heard) and (left := end - self._clock.now()) > 0:
                heard += port.arrived(left)
                if question.send and not echo and heard.startswith(question.send):
                    heard, echo = heard.removeprefix(question.send), question.send
            return echo + heard if question.keep_echo else heard
        except OSError as error:
            raise explain("ports", self._path, error) from error

    def close(self) -> None:
        """Let the port go, with DTR as it is: a lidar stays at rest, a board is not started once more."""
        port, self._port = self._port, None
        if port is not None:
            with suppress(OSError):
                port.set_dtr(on=True)
            port.close()

    def _opened(self, baud: int) -> OpenPort:
        if self._port is None:
            self._port = open_port("ports", self._path, baud)
            self._extra = self._patience + quicken(self._port)
        elif self._port.baudrate != baud:
            self._port.baudrate = baud
            self._port.reset_input_buffer()
        return self._port


def unasked(port: SerialPort) -> Trouble | None:
    """Say why nothing is sent to a port of which the user has not said that it may be asked; None where it is asked."""
    if port.shut is not None:
        return port.shut
    consent = f"mission ports --ask {port.path}"
    if port.usb is None:
        return Trouble("not asked: nobody knows what is behind it", consent)
    if port.usb.resets:
        what = "not asked: opening it starts an Arduino anew, which may move its servos"
        return Trouble(what, f"{consent}  (hands off the robot)")
    if port.usb.ids not in ADAPTERS:
        return Trouble("not asked: it is no adapter that robots usually have", consent)
    return None


def who_answers(port: SerialPort, drivers: Iterable[Driver], wire: Wire, *, consent: bool = False) -> Heard:
    """Ask a port who is there. Raises DriverError when it goes meanwhile, or cannot be opened after all."""
    reason = port.shut if consent else unasked(port)
    if reason is not None:
        return Heard(unasked=reason)
    candidates = _candidates(port, drivers, every=consent)
    for driver in candidates:
        answer = put(resolved(driver.probe), wire)
        if answer is not None:
            trouble = Trouble(answer.trouble, answer.hint.replace("PORT", port.call)) if answer.trouble else None
            return Heard(Found(driver, answer), trouble=trouble)
    return Heard(trouble=_silence(port, candidates))


def put(probe: Probe, wire: Wire) -> Answer | None:
    """Put the questions of a probe to a wire; return what it concludes."""
    asking: Generator[Ask, bytes, Answer | None] = probe()
    try:
        question = next(asking)
        while True:
            question = asking.send(wire.ask(question))
    except StopIteration as done:
        answer: Answer | None = done.value
        return answer
    finally:
        asking.close()


def drivers_that_probe(all_drivers: Iterable[tuple[str, str, Driver | BrokenDriver]]) -> list[Driver]:
    """Return the drivers that say how they are recognised."""
    return [driver for _, _, driver in all_drivers if isinstance(driver, Driver) and driver.probe]


def look(
    port: SerialPort,
    drivers: Iterable[Driver],
    clock: Clock,
    *,
    consent: bool = False,
    patience: float = PATIENCE,
    path: str = "",
) -> Heard:
    """Open a port and ask who is there; what goes wrong is what came of it. ``path`` is where it lies, if elsewhere."""
    opened = OpenedPort(path or port.path, clock, patience=patience)
    try:
        return who_answers(port, drivers, opened, consent=consent)
    except DriverError as error:
        return Heard(trouble=Trouble(str(error), error.hint))
    finally:
        opened.close()


def certain(port: SerialPort, drivers: Iterable[Driver]) -> Driver | None:
    """Return the driver whose device alone has such an adapter, by its serial number."""
    usb = port.usb
    if usb is None:
        return None
    sure = ((driver, pattern) for driver in drivers for pattern in driver.usb if pattern.count(":") > 1)
    return next((driver for driver, pattern in sure if usb.matches(pattern)), None)


def _candidates(port: SerialPort, drivers: Iterable[Driver], *, every: bool) -> Sequence[Driver]:
    """Return those who may be behind an adapter, the likely ones first; of a port that the user names, all."""
    drivers = list(drivers)
    sure = certain(port, drivers)
    if sure is not None:
        return [sure]
    usb = port.usb
    likely = [driver for driver in drivers if usb is not None and any(usb.matches(each) for each in driver.usb)]
    rest = [driver for driver in drivers if driver not in likely and (every or not driver.usb)]
    return [*likely, *rest]


def _silence(port: SerialPort, asked: Sequence[Driver]) -> Trouble:
    if len(asked) == 1 and certain(port, asked) is asked[0]:
        name = asked[0].about.partition(",")[0].rstrip(".")
        return Trouble(
            f"{name[0].lower()}{name[1:]}, by its adapter, but it is silent", "switch it on, and look at its battery"
        )
    names = ", ".join(f"{driver.kind}.{driver.name}" for driver in asked) or "no driver"
    what = f"nothing answers; asked were: {names}"
    scan = any(driver.name == "dynamixel" for driver in asked)
    cure = "switch on the power of what is behind it: USB feeds the adapter alone; look at the cable"
    return Trouble(what, f"{cure}; mission servo scan --all-bauds --port {port.call}" if scan else cure)
