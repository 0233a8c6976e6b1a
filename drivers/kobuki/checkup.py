"""Check-up of a Kobuki at rest: battery, firmware, contacts, gyro and rate of reports."""

from collections.abc import Iterator
from math import radians

from drivers.api.driver import DriverContext, Finding, failure, warning
from drivers.api.probe import ProbeRequest
from drivers.base.gyro_drift import drift
from drivers.finding.port_probe import ExclusivePort
from drivers.kobuki.commands import Extra, RequestExtra
from drivers.kobuki.declared import KobukiKeys
from drivers.kobuki.feedback import FEEDBACK, Core, FirmwareVersion, Inertia
from drivers.kobuki.odometry import EMPTY_VOLTAGE, LOW_VOLTAGE
from drivers.kobuki.wire import KobukiFrameFinder, KobukiSubpayload, decode, encode

LISTEN_TIME = 1.5
"""Seconds of reading: 75 reports, enough to measure the drift of the gyro to 0.01 deg/s."""

MIN_REPORT_SHARE = 0.9
"""Smallest share of the 50 reports per second that must arrive."""

VIRTUAL_EXTRA_TIMEOUT = 0.05
"""Seconds added to the timeout of each request if the base is virtual, since it may reply late."""


def checkup(keys: KobukiKeys, context: DriverContext) -> Iterator[Finding]:
    """Request the firmware version, read reports of the base at rest, and yield the findings."""
    port = ExclusivePort(
        context.port, context.clock, extra_timeout=VIRTUAL_EXTRA_TIMEOUT if context.is_virtual else 0.0
    )
    try:
        heard = port.exchange(ProbeRequest(keys.baud, encode(RequestExtra(Extra.FIRMWARE)), LISTEN_TIME))
    finally:
        port.close()
    yield from check_reports(
        [part for payload in KobukiFrameFinder().feed(heard) for part in decode(payload, FEEDBACK).parts]
    )


def check_reports(parts: list[KobukiSubpayload]) -> Iterator[Finding]:
    """Yield the findings from the reports of ``LISTEN_TIME`` seconds."""
    reports = [part for part in parts if isinstance(part, Core)]
    if not reports:
        yield failure("reports", "it is silent", "switch it on; check its battery, and the USB cable")
        return
    version = next((part for part in parts if isinstance(part, FirmwareVersion)), None)
    yield Finding("firmware", "unknown" if version is None else str(version))
    last = reports[-1]
    span = (last.time_ms - reports[0].time_ms) % 0x10000 / 1000
    rate = (len(reports) - 1) / span if span else 0.0
    if rate < 50 * MIN_REPORT_SHARE:
        yield warning("reports", f"{rate:.0f} of 50 a second arrive", "another cable, and a USB socket without a hub")
    else:
        yield Finding("reports", f"{rate:.0f} a second")
    yield from _gyro(parts, reports, span)
    charge = "put it on its dock, or plug its charger in"
    if last.voltage < EMPTY_VOLTAGE and not last.charging:
        yield failure("battery", f"{last.voltage:.1f} V: it is empty", charge)
    elif last.voltage < LOW_VOLTAGE and not last.charging:
        yield warning("battery", f"{last.voltage:.1f} V: it is low", charge)
    else:
        yield Finding("battery", f"{last.voltage:.1f} V" + (", charging" if last.charging else ""))
    for felt, what, cure in (
        (last.wheel_drop, "a wheel hangs in the air: it does not drive", "put it on the floor"),
        (
            last.cliff,
            "an edge, or a dark or shiny floor: it does not drive ahead",
            "put it elsewhere; wipe its sensors",
        ),
        (last.bumper, "its bumper is pressed", "make room; look whether the bumper sticks"),
        (last.overcurrent, "a motor takes too much current", "check for objects that block the wheel"),
    ):
        if felt:
            yield warning("senses", what, cure)


def _gyro(parts: list[KobukiSubpayload], reports: list[Core], span: float) -> Iterator[Finding]:
    """Yield the finding on the drift of the gyro, unless the wheels turned."""
    turns = [part for part in parts if isinstance(part, Inertia)]
    stood = all(
        (each.left_encoder, each.right_encoder) == (reports[0].left_encoder, reports[0].right_encoder)
        for each in reports
    )
    if not stood:
        yield warning("gyro drift", "not measured: its wheels turned meanwhile", "keep it at rest, and try again")
    elif len(turns) > 1 and span:
        turned = (turns[-1].heading_cdeg - turns[0].heading_cdeg + 18000) % 36000 - 18000
        yield drift(radians(turned / 100), span)
