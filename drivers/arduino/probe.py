"""A board with a sketch of rosserial is recognised by the topics that it says it has."""

from collections.abc import Generator
from contextlib import suppress

from drivers.api.probing import Answer, Ask
from drivers.arduino import wire
from drivers.transport import guardian_wire as lines
from drivers.transport.lines import LineFinder

RATES = (57_600, 500_000, 115_200)
"""The rate of a Nano with the Rodney sketch, of a Teensy, and of other sketches."""

BOOT = 2.0
"""Seconds that a board needs to start, where the opening of its port has reset it."""


def probe() -> Generator[Ask, bytes, Answer | None]:
    """Ask for its topics, at each of its rates; and again once it has started."""
    for boot in (False, True):
        if boot:
            yield Ask(RATES[0], wait=BOOT)
        heard = yield Ask(lines.BAUD, lines.ASK, 0.25, _answers)
        if _answers(heard):
            return Answer("a head with the sketch of MissionTree", {"protocol": "lines"})
        for baud in RATES:
            heard = yield Ask(baud, wire.PROBE, 0.25, lambda heard: wire.SERVO in _topics(heard))
            if topics := _topics(heard):
                names = ", ".join(topic.name for topic in topics)
                lacks = "" if wire.SERVO in topics else f"it has no topic {wire.SERVO.name} as Rodney's sketch has it"
                hint = "flash the Rodney sketch" if lacks else ""
                return Answer(f"a board with rosserial: {names}", {"baud": baud}, trouble=lacks, hint=hint)
    return None


def _answers(heard: bytes) -> bool:
    """Whether somebody holds two servos there."""
    for line in LineFinder(lines.LONGEST).feed(heard):
        with suppress(ValueError):
            if isinstance(lines.read(line), lines.Report):
                return True
    return False


def _topics(heard: bytes) -> list[wire.Topic]:
    found = []
    for frame in wire.FrameFinder().feed(heard):
        if frame.topic in {wire.PUBLISHER, wire.SUBSCRIBER}:
            with suppress(ValueError):
                found.append(wire.TopicInfo.unpack(frame.data).topic)
    return found
