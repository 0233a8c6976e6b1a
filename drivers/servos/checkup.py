"""How the servos of an arm are, at rest: who answers, as what, with how much voltage and heat. Only reads."""

from collections.abc import Iterator

from drivers.api.driver import Finding, Site, warning, wrong
from drivers.errors import BadRequest, NoReply
from drivers.servos.bus import Bus
from drivers.servos.declared import DynamixelKeys
from drivers.servos.joining import absence, difference
from drivers.servos.joint import OVERFED, Joint
from drivers.servos.make import REPLY_TIMEOUT, VIRTUAL_REPLY_TIMEOUT, joints
from drivers.servos.models import MODELS, model_of

LOW = 0.83
"""The share of its nominal voltage below which a servo is short of power: 10 V of 12 V."""

NEARLY = 10
"""Degrees below its limit from which on a servo is hot."""


def checkup(keys: DynamixelKeys, site: Site) -> Iterator[Finding]:
    """Look at each servo of the robot file."""
    patience = VIRTUAL_REPLY_TIMEOUT if site.virtual else REPLY_TIMEOUT
    bus = Bus(site.port, site.clock, baud=keys.baud, name=site.part, patience=patience, framing=keys.framing)
    try:
        bus.open()
        for name, spec in joints(keys).items():
            joint = Joint(name, spec, MODELS[spec.model])
            try:
                yield from _servo(bus, joint)
            except NoReply:
                told = absence(bus, joint, 0)
                cure = joint.cure or "switch its power on, look at its cable; mission servo scan --robot ROBOT"
                yield wrong(joint.title, told, _for_robot(cure))
            except BadRequest as error:
                yield wrong(joint.title, str(error), f"mission servo info {spec.id} --robot ROBOT")
    finally:
        bus.close()


def _servo(bus: Bus, joint: Joint) -> Iterator[Finding]:
    """Look at one servo. Raises NoReply, NotConnected, BadRequest."""
    number, title = joint.spec.id, joint.title
    known = bus.identify(joint.at)
    model = model_of(known.number)
    if model is not joint.model:
        told = f"it is model {model.name}" if model else f"its model number, {known.number}, is unknown"
        cure = model.advice if model else f"mission servo scan --ids {number} --robot ROBOT"
        yield wrong(title, f"{told}, the robot file says {joint.model.name}", cure)
        return
    if unlike := difference(bus, joint):
        info = f"mission servo info {number} --robot ROBOT  (then: mission servo set --help)"
        yield wrong(title, unlike, _for_robot(joint.cure) or info)
    table = joint.model.table
    volts, heat = bus.read(joint.at, table["present_voltage"]) / 10, bus.read(joint.at, table["present_temperature"])
    joint.told = bus.faults(number)
    firmware = f"{known.firmware & 0xFF}.{known.firmware >> 8}" if joint.at.protocol == "STS" else known.firmware
    figures = f"{joint.model.name}, firmware {firmware}, {volts:.1f} V, {heat} degC"
    troubles = [*_power(joint, volts), *_heat(joint, heat), *_errors(joint)]
    if bus.tally(number).corrupt:
        cure = f"plug it in alone: mission servo scan --ids {number} --robot ROBOT"
        troubles.append(warning(title, "some replies are damaged: are there two with this ID, or a bad cable?", cure))
    yield from troubles
    if not troubles and not unlike:
        yield Finding(title, figures)


def _for_robot(cure: str) -> str:
    """Return a cure in which the robot of the check-up is to be named."""
    return cure.replace("--robot FILE", "--robot ROBOT")


def _power(joint: Joint, volts: float) -> Iterator[Finding]:
    lowest, highest, usual = joint.value("lowest_voltage") / 10, joint.value("highest_voltage") / 10, joint.volts
    supply = f"charge the battery, or take a supply of {usual:g} V that gives enough current"
    if volts < lowest:
        yield wrong(joint.title, f"{volts:.1f} V: below {lowest:.1f} V it shuts down", supply)
    elif volts < LOW * usual:
        yield warning(joint.title, f"{volts:.1f} V is little for a servo of {usual:g} V", supply)
    elif highest < volts <= OVERFED * highest:  # beyond that it is not driven: see ``difference``
        yield wrong(joint.title, f"{volts:.1f} V: above {highest:.1f} V it suffers", f"take a supply of {usual:g} V")


def _heat(joint: Joint, heat: int) -> Iterator[Finding]:
    limit = joint.value("temperature_limit")
    cure = f"mission servo torque off {joint.name} --robot ROBOT  (hold the arm: it falls), and let it cool"
    if heat >= limit:
        yield wrong(joint.title, f"{heat} degC: at {limit} degC it shuts down", cure)
    elif heat >= limit - NEARLY:
        yield warning(joint.title, f"{heat} degC: at {limit} degC it shuts down", cure)


def _errors(joint: Joint) -> Iterator[Finding]:
    reboot = f"mission servo torque restart {joint.spec.id} --robot ROBOT"
    cure = "remove the cause, then: " + (
        reboot if joint.at.protocol == 2 else "mission servo torque recover --robot ROBOT"
    )
    if joint.down:
        words = joint.ailing.words
        yield wrong(joint.title, "it has shut down" + (f": {words}" if words else ", and is limp"), cure)
    elif joint.ailing:
        yield wrong(joint.title, f"it complains: {joint.ailing.words}", cure)
