"""A board with a sketch of rosserial is recognised by the topics that it says it has."""

from collections.abc import Generator
from contextlib import suppress

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.arduino import wire
from drivers.transport import guardian_wire as lines
from drivers.transport.lines import LineFinder

BAUD_RATES = (57_600, 500_000, 115_200)
"""The rate of a Nano with the Rodney sketch, of a Teensy, and of other sketches."""

BOOT_TIME = 2.0
"""Seconds that a board needs to start, where the opening of its port has reset it."""


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Ask for its topics, at each of its rates; and again once it has started."""
    for boot in (False, True):
        if boot:
            yield ProbeRequest(BAUD_RATES[0], timeout=BOOT_TIME)
        heard = yield ProbeRequest(lines.BAUD, lines.REPORT_REQUEST, 0.25, _has_guardian_report)
        if _has_guardian_report(heard):
            return ProbeResult("a head with the sketch of MissionTree", {"protocol": "lines"})
        for baud in BAUD_RATES:
            heard = yield ProbeRequest(baud, wire.PROBE, 0.25, lambda heard: wire.SERVO_TOPIC in _topics(heard))
            if topics := _topics(heard):
                names = ", ".join(topic.name for topic in topics)
                lacks = (
                    ""
                    if wire.SERVO_TOPIC in topics
                    else f"it has no topic {wire.SERVO_TOPIC.name} as Rodney's sketch has it"
                )
                hint = "flash the Rodney sketch" if lacks else ""
                return ProbeResult(f"a board with rosserial: {names}", {"baud": baud}, trouble=lacks, hint=hint)
    return None


def _has_guardian_report(data: bytes) -> bool:
    """Whether somebody holds two servos there."""
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
