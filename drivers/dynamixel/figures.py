"""What an arm says of itself: whether it is there, what is wrong with it, and the figures of its wire."""

from collections.abc import Mapping
from dataclasses import replace

from drivers.api import Health, JointState, Quality, Reading
from drivers.dynamixel.adapter import timer_of
from drivers.dynamixel.bus import Bus
from drivers.dynamixel.joint import Joint
from drivers.dynamixel.pace import Pace
from drivers.dynamixel.telling import REMEDY
from drivers.dynamixel.watch import Watch
from drivers.errors import NotConnected

SLOW_ADAPTER = 0.004
"""Seconds for which an adapter may hold a reply back before it is worth a word."""


def health_of(name: str, bus: Bus, joints: Mapping[str, Joint], watch: Watch, *, runs: bool) -> Health:
    """Say whether the arm is there: the port open, its driver's thread runs, and at least one servo answers."""
    try:
        bus.require()
    except NotConnected as error:
        return Health(False, str(error), error.hint)
    wrong = [] if watch.connected else ["looking for the servos"]
    wrong += [f"{j.title} {j.complaint}" for j in joints.values() if not j.driven]
    hint = watch.hint if wrong else ""
    if shut := [f"{j.title} has shut down" for j in joints.values() if j.driven and j.shut]:
        wrong, hint = wrong + shut, hint or REMEDY
    if not wrong and bus.latency > SLOW_ADAPTER:
        wrong = [f"the adapter holds every reply back for {bus.latency * 1000:.0f} ms"]
        hint = f"echo 1 | sudo tee {timer_of(bus.port)}"
    return Health(watch.online and runs, f"{name}: {'; '.join(wrong)}" if wrong else "", hint)


def counted(bus: Bus, joints: Mapping[str, Joint], pace: Pace, *, connections: int) -> dict[str, int]:
    """Return the figures of the wire and of each servo."""
    counters = {"connections": connections, "rounds": pace.rounds, **bus.exchanges.counters("exchange")}
    counters |= {"achieved rate (Hz)": round(pace.achieved), "utilisation (%)": round(100 * pace.share)}
    tallies = {name: bus.tally(joint.spec.id) for name, joint in joints.items()}
    for figure in ("tries", "misses", "corrupt", "late", "refused"):
        counters[figure] = sum(getattr(tally, figure) for tally in tallies.values())
    return counters | {f"misses of {name}": tally.misses for name, tally in tallies.items()}


def readings(joints: Mapping[str, Joint], *, since: float) -> Mapping[str, Reading[JointState]]:
    """Return the newest reading of each joint; those are stale that were taken before ``since``."""
    newest = {name: joint.reading for name, joint in joints.items()}
    return {
        name: replace(reading, quality=Quality.STALE) if reading.good and reading.stamp < since else reading
        for name, reading in newest.items()
    }
