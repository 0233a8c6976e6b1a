"""Who answers on a serial port: asked by the probes that drivers declare, politely.

Nothing is sent to a port that somebody has open, that is no adapter of robots, or whose opening would start a board
anew, unless the user names that port.
"""

from collections.abc import Generator, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

from drivers.api.driver import BrokenDriver, Driver, resolve_name
from drivers.api.probe import Probe, ProbeRequest, ProbeResult
from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.finding.serial_ports import ADAPTERS, DeviceProblem, SerialPortInfo
from drivers.transport.adapter import reduce_latency
from drivers.transport.ports import SerialPort as OpenPort
from drivers.transport.ports import make_port_error, open_port

EXTRA_TIMEOUT = 0.002
"""Seconds beyond what a question waits that this computer may be late."""


class ProbeWire(Protocol):
    """A port that is open."""

    def exchange(self, request: ProbeRequest) -> bytes:
        """Send what is to be sent and return what came back, without the echo. Raises NotConnected when it has gone."""
        ...


@dataclass(frozen=True, slots=True)
class IdentifiedDevice:
    """A driver whose device has answered, and what it said."""

    driver: Driver
    result: ProbeResult

    @property
    def title(self) -> str:
        """The driver, as `mission list drivers` has it."""
        return f"{self.driver.kind}.{self.driver.name}"


@dataclass(frozen=True, slots=True)
class PortScan:
    """What came of asking a port: who answered, or why it was not asked, or that nobody did."""

    device: IdentifiedDevice | None = None
    skip_reason: DeviceProblem | None = None
    trouble: DeviceProblem | None = None


class ExclusivePort:
    """A real port, at the rate of the newest question; nobody else may have it meanwhile."""

    def __init__(self, path: str, clock: Clock, *, extra_timeout: float = EXTRA_TIMEOUT) -> None:
        self._path = path
        self._clock = clock
        self._total_extra_timeout = self._extra_timeout = extra_timeout
        self._port: OpenPort | None = None

    def exchange(self, request: ProbeRequest) -> bytes:
        """Ask."""
        try:
            port = self._open_at(request.baud)
            port.write(request.send)
            heard, echo, end = b"", b"", self._clock.now() + request.timeout + self._total_extra_timeout
            while not request.is_complete(heard) and (left := end - self._clock.now()) > 0:
                heard += port.read_available(left)
                if request.send and not echo and heard.startswith(request.send):
                    heard, echo = heard.removeprefix(request.send), request.send
            return echo + heard if request.keep_echo else heard
        except OSError as error:
            raise make_port_error("ports", self._path, error) from error

    def close(self) -> None:
        """Let the port go, with DTR as it is: a lidar stays at rest, a board is not started once more."""
        port, self._port = self._port, None
        if port is not None:
            with suppress(OSError):
                port.set_dtr(on=True)
            port.close()

    def _open_at(self, baud: int) -> OpenPort:
        if self._port is None:
            self._port = open_port("ports", self._path, baud)
            self._total_extra_timeout = self._extra_timeout + reduce_latency(self._port)
        elif self._port.baudrate != baud:
            self._port.baudrate = baud
            self._port.reset_input_buffer()
        return self._port


def skip_reason(port: SerialPortInfo) -> DeviceProblem | None:
    """Say why nothing is sent to a port of which the user has not said that it may be asked; None where it is asked."""
    if port.shut is not None:
        return port.shut
    consent = f"mission ports --ask {port.path}"
    if port.usb is None:
        return DeviceProblem("not asked: nobody knows what is behind it", consent)
    if port.usb.resets_on_open:
        what = "not asked: opening it starts an Arduino anew, which may move its servos"
        return DeviceProblem(what, f"{consent}  (hands off the robot)")
    if port.usb.ids not in ADAPTERS:
        return DeviceProblem("not asked: it is no adapter that robots usually have", consent)
    return None


