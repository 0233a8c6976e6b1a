"""Check-up of an arm at rest: identity, settings, voltage, temperature and faults of each servo. Only reads."""

from collections.abc import Iterator

from drivers.api.driver import DriverContext, Finding, failure, warning
from drivers.errors import BadRequest, NoReply
from drivers.servos.bus import ServoBus
from drivers.servos.declared import DynamixelKeys
from drivers.servos.joint import OVERVOLTAGE_FACTOR, Joint
from drivers.servos.joint_setup import diagnose_no_reply, find_mismatch
from drivers.servos.make import REPLY_TIMEOUT, VIRTUAL_REPLY_TIMEOUT, joint_specs
from drivers.servos.models import MODELS, find_model

LOW_VOLTAGE_SHARE = 0.83
"""Share of the nominal voltage below which a warning is due: 10 V of 12 V."""

HOT_MARGIN = 10
"""Margin in degrees Celsius below a servo's temperature limit within which the servo counts as hot."""


def checkup(keys: DynamixelKeys, site: DriverContext) -> Iterator[Finding]:
    """Yield the findings on each servo of an arm.

    ``keys`` is the section of the arm in the robot file; ``site`` has the port and the clock.
    """
    patience = VIRTUAL_REPLY_TIMEOUT if site.is_virtual else REPLY_TIMEOUT
    bus = ServoBus(site.port, site.clock, baud=keys.baud, name=site.part, reply_timeout=patience, framing=keys.framing)
    try:
        bus.open()
        for name, spec in joint_specs(keys).items():
            joint = Joint(name, spec, MODELS[spec.model])
            try:
                yield from _check_servo(bus, joint)
            except NoReply:
                told = diagnose_no_reply(bus, joint, 0)
                cure = joint.hint or "switch its power on, look at its cable; mission servo scan --robot ROBOT"
                yield failure(joint.title, told, _for_robot(cure))
            except BadRequest as error:
                yield failure(joint.title, str(error), f"mission servo info {spec.id} --robot ROBOT")
    finally:
        bus.close()


def _check_servo(bus: ServoBus, joint: Joint) -> Iterator[Finding]:
    """Yield the findings on one servo. Raises NoReply, NotConnected, BadRequest."""
    number, title = joint.spec.id, joint.title
    known = bus.identify(joint.address)
    model = find_model(known.number)
    if model is not joint.model:
        told = f"it is model {model.name}" if model else f"its model number, {known.number}, is unknown"
        cure = model.robot_file_hint if model else f"mission servo scan --ids {number} --robot ROBOT"
        yield failure(title, f"{told}, the robot file says {joint.model.name}", cure)
        return
    if unlike := find_mismatch(bus, joint):
        info = f"mission servo info {number} --robot ROBOT  (then: mission servo set --help)"
        yield failure(title, unlike, _for_robot(joint.hint) or info)
    table = joint.model.table
    volts, heat = (
        bus.read(joint.address, table["present_voltage"]) / 10,
        bus.read(joint.address, table["present_temperature"]),
    )
    joint.reply_faults = bus.faults(number)
    firmware = f"{known.firmware & 0xFF}.{known.firmware >> 8}" if joint.address.protocol == "STS" else known.firmware
    figures = f"{joint.model.name}, firmware {firmware}, {volts:.1f} V, {heat} degC"
    troubles = [*_check_voltage(joint, volts), *_check_temperature(joint, heat), *_check_faults(joint)]
    if bus.statistics(number).corrupt:
        cure = f"plug it in alone: mission servo scan --ids {number} --robot ROBOT"
        troubles.append(warning(title, "some replies are damaged: are there two with this ID, or a bad cable?", cure))
    yield from troubles
    if not troubles and not unlike:
        yield Finding(title, figures)


def _for_robot(cure: str) -> str:
    """Return the hint ``cure`` with ``--robot ROBOT`` in place of ``--robot FILE``.

    ``ROBOT`` is the placeholder that a ``Finding`` has for the robot.
    """
    return cure.replace("--robot FILE", "--robot ROBOT")


def _check_voltage(joint: Joint, volts: float) -> Iterator[Finding]:
    lowest, highest, usual = (
        joint.value("lowest_voltage") / 10,
        joint.value("highest_voltage") / 10,
        joint.nominal_voltage,
    )
    supply = f"charge the battery, or take a supply of {usual:g} V with enough current"
    if volts < lowest:
        yield failure(joint.title, f"{volts:.1f} V: below {lowest:.1f} V it shuts down", supply)
    elif volts < LOW_VOLTAGE_SHARE * usual:
        yield warning(joint.title, f"{volts:.1f} V is low for a servo made for {usual:g} V", supply)
    elif highest < volts <= OVERVOLTAGE_FACTOR * highest:  # a mismatch beyond that keeps it undriven
        yield failure(
            joint.title, f"{volts:.1f} V: above {highest:.1f} V it may be damaged", f"take a supply of {usual:g} V"
        )


def _check_temperature(joint: Joint, heat: int) -> Iterator[Finding]:
    limit = joint.value("temperature_limit")
    cure = f"mission servo torque off {joint.name} --robot ROBOT  (hold the arm: it falls), and let it cool"
    if heat >= limit:
        yield failure(joint.title, f"{heat} degC: at {limit} degC it shuts down", cure)
    elif heat >= limit - HOT_MARGIN:
        yield warning(joint.title, f"{heat} degC: at {limit} degC it shuts down", cure)


def _check_faults(joint: Joint) -> Iterator[Finding]:
    reboot = f"mission servo torque restart {joint.spec.id} --robot ROBOT"
    cure = "remove the cause, then: " + (
        reboot if joint.address.protocol == 2 else "mission servo torque recover --robot ROBOT"
    )
    if joint.reports_shutdown:
        words = joint.active_faults.description
        yield failure(joint.title, "it has shut down" + (f": {words}" if words else ", and is limp"), cure)
    elif joint.active_faults:
        yield failure(joint.title, f"it reports {joint.active_faults.description}", cure)
