"""Verdict on a base from a small trial: motors, encoders and gyro against what a person saw. Pure arithmetic."""

from collections.abc import Iterator
from enum import Enum
from math import copysign, degrees

from drivers.api.driver import Finding, warning, wrong
from drivers.base.gyro_drift import drift
from missions.plugins.setup.doctor.base_trial import TRACK, TURN, WAY, BaseTrial, InstrumentReadings

COUNTED = 0.2
"""Share of the commanded way from which on a wheel counts as turned."""

TURNED = 0.25
"""Share of the commanded turn from which on a gyro counts as turned."""

AGREEMENT = 1.7
"""Factor by which gyro and encoders may differ: wheels slip, tracks are estimates."""


class SeenMotion(Enum):
    """Motion that a person saw."""

    LEFT = "left"
    RIGHT = "right"
    AHEAD = "ahead"
    BACK = "back"
    NONE = "none"


Signs = tuple[int, int]
"""Directions in which the left and the right wheel turned: 1, -1, or 0."""

_WHEELS: dict[SeenMotion, Signs] = {
    SeenMotion.LEFT: (-1, 1),
    SeenMotion.RIGHT: (1, -1),
    SeenMotion.AHEAD: (1, 1),
    SeenMotion.BACK: (-1, -1),
    SeenMotion.NONE: (0, 0),
}

_SWAP = "swap the plugs of the left and the right motor"
_MOTORS: dict[tuple[SeenMotion, SeenMotion], tuple[str, str]] = {
    (SeenMotion.RIGHT, SeenMotion.AHEAD): ("the left and the right motor are swapped", _SWAP),
    (SeenMotion.RIGHT, SeenMotion.BACK): ("both motors turn the wrong way", "swap the two wires of each motor"),
    (SeenMotion.LEFT, SeenMotion.BACK): (
        "the left and the right motor are swapped, and both turn the wrong way",
        f"{_SWAP}, and the two wires of each",
    ),
    (SeenMotion.AHEAD, SeenMotion.LEFT): ("the left motor turns the wrong way", "swap the two wires of the left motor"),
    (SeenMotion.BACK, SeenMotion.RIGHT): (
        "the right motor turns the wrong way",
        "swap the two wires of the right motor",
    ),
    (SeenMotion.BACK, SeenMotion.LEFT): (
        "the left and the right motor are swapped, and the one on the left turns the wrong way",
        f"{_SWAP}, then try again",
    ),
    (SeenMotion.AHEAD, SeenMotion.RIGHT): (
        "the left and the right motor are swapped, and the one on the right turns the wrong way",
        f"{_SWAP}, then try again",
    ),
    (SeenMotion.LEFT, SeenMotion.LEFT): (
        "the left wheel does not turn",
        "look at the left motor, its plug and its fuse",
    ),
    (SeenMotion.LEFT, SeenMotion.RIGHT): (
        "the right wheel does not turn",
        "look at the right motor, its plug and its fuse",
    ),
}
"""Fault and cure by what was seen of the turn to the left, and of the way ahead."""

_ONE_WHEEL: dict[tuple[SeenMotion, SeenMotion], tuple[Signs, Signs]] = {
    (SeenMotion.LEFT, SeenMotion.LEFT): ((0, 1), (0, 1)),
    (SeenMotion.LEFT, SeenMotion.RIGHT): ((-1, 0), (1, 0)),
}
"""True directions of the wheels where only one turns."""


def judge(trial: BaseTrial, turn: SeenMotion, ahead: SeenMotion) -> Iterator[Finding]:
    """Yield the findings, given the motion that a person saw of the turn to the left and of the way ahead."""
    if trial.rest.gyro is not None:
        yield drift(trial.rest.gyro, trial.rest.seconds)
    yield from _motors(trial, turn, ahead)
    if not trial.measured:
        yield Finding("odometry", "nothing measures how it moves: its pose is dead reckoning")
        return
    truth = _ONE_WHEEL.get((turn, ahead), (_WHEELS[turn], _WHEELS[ahead]))
    counted = _signs(trial.turn, TURN * TRACK / 2), _signs(trial.ahead, WAY)
    if turn is ahead is SeenMotion.NONE:
        yield from _standing(trial, counted)
        return
    encoders = encoder_fault(truth, counted)
    name = "encoders" if trial.counted else "odometry"
    if encoders:
        cure = "the plugs and the wires of the encoders" if trial.counted else "the node of its odometry"
        yield wrong(name, encoders, f"look at {cure}")
    else:
        yield Finding(name, "count as the wheels turn")
    yield from _gyro(trial, truth, encoders_right=not encoders)


