"""Probe of a board with rosserial, recognised by its topics, or with MissionTree's own sketch."""

from collections.abc import Generator
from contextlib import suppress

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.arduino import wire
from drivers.transport import guardian_wire as lines
from drivers.transport.lines import LineFinder

BAUD_RATES = (57_600, 500_000, 115_200)
"""Baud rates to probe: of a Nano with the Rodney sketch, of a Teensy, and of other sketches."""

BOOT_TIME = 2.0
"""Seconds for the boot of a board that was reset as its port was opened."""


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Request a report and the topics of the board, at each baud rate; and once more after the boot time."""
    for boot in (False, True):
        if boot:
            yield ProbeRequest(BAUD_RATES[0], timeout=BOOT_TIME)
        data = yield ProbeRequest(lines.BAUD, lines.REPORT_REQUEST, 0.25, _has_guardian_report)
        if _has_guardian_report(data):
            return ProbeResult("a head with the sketch of MissionTree", {"protocol": "lines"})
        for baud in BAUD_RATES:
            data = yield ProbeRequest(baud, wire.PROBE, 0.25, lambda data: wire.SERVO_TOPIC in _topics(data))
            if topics := _topics(data):
                names = ", ".join(topic.name for topic in topics)
                problem = (
                    ""
                    if wire.SERVO_TOPIC in topics
                    else f"it has no topic {wire.SERVO_TOPIC.name} as Rodney's sketch has it"
                )
                hint = "flash the Rodney sketch" if problem else ""
                return ProbeResult(f"a board with rosserial: {names}", {"baud": baud}, trouble=problem, hint=hint)
    return None


def _has_guardian_report(data: bytes) -> bool:
    """Return whether received bytes contain a report of MissionTree's own sketch."""
    for line in LineFinder(lines.MAX_LINE_LENGTH).feed(data):
        with suppress(ValueError):
            if isinstance(lines.parse_line(line), lines.GuardianReport):
                return True
    return False


def _topics(data: bytes) -> list[wire.RosserialTopic]:
    found = []
    for frame in wire.RosserialFrameFinder().feed(data):
        if frame.topic in {wire.PUBLISHER, wire.SUBSCRIBER}:
            with suppress(ValueError):
                found.append(wire.TopicInfo.unpack(frame.data).topic)
    return found
