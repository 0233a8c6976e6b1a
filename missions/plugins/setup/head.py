"""``mission head``: show, move, trim and calibrate a pan/tilt head."""

import json
import sys
from collections.abc import Callable, Mapping
from math import degrees, radians, sin
from types import MappingProxyType

import click

from config.yaml_edit import NotEditableError
from drivers.api import HeadPose
from drivers.arduino.driver import ArduinoHead
from drivers.arduino.session import BootState
from drivers.errors import BadRequest
from drivers.head.keys import ServoKeys
from drivers.head.pantilt import STRAIGHT_AHEAD, Trimmable
from drivers.servos.declared import NeckJointKeys
from missions.assembly.learnt_delays import MIN_SAMPLES
from missions.cli.commands import LazyGroup
from missions.cli.keys import KeyReader
from missions.cli.numbers import QuantityInUnit
from missions.cli.origin import robot_file
from missions.cli.outputs import check_writable
from missions.cli.printable import overwrite_line
from missions.cli.root import FAILURE, SUCCESS
from missions.library.tuning import check_editable
from missions.library.tuning import save_values as keep_values
from missions.plugins.setup.head_connection import (
    DEFAULT_HEAD,
    OpenHead,
    head_option,
    open_robot_head,
    pause,
    robot_options,
)
from perception.delay import MAX_STEADY_JITTER, MAX_STORABLE_SPREAD
from perception.exposure_clock import MAX_DELAY, MIN_DELAY

# Trimming with arrow keys.

TRIM_STEPS = (0.5, 1.0, 2.0, 5.0)
"""Angles in degrees by which one key press can trim the head; the user selects one of them.

A head whose Arduino runs a Rodney sketch accepts whole degrees only.
"""

TRIM_HELP = (
    "Arrow keys turn the head, + and - change the step, 0 removes the trims.\n"
    "Enter keeps the trims, q restores the old ones."
)

_ARROW_DIRECTIONS = {"left": (1, 0), "right": (-1, 0), "up": (0, -1), "down": (0, 1)}


def trim_by_hand(
    head: Trimmable,
    keys: KeyReader,
    signs: tuple[int, int],
    show: Callable[[str], None],
    problem: Callable[[], str],
) -> bool:
    """Let the user trim the head with keys; return whether they accepted, otherwise the trims are restored.

    ``signs`` are -1 for an axis whose motor turns opposite to the head. ``show`` prints the status line, ``problem``
    returns the reason why the head does not move. Only the enter key accepts.
    """
    before, step, content = head.trim(), 1, False
    try:
        while not content:
            pan, tilt = (degrees(trim) for trim in head.trim())
            show(f"trim: pan {pan:+.1f} deg, tilt {tilt:+.1f} deg, step {TRIM_STEPS[step]:g}  {problem()}")
            match keys.read(0.2):
                case "left" | "right" | "up" | "down" as key:
                    _turn(head, _ARROW_DIRECTIONS[key], signs, radians(TRIM_STEPS[step]))
                case "+" | "=":
                    step = min(step + 1, len(TRIM_STEPS) - 1)
                case "-":
                    step = max(step - 1, 0)
                case "0":
                    head.trim(pan=0.0, tilt=0.0)
                case "enter":
                    content = True
                case "q" | "escape" | "end":
                    break
                case _:
                    pass
    finally:
        if not content:
            head.trim(pan=before[0], tilt=before[1])
    return content


def _turn(head: Trimmable, turn: tuple[int, int], signs: tuple[int, int], step: float) -> None:
    """Turn the head by one trim step in the direction of an arrow key, up to the limit of the trim.

    ``turn`` is the direction on each axis: 1, 0 or -1. ``signs`` are -1 for an axis whose motor turns opposite to the
    head.
    """
    pan, tilt = (trim + way * sign * step for trim, way, sign in zip(head.trim(), turn, signs, strict=True))
    try:
        head.trim(pan=pan, tilt=tilt)
    except BadRequest:
        return  # at the limit


BOOT_NOTICES: Mapping[BootState, str] = MappingProxyType(
    {
        BootState.RESET: "opening its port has reset its board: the head is at the pose in its sketch",
        BootState.UNKNOWN: "its board does not report its pose: it is the last one, or the pose in its sketch",
    }
)
"""Notices about the pose of a Rodney head by boot state: after a reset, or if its board does not report the pose."""

KEEP_COMMAND = "mission head trim --robot FILE --keep"
"""Command suggested if a robot file cannot be written: FILE is the user's copy of it."""

