"""What is plugged in, asked for a new robot: what answered is kept, so that no port is opened twice."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from drivers.api.driver import Driver
from drivers.api.sections import Wired
from drivers.clock import SystemClock
from drivers.finding.asking import PATIENCE, Heard, certain, drivers_that_probe, look
from drivers.finding.machine import Machine
from drivers.finding.serial_ports import SerialPort
from drivers.finding.survey import Desk, Plug, survey
from missions.library.drivers import Table
from missions.plugins.setup.ports import port_lines
from missions.plugins.setup.robot.dialogue import Dialogue

NOTHING = "nothing"


@dataclass(frozen=True, slots=True)
class Found:
    """A device that answered on a port, or that the user says is there: its driver, and what it said.

    ``units`` are the servos on it: ID, model, and what is wrong with each.
    """

    driver: Driver
    port: SerialPort
    about: str = ""
    keys: dict[str, Any] = field(default_factory=dict)
    units: tuple[tuple[int, str, str], ...] = ()


def plugged_in(
    talk: Dialogue, machine: Machine, table: Table, *, patience: float = PATIENCE
) -> tuple[Desk, list[Found]]:
    """Say what is plugged in, and return it with the devices that are known by now."""
    desk = survey(machine)
    probing = drivers_that_probe(table.all())
    ports = [plug.port for plug in desk.plugs if not plug.port.path.startswith("/dev/ttyS")]  # a PC's own
    found = [_at(talk, machine, table, port, probing, patience) for port in ports]
    if not ports:
        talk.tell("no serial port: no adapter is plugged in (mission ports says more)")
    for camera in desk.cameras:
        talk.tell(f"{camera.path}  camera: {camera.name}")
    return desk, [each for each in found if each is not None]


def _at(
    talk: Dialogue, machine: Machine, table: Table, port: SerialPort, probing: Sequence[Driver], patience: float
) -> Found | None:
    """Return what is on a port: what it says of itself, else what the user says."""

    def heard(*, consent: bool) -> Heard:
        path = str(machine.at(port.path))
        found = look(port, probing, SystemClock(), consent=consent, patience=patience, path=path)
        talk.tell(*port_lines(Plug(port, found)))
        if consent or found.found is not None:
            talk.keep(key, _kept(found))  # so that it is opened once
        return found

    key = f"heard {port.call}"
    if not talk.knows(key):
        reason = heard(consent=False).unasked
        question = f"ask {port.path} all the same? hands off, it may move"
        askable = reason is not None and port.shut is None and port.usb is not None
        if askable and talk.confirm(f"ask {port.call}", question, default=False):
            heard(consent=True)
    kept = talk.measured(key, list) if talk.knows(key) else []
    if not kept:
        return _told(talk, table, port, probing)
    title, about, keys, units = kept
    kind, _, name = title.partition(".")
    return Found(table.find(kind, name), port, about, keys, tuple((each[0], each[1], each[2]) for each in units))


def _kept(heard: Heard) -> list[Any]:
    """Return what answered as JSON has it; empty for nobody."""
    if heard.found is None:
        return []
    answer = heard.found.answer
    units = [[unit.id, unit.model, unit.trouble] for unit in answer.units]
    return [heard.found.title, answer.about, dict(answer.keys), units]


def _told(talk: Dialogue, table: Table, port: SerialPort, probing: Sequence[Driver]) -> Found | None:
    """Return what the user says is on a port that does not answer."""
    sure = certain(port, probing)
    wired = (it for _, _, it in table.all() if isinstance(it, Driver) and issubclass(it.keys, Wired))
    names = list(dict.fromkeys(f"{driver.kind}.{driver.name}" for driver in (*probing, *wired)))
    default = NOTHING if sure is None else f"{sure.kind}.{sure.name}"
    said = talk.choice(f"on {port.call}", f"what of the robot is on {port.path}?", [NOTHING, *names], default)
    kind, _, name = said.partition(".")
    return None if said == NOTHING else Found(table.find(kind, name), port)
