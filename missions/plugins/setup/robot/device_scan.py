"""Scan of connected devices for a new robot; replies are saved, so that no port is opened twice."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from drivers.api.driver import Driver
from drivers.api.sections import SerialKeys
from drivers.clock import SystemClock
from drivers.finding.hardware_scan import HardwareScan, ScannedPort, scan_hardware
from drivers.finding.machine import HostMachine
from drivers.finding.port_probe import EXTRA_TIMEOUT, PortScan, driver_by_serial_number, probe_port, probing_drivers
from drivers.finding.serial_ports import SerialPortInfo
from missions.library.drivers import DriverTable
from missions.plugins.setup.ports import port_lines
from missions.plugins.setup.robot.dialogue import Dialogue

NO_DEVICE = "nothing"


@dataclass(frozen=True, slots=True)
class ProbedDevice:
    """A device that replied on a port, or that the user named: its driver, port and description.

    ``keys`` are values for its section of the robot file. ``units`` are its servos: ID, model and fault of each.
    """

    driver: Driver
    port: SerialPortInfo
    about: str = ""
    keys: dict[str, Any] = field(default_factory=dict)
    units: tuple[tuple[int, str, str], ...] = ()


def scan_devices(
    talk: Dialogue, machine: HostMachine, table: DriverTable, *, extra_timeout: float = EXTRA_TIMEOUT
) -> tuple[HardwareScan, list[ProbedDevice]]:
    """Find and print the connected devices; return all of them, and those that could be identified on serial ports."""
    desk = scan_hardware(machine)
    probing = probing_drivers(table.iter_drivers())
    ports = [plug.port for plug in desk.ports if not plug.port.path.startswith("/dev/ttyS")]  # built-in ports of a PC
    found = [_device_at(talk, machine, table, port, probing, extra_timeout) for port in ports]
    if not ports:
        talk.print("no serial port: no adapter found (see mission ports)")
    for camera in desk.cameras:
        talk.print(f"{camera.path}  camera: {camera.name}")
    return desk, [each for each in found if each is not None]


def _device_at(
    talk: Dialogue,
    machine: HostMachine,
    table: DriverTable,
    port: SerialPortInfo,
    probing: Sequence[Driver],
    extra_timeout: float,
) -> ProbedDevice | None:
    """Return the device on a serial port; None if it is unknown.

    It is identified by its reply to a driver in ``probing``, or else by the user's answer.
    """

    def heard(*, consent: bool) -> PortScan:
        path = str(machine.local_path(port.path))
        found = probe_port(port, probing, SystemClock(), consent=consent, extra_timeout=extra_timeout, path=path)
        talk.print(*port_lines(ScannedPort(port, found)))
        if consent or found.device is not None:
            talk.save_answer(key, _probe_as_json(found))  # so that the port is opened only once
        return found

    key = f"heard {port.call}"
    if not talk.has_answer(key):
        reason = heard(consent=False).skip_reason
        question = f"probe {port.path} all the same? hands off, it may move"
        askable = reason is not None and port.shut is None and port.usb is not None
        if askable and talk.ask_yes_no(f"ask {port.call}", question, default=False):
            heard(consent=True)
    saved = talk.measure_once(key, list) if talk.has_answer(key) else []
    if not saved:
        return _ask_device(talk, table, port, probing)
    title, about, keys, units = saved
    kind, _, name = title.partition(".")
    return ProbedDevice(table.find(kind, name), port, about, keys, tuple((each[0], each[1], each[2]) for each in units))


def _probe_as_json(heard: PortScan) -> list[Any]:
    """Return the device that replied on a port, as JSON: title, description, keys and servos; empty without a reply."""
    if heard.device is None:
        return []
    answer = heard.device.result
    units = [[unit.id, unit.model, unit.trouble] for unit in answer.units]
    return [heard.device.title, answer.about, dict(answer.keys), units]


def _ask_device(
    talk: Dialogue, table: DriverTable, port: SerialPortInfo, probing: Sequence[Driver]
) -> ProbedDevice | None:
    """Ask the user which device is on a port that does not reply."""
    sure = driver_by_serial_number(port, probing)
    wired = (it for _, _, it in table.iter_drivers() if isinstance(it, Driver) and issubclass(it.keys, SerialKeys))
    names = list(dict.fromkeys(f"{driver.kind}.{driver.name}" for driver in (*probing, *wired)))
    default = NO_DEVICE if sure is None else f"{sure.kind}.{sure.name}"
    answer = talk.ask_choice(f"on {port.call}", f"which device is on {port.path}?", [NO_DEVICE, *names], default)
    kind, _, name = answer.partition(".")
    return None if answer == NO_DEVICE else ProbedDevice(table.find(kind, name), port)
