"""``mission head``: the pan/tilt head by hand: where it is, look there, look ahead, and put it straight."""

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
from perception.delay import MAX_STEADY_JITTER

# Putting the head straight by hand: arrow keys turn it, and what was turned is its trim.

TRIM_STEPS = (0.5, 1.0, 2.0, 5.0)
"""Degrees by which an arrow turns the head; the sketch takes whole ones."""

TRIM_HELP = "The arrows turn the head, + and - change the step, 0 is no trim.\nEnter keeps the trims, q puts them back."

_ARROW_DIRECTIONS = {"left": (1, 0), "right": (-1, 0), "up": (0, -1), "down": (0, 1)}


def trim_by_hand(
    head: Trimmable,
    keys: KeyReader,
    signs: tuple[int, int],
    show: Callable[[str], None],
    problem: Callable[[], str],
) -> bool:
    """Let a person trim the head until they are content; return False, with the trims as before, if they are not.

    ``signs`` are -1 for an axis whose motor turns the other way than the head. ``show`` is given the line to be seen,
    ``trouble`` says why the head does not move at present. Whatever ends it but the enter key puts the trims back.
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
    """Turn the head itself, whichever way its motors have to turn for that; not beyond what a trim may be."""
    pan, tilt = (trim + way * sign * step for trim, way, sign in zip(head.trim(), turn, signs, strict=True))
    try:
        head.trim(pan=pan, tilt=tilt)
    except BadRequest:
        return  # as far as it goes


BOOT_NOTICES: Mapping[BootState, str] = MappingProxyType(
    {
        BootState.RESET: "opening its port has started its board anew: that is where its sketch puts the head",
        BootState.UNKNOWN: "its board does not tell: that is where it was left, or else where its sketch puts the head",
    }
)
"""How a Rodney head knows where it looks; a board in step with a program before us is as one that has forgotten it."""

KEEP_COMMAND = "mission head trim --robot FILE --keep"
"""What to type with a copy of a robot file that is not to be written."""

SWING_ANGLE, SWING_RATE = radians(15), 2.5
"""How far to both sides the head looks about (radians), and rad/s of the phase: 38 degrees a second at most."""


@click.group("head", cls=LazyGroup, epilog="Example: mission head where --robot turtlebot2_arm")
def command() -> None:
    """The head by hand. Opening the port resets most boards: a Rodney head then stands where its sketch puts it.

    Simulated unless a robot is named, as with `mission run`.
    """


@command.command(epilog="Example: mission head look --pan 30 --tilt -10")
@robot_options
@head_option
@click.option("--pan", type=QuantityInUnit("deg"), default=0.0, metavar="DEG", help="Positive is to the left.")
@click.option("--tilt", type=QuantityInUnit("deg"), default=0.0, metavar="DEG", help="Positive is down.")
def look(robot: str | None, simulate: bool, port: str | None, head: str, pan: float, tilt: float) -> int:
    """Look somewhere, and wait until the head does."""
    with open_robot_head(robot, simulate=simulate, port=port, head=head) as bench:
        return bench.look(HeadPose(radians(pan), radians(tilt)))


@command.command(epilog="Example: mission head center --robot turtlebot2_arm")
@robot_options
@head_option
def center(robot: str | None, simulate: bool, port: str | None, head: str) -> int:
    """Look straight ahead: the time to see whether the head is mounted askew."""
    with open_robot_head(robot, simulate=simulate, port=port, head=head) as bench:
        return bench.look(STRAIGHT_AHEAD)


@command.command(epilog="Example: mission head where --json")
@robot_options
@head_option
@click.option("--json", "as_json", is_flag=True, help="As one line of JSON; angles in degrees, wheels in rad/s.")
def where(robot: str | None, simulate: bool, port: str | None, head: str, as_json: bool) -> int:
    """Say where the head looks, how far it turns, and how it is trimmed. Turns nothing."""
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
@click.option(
    "--pan", type=QuantityInUnit("deg"), metavar="DEG", help="The trim of the pan servo, in its own direction."
)
@click.option("--tilt", type=QuantityInUnit("deg"), metavar="DEG", help="The trim of the tilt servo.")
@click.option("--keep", is_flag=True, help="Write the trims into the robot file; nothing else in it is changed.")
def trim(
    robot: str | None, simulate: bool, port: str | None, head: str, pan: float | None, tilt: float | None, keep: bool
) -> int:
    """Put the head straight: with the arrow keys while it looks ahead, or by --pan and --tilt.

    Enter ends it, q puts everything back.
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
    kept = f"; written into {path}" if changes else "; the file has them already" if keep else "; --keep writes them"
    click.echo(f"trimmed: {words}{kept}")
    return SUCCESS


