"""Identify the device on a serial port, with the probes that drivers declare.

Nothing is sent to a port that another program has open. Unless the user names the port, nothing is sent either if its
adapter is of an unknown kind, or if opening it would reset a board.
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
"""Seconds added to the timeout of each request, since this computer may be late."""


class ProbeWire(Protocol):
    """Open port for a probe."""

    def exchange(self, request: ProbeRequest) -> bytes:
        """Send a request and return the reply. Raises NotConnected if the port is gone.

        An echo of the request is removed, unless ``request.keep_echo`` is True.
        """
        ...


@dataclass(frozen=True, slots=True)
class IdentifiedDevice:
    """Driver whose device has replied to its probe, and the result of the probe."""

    driver: Driver
    result: ProbeResult

    @property
    def title(self) -> str:
        """Kind and name of the driver, such as ``base.kobuki``."""
        return f"{self.driver.kind}.{self.driver.name}"


@dataclass(frozen=True, slots=True)
class PortScan:
    """Result of probing a port: the identified device, or the reason why it was not probed, or a problem.

    A problem may be a missing reply, or one that the identified device reports.
    """

    device: IdentifiedDevice | None = None
    skip_reason: DeviceProblem | None = None
    trouble: DeviceProblem | None = None


class ExclusivePort:
    """Serial port for a probe, opened exclusively; each request sets its baud rate."""

    def __init__(self, path: str, clock: Clock, *, extra_timeout: float = EXTRA_TIMEOUT) -> None:
        self._path = path
        self._clock = clock
        self._total_extra_timeout = self._extra_timeout = extra_timeout
        self._port: OpenPort | None = None

    def exchange(self, request: ProbeRequest) -> bytes:
        try:
            port = self._open_at(request.baud)
            port.write(request.send)
            received, echo, end = b"", b"", self._clock.now() + request.timeout + self._total_extra_timeout
            while not request.is_complete(received) and (left := end - self._clock.now()) > 0:
                received += port.read_available(left)
                if request.send and not echo and received.startswith(request.send):
                    received, echo = received.removeprefix(request.send), request.send
            return echo + received if request.keep_echo else received
        except OSError as error:
            raise make_port_error("ports", self._path, error) from error

    def close(self) -> None:
        """Close the port with DTR on, so that a lidar stays at rest and a board is not reset again."""
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
    """Return the reason why probing a port needs the user's consent; None if it needs no consent."""
    if port.shut is not None:
        return port.shut
    consent = f"mission ports --ask {port.path}"
    if port.usb is None:
        return DeviceProblem("not probed: the device behind it is unknown", consent)
    if port.usb.resets_on_open:
        message = "not probed: opening it restarts an Arduino, which may move its servos"
        return DeviceProblem(message, f"{consent}  (hands off the robot)")
    if port.usb.ids not in ADAPTERS:
        return DeviceProblem("not probed: robots do not usually have this adapter", consent)
    return None


def identify_device(
    port: SerialPortInfo, drivers: Iterable[Driver], wire: ProbeWire, *, consent: bool = False
) -> PortScan:
    """Probe a port for a device. Raises DriverError if the port is gone, or cannot be opened."""
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
    """Exchange the requests of a probe over ``wire``; return its result, None if the device is not identified."""
    generator: Generator[ProbeRequest, bytes, ProbeResult | None] = probe()
    try:
        request = next(generator)
        while True:
            request = generator.send(wire.exchange(request))
    except StopIteration as stop:
        answer: ProbeResult | None = stop.value
        return answer
    finally:
        generator.close()


def probing_drivers(all_drivers: Iterable[tuple[str, str, Driver | BrokenDriver]]) -> list[Driver]:
    """Return the drivers that have a probe."""
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
    """Open a serial port and probe it; an error becomes a problem in the result.

    ``consent`` allows ports that are otherwise skipped. ``path`` is the device file to open, if it is not
    ``port.path``.
    """
    opened = ExclusivePort(path or port.path, clock, extra_timeout=extra_timeout)
    try:
        return identify_device(port, drivers, opened, consent=consent)
    except DriverError as error:
        return PortScan(trouble=DeviceProblem(str(error), error.hint))
    finally:
        opened.close()


def driver_by_serial_number(port: SerialPortInfo, drivers: Iterable[Driver]) -> Driver | None:
    """Return the driver that the USB adapter of a port identifies by its serial number; None if none does.

    Such adapters are built into the device, like that of a Kobuki.
    """
    usb = port.usb
    if usb is None:
        return None
    patterns = ((driver, pattern) for driver in drivers for pattern in driver.usb if pattern.count(":") > 1)
    return next((driver for driver, pattern in patterns if usb.matches(pattern)), None)


def _candidates(port: SerialPortInfo, drivers: Iterable[Driver], *, include_all: bool) -> Sequence[Driver]:
    """Return the drivers whose probes are tried on a port, likely ones first.

    ``include_all`` adds the drivers for other USB adapters.
    """
    drivers = list(drivers)
    certain = driver_by_serial_number(port, drivers)
    if certain is not None:
        return [certain]
    usb = port.usb
    likely = [driver for driver in drivers if usb is not None and any(usb.matches(each) for each in driver.usb)]
    rest = [driver for driver in drivers if driver not in likely and (include_all or not driver.usb)]
    return [*likely, *rest]


def _no_reply_problem(port: SerialPortInfo, drivers: Sequence[Driver]) -> DeviceProblem:
    if len(drivers) == 1 and driver_by_serial_number(port, drivers) is drivers[0]:
        name = drivers[0].about.partition(",")[0].rstrip(".")
        return DeviceProblem(
            f"{name[0].lower()}{name[1:]}, by its adapter, but it is silent", "switch it on, and check its battery"
        )
    names = ", ".join(f"{driver.kind}.{driver.name}" for driver in drivers) or "no driver"
    message = f"no reply; probed: {names}"
    scan = any(driver.name == "dynamixel" for driver in drivers)
    fix = "switch on the power of the device: USB powers only the adapter; check the cable"
    return DeviceProblem(message, f"{fix}; mission servo scan --all-bauds --port {port.call}" if scan else fix)