SWING_ANGLE, SWING_RATE = radians(15), 2.5
"""Phase rate in rad/s of the swing by ``SWING_ANGLE`` (rad) to both sides: at most 38 degrees a second."""


@click.group("head", cls=LazyGroup, epilog="Example: mission head where --robot turtlebot2_arm")
def command() -> None:
    """Show, move, trim and calibrate the head.

    Opening the port resets most boards: a Rodney head then moves to the pose in its sketch. Simulated unless you name a
    robot, as with `mission run`.
    """


@command.command(epilog="Example: mission head look --pan 30 --tilt -10")
@robot_options
@head_option
@click.option("--pan", type=QuantityInUnit("deg"), default=0.0, metavar="DEG", help="Pan angle; positive is left.")
@click.option("--tilt", type=QuantityInUnit("deg"), default=0.0, metavar="DEG", help="Tilt angle; positive is down.")
def look(robot: str | None, simulate: bool, port: str | None, head: str, pan: float, tilt: float) -> int:
    """Look in a direction, and wait until the head is there."""
    with open_robot_head(robot, simulate=simulate, port=port, head=head) as bench:
        return bench.look(HeadPose(radians(pan), radians(tilt)))


@command.command(epilog="Example: mission head center --robot turtlebot2_arm")
@robot_options
@head_option
def center(robot: str | None, simulate: bool, port: str | None, head: str) -> int:
    """Look straight ahead, so that you can see whether the head is mounted askew."""
    with open_robot_head(robot, simulate=simulate, port=port, head=head) as bench:
        return bench.look(STRAIGHT_AHEAD)


@command.command(epilog="Example: mission head where --json")
@robot_options
@head_option
@click.option("--json", "as_json", is_flag=True, help="Print one line of JSON; angles in degrees, wheels in rad/s.")
def where(robot: str | None, simulate: bool, port: str | None, head: str, as_json: bool) -> int:
    """Show the angle, limits and trim of each axis. Turns nothing."""
    with open_robot_head(robot, simulate=simulate, port=port, head=head, stay=True) as bench:
        if isinstance(bench.head, ArduinoHead) and (
            began := BOOT_NOTICES.get(bench.head.board.first_boot_state or BootState.UNKNOWN)
        ):
            click.echo(began, err=True)
        axes = bench.axis_figures()
        rates = bench.head.board.wheels().value if isinstance(bench.head, ArduinoHead) else None
        if as_json:
            wheels = {} if rates is None else {"wheels": [round(rates.left, 3), round(rates.right, 3)]}
            click.echo(json.dumps({**axes, **wheels}))
            return SUCCESS
        for name, axis in axes.items():
            limits = f"{axis['from']:g} to {axis['to']:g} deg"
            click.echo(f"{name:12} {axis['angle']:+7.1f} deg   limits {limits}, trim {axis['trim']:+g} deg")
        if rates is not None:
            click.echo(f"{'wheels':12} left {rates.left:+.2f} rad/s, right {rates.right:+.2f} rad/s")
    return SUCCESS


@command.command(epilog="Example: mission head trim --robot my_robot.yaml --pan 4 --tilt -2 --keep")
@robot_options
@head_option
@click.option("--pan", type=QuantityInUnit("deg"), metavar="DEG", help="Trim of the pan servo, in its own direction.")
@click.option("--tilt", type=QuantityInUnit("deg"), metavar="DEG", help="Trim of the tilt servo, in its own direction.")
@click.option("--keep", is_flag=True, help="Write the trims to the robot file; nothing else in it changes.")
def trim(
    robot: str | None, simulate: bool, port: str | None, head: str, pan: float | None, tilt: float | None, keep: bool
) -> int:
    """Trim the head.

    Use the arrow keys while it looks ahead, or --pan and --tilt.

    Enter accepts, q restores the old trims.
    """
    by_hand = pan is None and tilt is None
    if by_hand and not sys.stdin.isatty():
        raise click.UsageError("the arrow keys need a terminal; give --pan DEG and --tilt DEG instead")
    path, again = robot_file(robot), KEEP_COMMAND + ("" if head == DEFAULT_HEAD else f" --head {head}")
    try:
        if keep:
            check_editable(path, again)
            check_writable(path, "--keep")
        with open_robot_head(robot, simulate=simulate, port=port, head=head) as bench:
            trims = _trim_with_keys(bench) if by_hand else _set_trims(bench, pan, tilt)
        if trims is None:
            click.echo("nothing was changed")
            return FAILURE
        words = ", ".join(f"{axis} {degrees(value):+g} deg" for axis, value in zip(("pan", "tilt"), trims, strict=True))
        values = {f"{head}.{axis}.trim": value for axis, value in zip(("pan", "tilt"), trims, strict=True)}
        changes = keep_values(path, values, again) if keep else []
    except NotEditableError as error:
        raise click.UsageError(str(error)) from error
    kept = f"; written to {path}" if changes else "; the file has them already" if keep else "; --keep writes them"
    click.echo(f"trimmed: {words}{kept}")
    return SUCCESS