@command.command(epilog="Example: mission head calibrate --robot turtlebot2_arm")
@robot_options
@click.option(
    "--seconds", type=QuantityInUnit("s", 2, 60), default=6.0, show_default=True, help="How long it looks about."
)
def calibrate(robot: str | None, simulate: bool, port: str | None, seconds: float) -> int:
    """Find how late the camera stamps its pictures: the head looks to and fro, and the background tells.

    Runs learn it by themselves while the head turns, and keep it; this does it at once, before the first of them.
    """
    with open_robot_head(robot, simulate=simulate, port=port, camera=True) as bench:
        if bench.lags is None:
            raise click.UsageError("this robot has no camera on its head, so there is nothing to find out")
        _swing_head(bench, seconds)
        delay, lag = bench.lags.delay, bench.lags.lag
    if delay.informative_pairs < MIN_SAMPLES:
        click.echo(
            f"only {delay.informative_pairs} pairs of pictures told something; {MIN_SAMPLES} are needed", err=True
        )
        click.echo("  try: more light, a view with edges in it, --seconds 20", err=True)
        return FAILURE
    late, spread = 1000 * delay.seconds, 1000 * delay.spread
    click.echo(
        f"pictures are stamped {late:.0f} ms after their exposure (one sigma {spread:.0f} ms, {delay.informative_pairs} pairs)"
    )
    if delay.jitter > MAX_STEADY_JITTER:
        click.echo(f"their stamps jitter by {1000 * delay.jitter:.0f} ms (one sigma)")
    if not delay.is_known:
        click.echo("that is not known well enough to be stored", err=True)
        click.echo("  try: --seconds 20, with fewer other programs on this computer", err=True)
    if lag.learnt:
        click.echo(
            f"the base begins {1000 * lag.seconds:.0f} ms after it was told to turn, as earlier runs have learnt"
        )
    return SUCCESS


def _swing_head(bench: OpenHead, seconds: float) -> None:
    """Let the head look to and fro for some seconds, and then ahead."""
    limits, start = bench.head.limits, bench.clock.now()
    click.echo(f"the head looks to both sides for {seconds:g} s")
    while (since := bench.clock.now() - start) < seconds:
        bench.head.look(limits.clamp(HeadPose(SWING_ANGLE * sin(SWING_RATE * since), STRAIGHT_AHEAD.tilt)))
        pause()
    bench.wait_for(bench.head.look(limits.clamp(STRAIGHT_AHEAD)))


def _set_trims(bench: OpenHead, pan: float | None, tilt: float | None) -> tuple[float, float]:
    """Set the trims (degrees), and wait until the head is straight by them."""
    trims = bench.trimmer.trim(pan=None if pan is None else radians(pan), tilt=None if tilt is None else radians(tilt))
    bench.look(STRAIGHT_AHEAD)
    return trims


def _trim_with_keys(bench: OpenHead) -> tuple[float, float] | None:
    """Let a person set the trims; None if they thought better of it."""
    signs = _axis_sign(bench.config.pan), _axis_sign(bench.config.tilt)
    click.echo(TRIM_HELP)
    with KeyReader(sys.stdin.fileno()) as keys:
        try:
            content = trim_by_hand(bench.trimmer, keys, signs, overwrite_line, lambda: bench.head.health().detail)
        finally:
            click.echo()
    return bench.trimmer.trim() if content else None


def _axis_sign(axis: ServoKeys | NeckJointKeys) -> int:
    """Return -1 for a servo that turns the other way than the head."""
    return -1 if isinstance(axis, ServoKeys) and axis.flip else 1