def encoder_fault(truth: tuple[Signs, Signs], counted: tuple[Signs, Signs]) -> str:
    """Return what is wrong with encoders that ``counted`` so in the turn and on the way, or nothing."""
    moves = [(there, here) for there, here in zip(truth, counted, strict=True) if there != (0, 0)]
    if all(there == here for there, here in moves):
        return ""
    if all(here == (0, 0) for _, here in moves):
        return "do not count, though the wheels turn: blocked, or not connected"
    for what, change in _CHANGES:
        if all(change(there) == here for there, here in moves):
            return what
    return f"do not fit: {'; '.join(f'wheels {_told(there)}, counted {_told(here)}' for there, here in moves)}"


_CHANGES = (
    ("the left one does not count", lambda it: (0, it[1])),
    ("the right one does not count", lambda it: (it[0], 0)),
    ("left and right are swapped", lambda it: (it[1], it[0])),
    ("both count the wrong way", lambda it: (-it[0], -it[1])),
    ("the left one counts the wrong way", lambda it: (-it[0], it[1])),
    ("the right one counts the wrong way", lambda it: (it[0], -it[1])),
    ("left and right are swapped, and both count the wrong way", lambda it: (-it[1], -it[0])),
)


def _motors(trial: BaseTrial, turn: SeenMotion, ahead: SeenMotion) -> Iterator[Finding]:
    stopped = f" (its driver stopped it: {'; '.join(dict.fromkeys(trial.faults))})" if trial.faults else ""
    if (turn, ahead) == (SeenMotion.LEFT, SeenMotion.AHEAD):
        yield Finding("motors", "turn as they should")
    elif turn is ahead is SeenMotion.NONE:
        cure = "is its E-stop pressed, or a motor switch off? look at the motors' supply"
        yield wrong("motors", f"it did not move{stopped}", cure)
    elif fault := _MOTORS.get((turn, ahead)):
        yield wrong("motors", f"{fault[0]}{stopped}", fault[1])
    else:
        what = f"the turn to its left went {turn.value}, the way ahead went {ahead.value}{stopped}"
        yield wrong("motors", what, "look at the motors, their plugs, and what is in the way; then try again")


def _standing(trial: BaseTrial, counted: tuple[Signs, Signs]) -> Iterator[Finding]:
    """Judge the instruments of a base that did not move."""
    if any(signs != (0, 0) for signs in counted):
        what = "counted, though the base did not move: its wheels slip, or hang in the air"
        yield warning("encoders" if trial.counted else "odometry", what, "put it on the floor, and try again")


def _gyro(trial: BaseTrial, truth: tuple[Signs, Signs], *, encoders_right: bool) -> Iterator[Finding]:
    """Compare the gyro with the true turn; where it differs from the encoders, say which is likely wrong."""
    drift = 0.0 if trial.rest.gyro is None or not trial.rest.seconds else trial.rest.gyro / trial.rest.seconds
    for moved, (left, right), commanded in ((trial.turn, truth[0], TURN), (trial.ahead, truth[1], 2 * WAY / TRACK)):
        if moved.gyro is None or left == right:
            continue
        turned, way = moved.gyro - drift * moved.seconds, 1.0 if right > left else -1.0
        if abs(turned) < TURNED * commanded * abs(right - left) / 2:
            yield wrong("gyro", "shows no turn, though the base turned: it does not measure", "is it connected?")
        elif turned * way < 0:
            yield wrong("gyro", "shows the turn the other way round: its sign is swapped", "look how it is mounted")
        elif encoders_right:
            yield _amounts(turned, moved.turn, commanded, counted=trial.counted)
        else:
            yield Finding("gyro", f"turned by {degrees(turned):+.1f} deg")
        return


def _amounts(gyro: float, wheels: float, commanded: float, *, counted: bool) -> Finding:
    """Compare the turn by the gyro with the one by the wheels, of the same sign."""
    both = f"gyro {degrees(gyro):+.1f} deg, {'encoders' if counted else 'odometry'} {degrees(wheels):+.1f} deg"
    ratio = gyro / wheels if wheels else 0.0
    if 1 / AGREEMENT <= ratio <= AGREEMENT:
        return Finding("gyro", f"agrees with the wheels: {both}")
    expected = copysign(commanded, gyro)
    culprit = "the gyro" if abs(gyro - expected) > abs(wheels - expected) else "the wheels (they slip, or the track)"
    what = f"{both}, for {degrees(expected):+.0f} deg commanded: likely wrong is {culprit}"
    return warning("gyro", what, "try it on a floor with more grip; check the wheels' measures in the robot file")


def _signs(moved: InstrumentReadings, commanded: float) -> Signs:
    """Return in which direction each wheel was counted."""
    left, right = (0 if abs(way) < COUNTED * commanded else 1 if way > 0 else -1 for way in (moved.left, moved.right))
    return left, right


def _told(signs: Signs) -> str:
    return " and ".join({1: "ahead", -1: "back", 0: "still"}[sign] for sign in signs)