@command.command(epilog="Example: mission head calibrate --robot turtlebot2_arm")
@robot_options
@click.option(
    "--seconds", type=QuantityInUnit("s", 2, 60), default=6.0, show_default=True, help="Duration of the swing."
)
def calibrate(robot: str | None, simulate: bool, port: str | None, seconds: float) -> int:
    """Measure the delay of the camera's time stamps.

    The head looks back and forth, and the shift of the background is measured.

    Runs learn this delay themselves while the head turns, and store it. This command measures it before the first run.
    """
    with open_robot_head(robot, simulate=simulate, port=port, camera=True) as bench:
        if bench.lags is None:
            raise click.UsageError("this robot has no camera on its head, so there is nothing to calibrate")
        _swing_head(bench, seconds)
        delay, lag = bench.lags.delay, bench.lags.lag
    if delay.informative_pairs < MIN_SAMPLES:
        click.echo(f"only {delay.informative_pairs} usable pairs of pictures; {MIN_SAMPLES} are needed", err=True)
        click.echo("  try: more light, a view with edges in it, --seconds 20", err=True)
        return FAILURE
    late, spread = 1000 * delay.seconds, 1000 * delay.spread
    click.echo(
        f"pictures are stamped {late:.0f} ms after their exposure "
        f"(one sigma {spread:.0f} ms, {delay.informative_pairs} pairs)"
    )
    if delay.jitter > MAX_STEADY_JITTER:
        click.echo(f"their stamps jitter by {1000 * delay.jitter:.0f} ms (one sigma)")
    if not delay.is_known:
        ends = f"{1000 * MIN_DELAY:.0f} to {1000 * MAX_DELAY:.0f} ms"
        limits = f"{ends}, one sigma at most {1000 * MAX_STORABLE_SPREAD:.0f} ms"
        click.echo(f"the delay is too uncertain, or implausible, and is not stored ({limits})", err=True)
        click.echo(
            "  try: more light, a view with edges in it, --seconds 20, with fewer other programs on this computer",
            err=True,
        )
    if lag.learnt:
        click.echo(f"the base starts {1000 * lag.seconds:.0f} ms after a command to turn, as learnt in earlier runs")
    return SUCCESS


def _swing_head(bench: OpenHead, seconds: float) -> None:
    """Swing the head back and forth for some seconds, then look ahead."""
    limits, start = bench.head.limits, bench.clock.now()
    click.echo(f"the head looks to both sides for {seconds:g} s")
    while (since := bench.clock.now() - start) < seconds:
        bench.head.look(limits.clamp(HeadPose(SWING_ANGLE * sin(SWING_RATE * since), STRAIGHT_AHEAD.tilt)))
        pause()
    bench.wait_for(bench.head.look(limits.clamp(STRAIGHT_AHEAD)))


def _set_trims(bench: OpenHead, pan: float | None, tilt: float | None) -> tuple[float, float]:
    """Set the trims (degrees), and wait until the head looks ahead with them; return the trims.

    None leaves the trim of that axis unchanged.
    """
    trims = bench.trimmer.trim(pan=None if pan is None else radians(pan), tilt=None if tilt is None else radians(tilt))
    bench.look(STRAIGHT_AHEAD)
    return trims


def _trim_with_keys(bench: OpenHead) -> tuple[float, float] | None:
    """Let the user trim the head with keys; return the trims, or None if they cancelled."""
    signs = _axis_sign(bench.config.pan), _axis_sign(bench.config.tilt)
    click.echo(TRIM_HELP)
    with KeyReader(sys.stdin.fileno()) as keys:
        try:
            content = trim_by_hand(bench.trimmer, keys, signs, overwrite_line, lambda: bench.head.health().detail)
        finally:
            click.echo()
    return bench.trimmer.trim() if content else None


def _axis_sign(axis: ServoKeys | NeckJointKeys) -> int:
    """Return -1 for an axis whose servo is mounted so that it turns opposite to the head, else 1."""
    return -1 if isinstance(axis, ServoKeys) and axis.flip else 1
