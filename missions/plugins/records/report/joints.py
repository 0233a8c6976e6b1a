"""Statistics of joints in a record: error, work of the motor, load and temperature.

A sample of a joint is used if its torque is on, it has a goal, and its servo replies. The error is the angle from the
goal to the position, also while the joint moves. For an additional arm, such as ``right_arm``, the name of a joint
begins with the name of the arm.
"""

import re
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from math import degrees, fsum, sqrt
from typing import Any, NamedTuple

from config.diagnostics import InvalidFileError, SourceText
from drivers.errors import DriverError
from drivers.servos.declared import DynamixelKeys
from missions.library.drivers import parse_robot
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.recording.validation import MAX_SECONDS
from missions.plugins.records.report.traces import MAX_GAP, Chart, ChartLine
from missions.trees.drawing_builder import one_line
from missions.trees.value_text import seconds_text

JOINT_TOPIC = "/state/arm"

PHYSICS_OPTION = "--physics"
"""Option that simulates the load of servos; without it, the loads in a simulated run have no meaning."""

MAX_JOINTS = 100
"""Maximum number of joints read from a record: more than any robot has, but a damaged file may claim more."""

MAX_CHARTS = 24
"""Maximum number of joint charts in a report; if there are more joints, those that moved most get one."""

MAX_NAME_LENGTH = 40
"""Maximum number of characters of a joint name in a report."""

MIN_CHART_TRAVEL = 0.5
"""Minimum travel in degrees from which on a joint gets a chart."""


class JointLogSample(NamedTuple):
    """State of a joint at time ``t`` (s): angles in rad, ``velocity`` in rad/s, ``temperature`` in degC.

    ``load`` is -1..1 of the stall torque. ``goal`` is None without a goal or with torque off.
    """

    t: float
    position: float
    velocity: float
    goal: float | None
    load: float
    temperature: float


@dataclass(frozen=True, slots=True)
class JointFigures:
    """Statistics of one joint over a run; angles in degrees, None for unknown values.

    ``rms`` is the root mean square of the joint's error (position minus goal), ``worst`` the largest error, at
    ``worst_at`` (s). ``energy`` is the work of its motor (J), ``load`` the largest load in -1..1 of the stall torque,
    ``hottest`` the highest temperature in degC.
    """

    name: str
    samples: int
    rms: float | None = None
    worst: float | None = None
    worst_at: float | None = None
    energy: float | None = None
    load: float | None = None
    hottest: float | None = None


def joint_samples(record: RunRecord) -> Mapping[str, Sequence[JointLogSample]]:
    """Return the samples of each joint in order of time; empty without joints. Raises InvalidRecordError."""
    found: dict[str, list[JointLogSample]] = {}
    for batch in record.read(lambda _, data: list(_samples(data)), JOINT_TOPIC):
        for name, sample in batch:
            if name in found or len(found) < MAX_JOINTS:
                found.setdefault(name, []).append(sample)
    begin = record.cut_start or 0.0
    whole = {name: sorted(track, key=lambda sample: sample.t) for name, track in found.items()}
    return {
        name: track[bisect_left(track, begin, key=lambda sample: sample.t) :] for name, track in whole.items() if track
    }


def joint_figures(record: RunRecord, tracks: Mapping[str, Sequence[JointLogSample]]) -> list[JointFigures]:
    """Return the statistics of each joint."""
    felt = not record.header.simulate or PHYSICS_OPTION in record.header.command
    torques = _stall_torques(record) if tracks and felt else {}
    return [
        _figures_of_joint(name, track, torques.get(name), has_loads=felt) for name, track in tracks.items() if track
    ]


def joint_charts(tracks: Mapping[str, Sequence[JointLogSample]]) -> list[Chart]:
    """Return a chart of goal and position of each joint that moved."""
    moved = {name: _travel(track) for name, track in tracks.items() if track}
    drawn = sorted(moved, key=lambda name: -moved[name])[:MAX_CHARTS]
    return [
        Chart(
            _file_stem(name, number),
            short_name(name),
            "°",
            [
                ChartLine(
                    "goal", [(each.t, degrees(each.goal)) for each in track if each.goal is not None], requested=True
                ),
                ChartLine("measured", [(each.t, degrees(each.position)) for each in track]),
            ],
        )
        for number, (name, track) in enumerate(tracks.items(), 1)
        if name in drawn and moved[name] > MIN_CHART_TRAVEL
    ]


def combined_rms(joints: Sequence[JointFigures]) -> float | None:
    """Return the root mean square of all joint errors, in degrees; None if unknown."""
    known = [(each.rms, each.samples) for each in joints if each.rms is not None]
    count = sum(samples for _, samples in known)
    return sqrt(fsum(rms**2 * samples for rms, samples in known) / count) if count else None