def identify_device(
    port: SerialPortInfo, drivers: Iterable[Driver], wire: ProbeWire, *, consent: bool = False
) -> PortScan:
    """Ask a port who is there. Raises DriverError when it goes meanwhile, or cannot be opened after all."""
    reason = port.shut if consent else skip_reason(port)
    if reason is not None:
        return PortScan(skip_reason=reason)
    candidates = _candidates(port, drivers, include_all=consent)
    for driver in candidates:
        answer = run_probe(resolve_name(driver.probe), wire)
        if answer is not None:
            trouble = DeviceProblem(answer.trouble, answer.hint.replace("PORT", port.call)) if answer.trouble else None
            return PortScan(IdentifiedDevice(driver, answer), trouble=trouble)
    return PortScan(trouble=_no_reply_problem(port, candidates))


def run_probe(probe: Probe, wire: ProbeWire) -> ProbeResult | None:
    """Put the questions of a probe to a wire; return what it concludes."""
    asking: Generator[ProbeRequest, bytes, ProbeResult | None] = probe()
    try:
        question = next(asking)
        while True:
            question = asking.send(wire.exchange(question))
    except StopIteration as done:
        answer: ProbeResult | None = done.value
        return answer
    finally:
        asking.close()


def probing_drivers(all_drivers: Iterable[tuple[str, str, Driver | BrokenDriver]]) -> list[Driver]:
    """Return the drivers that say how they are recognised."""
    return [driver for _, _, driver in all_drivers if isinstance(driver, Driver) and driver.probe]


def probe_port(
    port: SerialPortInfo,
    drivers: Iterable[Driver],
    clock: Clock,
    *,
    consent: bool = False,
    extra_timeout: float = EXTRA_TIMEOUT,
    path: str = "",
) -> PortScan:
    """Open a port and ask who is there; what goes wrong is what came of it. ``path`` is where it lies, if elsewhere."""
    opened = ExclusivePort(path or port.path, clock, extra_timeout=extra_timeout)
    try:
        return identify_device(port, drivers, opened, consent=consent)
    except DriverError as error:
        return PortScan(trouble=DeviceProblem(str(error), error.hint))
    finally:
        opened.close()


def driver_by_serial_number(port: SerialPortInfo, drivers: Iterable[Driver]) -> Driver | None:
    """Return the driver whose device alone has such an adapter, by its serial number."""
    usb = port.usb
    if usb is None:
        return None
    sure = ((driver, pattern) for driver in drivers for pattern in driver.usb if pattern.count(":") > 1)
    return next((driver for driver, pattern in sure if usb.matches(pattern)), None)


def _candidates(port: SerialPortInfo, drivers: Iterable[Driver], *, include_all: bool) -> Sequence[Driver]:
    """Return those who may be behind an adapter, the likely ones first; of a port that the user names, all."""
    drivers = list(drivers)
    sure = driver_by_serial_number(port, drivers)
    if sure is not None:
        return [sure]
    usb = port.usb
    likely = [driver for driver in drivers if usb is not None and any(usb.matches(each) for each in driver.usb)]
    rest = [driver for driver in drivers if driver not in likely and (include_all or not driver.usb)]
    return [*likely, *rest]


def _no_reply_problem(port: SerialPortInfo, drivers: Sequence[Driver]) -> DeviceProblem:
    if len(drivers) == 1 and driver_by_serial_number(port, drivers) is drivers[0]:
        name = drivers[0].about.partition(",")[0].rstrip(".")
        return DeviceProblem(
            f"{name[0].lower()}{name[1:]}, by its adapter, but it is silent", "switch it on, and look at its battery"
        )
    names = ", ".join(f"{driver.kind}.{driver.name}" for driver in drivers) or "no driver"
    what = f"nothing answers; asked were: {names}"
    scan = any(driver.name == "dynamixel" for driver in drivers)
    cure = "switch on the power of what is behind it: USB feeds the adapter alone; look at the cable"
    return DeviceProblem(what, f"{cure}; mission servo scan --all-bauds --port {port.call}" if scan else cure)