def worst_joint(joints: Sequence[JointFigures]) -> JointFigures | None:
    """Return the joint with the largest error; None if no error is known."""
    known = [each for each in joints if each.worst is not None]
    return max(known, key=lambda each: abs(each.worst or 0.0), default=None)


def total_energy(joints: Sequence[JointFigures]) -> float | None:
    """Return the work of all motors, in joules; None if no load is known."""
    known = [each.energy for each in joints if each.energy is not None]
    return fsum(known) if known else None


def joint_sentences(joints: Sequence[JointFigures]) -> Iterator[str]:
    """Yield sentences about all joints together, for the summary of the run."""
    rms, worst, energy = combined_rms(joints), worst_joint(joints), total_energy(joints)
    if rms is not None and worst is not None:
        yield (
            f"Joint error: {rms:.2f}° root mean square, "
            f"{abs(worst.worst or 0.0):.1f}° at most ({worst.name}, at {seconds_text(worst.worst_at or 0.0)})."
        )
    if energy is not None:
        yield f"Work of the motors: {energy:.0f} J."


def short_name(name: str) -> str:
    """Return a joint name on one line, shortened to ``MAX_NAME_LENGTH``."""
    text = one_line(name)
    return text if len(text) <= MAX_NAME_LENGTH else f"{text[: MAX_NAME_LENGTH - 1]}…"


def _samples(data: Any) -> Iterator[tuple[str, JointLogSample]]:
    """Yield joint name and sample of each valid joint state in a message; implausible numbers are left out."""
    for name, state in islice(data["joints"].items(), MAX_JOINTS):
        if state["quality"] != "good":
            continue
        position, velocity, load, temperature = (
            float(state[word]) for word in ("position", "velocity", "load", "temperature")
        )
        goal = float(state["goal"]) if state["torque"] and state["goal"] is not None else None
        if all(abs(value) < MAX_SECONDS for value in (position, velocity, load, temperature, goal or 0.0)):
            yield name, JointLogSample(data["t"], position, velocity, goal, load, temperature)


def _figures_of_joint(
    name: str, track: Sequence[JointLogSample], torque: float | None, *, has_loads: bool
) -> JointFigures:
    off = [(degrees(each.position - each.goal), each.t) for each in track if each.goal is not None]
    worst, at = max(off, key=lambda pair: abs(pair[0])) if off else (None, None)
    loads = [each.load for each in track if each.load and has_loads]
    warm = [each.temperature for each in track if each.temperature > 0]
    return JointFigures(
        short_name(name),
        len(off),
        rms=sqrt(fsum(error**2 for error, _ in off) / len(off)) if off else None,
        worst=worst,
        worst_at=at,
        energy=_energy(track, torque) if loads and torque is not None else None,
        load=max(loads, key=abs) if loads else None,
        hottest=max(warm) if warm else None,
    )


def _energy(track: Sequence[JointLogSample], torque: float) -> float:
    """Return the work of a motor in joules: torque times speed, while it drives the joint."""
    power = [max(torque * each.load * each.velocity, 0.0) for each in track]
    times = [each.t for each in track]
    return fsum(
        (one + other) / 2 * (end - begin)
        for (begin, end), (one, other) in zip(pairwise(times), pairwise(power), strict=True)
        if end - begin <= MAX_GAP
    )


def _stall_torques(record: RunRecord) -> Mapping[str, float]:
    """Return the stall torques (Nm) of the servos by joint, from the robot file in the record."""
    for name, data in record.files.items():
        if name.startswith("robot/"):
            try:
                sections = parse_robot(SourceText(name, data.decode("utf-8-sig"))).sections.values()
                return {
                    f"{section.name}.{joint}".lstrip("."): servo.servo_model.stall_torque
                    for section in sections
                    if isinstance(section.keys, DynamixelKeys)
                    for joint, servo in section.keys.servos.items()
                }
            except (InvalidFileError, UnicodeDecodeError, DriverError):
                continue
    return {}


def _file_stem(name: str, number: int) -> str:
    """Return a file name stem for the chart of a joint, without unsafe characters, which a recorded name may have."""
    return f"joint_{name}" if re.fullmatch(r"[a-z0-9_.]{1,40}", name) else f"joint_number_{number}"


def _travel(track: Sequence[JointLogSample]) -> float:
    """Return the range of positions and goals of a joint, in degrees."""
    angles = [angle for each in track for angle in (each.position, each.goal) if angle is not None]
    return degrees(max(angles) - min(angles))
