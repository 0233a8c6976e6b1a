"""``mission gait``: check gaits of a robot with legs, and create new ones from them."""

import csv
import json
from collections.abc import Iterator, Sequence
from io import StringIO
from math import degrees
from pathlib import Path

import click
import numpy as np

from config.file_io import save_file
from config.gesture import load_gait
from config.library import SHEET_SUFFIXES, find_file
from config.robot import RobotConfig
from drivers.api import JointLimits
from drivers.errors import BadRequest
from drivers.legs.balance import support_margins
from drivers.legs.body import SIDES, Floats, LeggedBody, body_of
from drivers.legs.declared import LegsKeys, StrideKeys
from drivers.legs.gait import Gait, blend_gaits, gait_from_keys, join_gaits, mirror_gait, scale_gait, spline_gait
from drivers.legs.gait_check import gait_errors
from drivers.legs.kinematics import forward_kinematics, sole_pose
from drivers.servos.declared import DynamixelKeys
from missions.cli.commands import LazyGroup, shared_option
from missions.cli.names import GAIT, ROBOT
from missions.cli.numbers import RealNumber, WholeNumber
from missions.cli.outputs import report_write_errors
from missions.library.drivers import load_robot
from missions.library.moves.load import load_move
from missions.plugins.pictures.movie import CODECS, Movie, check_output
from missions.plugins.pictures.png import PLOTS_MISSING

# Gaits from and to files: gait files, and spreadsheets of the angles of both legs in radians.

MAX_SOLE_TILT = 0.01
"""Maximum tilt of a sole in a spreadsheet, in radians: gaits have level soles."""

FLOOR_CONTACT_HEIGHT = 0.0005
"""Metres above the lower sole within which the other sole of a spreadsheet is also on the floor."""

TIME_COLUMN = "time"


class LeggedRobot:
    """A robot with legs, which checks and loads gaits.

    The constructor raises BadRequest for a robot without legs.
    """

    def __init__(self, robot: RobotConfig) -> None:
        keys, arm = robot.keys(LegsKeys), robot.arm
        if keys is None or arm is None:
            raise BadRequest(f"robot '{robot.name}' has no legs", hint="a gait needs a base of `driver: legs`")
        self.arm = arm
        self.body: LeggedBody = body_of(keys.body)
        self.stride: StrideKeys = keys.stride
        self.limits: dict[str, JointLimits] = dict(arm.limits)
        servos = arm.servos if isinstance(arm, DynamixelKeys) else {}
        self.torques = {name: servo.servo_model.stall_torque * servo.torque for name, servo in servos.items()}

    def gait_errors(self, gait: Gait) -> list[str]:
        """Return the reasons why the robot cannot play a gait."""
        return [f"{gait.name}: {each}" for each in gait_errors(self.body, gait, self.limits, self.torques)]

    def load(self, path: Path) -> Gait:
        """Load a gait. Raises InvalidFileError for an invalid file, BadRequest for one that does not fit the robot."""
        if path.suffix.lower() in SHEET_SUFFIXES:
            return self._load_sheet(path)
        return gait_from_keys(load_gait(path), self.body, self.stride)

    def _load_sheet(self, path: Path) -> Gait:
        """Return a gait from a spreadsheet of joint angles that holds one cycle; its last row repeats the first one."""
        move = load_move(path)
        known = set(self.arm.limits)
        if strange := sorted({joint for frame in move.keyframes for joint in frame.positions} - known):
            raise BadRequest(f"{path}: unknown joint '{strange[0]}'", hint="the heading of a column is its joint")
        times = np.array([frame.time for frame in move.keyframes])
        if len(times) < 4:
            raise BadRequest(f"{path}: a cycle needs more than three rows")
        poses, now = [], dict.fromkeys(self.body.joints, 0.0)
        for frame in move.keyframes[:-1]:
            now |= frame.positions
            poses.append(self.body.pose(now))
        placed = forward_kinematics(self.body, np.array(poses))
        feet, headings = np.empty((len(poses), 2, 3)), np.empty((len(poses), 2))
        for number, side in enumerate(SIDES):
            feet[:, number], turned = sole_pose(self.body, placed, side)
            tilt = np.arccos(np.clip(turned[:, 2, 2], -1.0, 1.0))
            if tilt.max() > MAX_SOLE_TILT:
                at = times[int(tilt.argmax())] - times[0]
                told = f"the {side} sole is not level, {degrees(tilt.max()):.1f} deg at {at:.2f} s"
                raise BadRequest(f"{path}: {told}", hint="play it as a movement: mission servo play")
            headings[:, number] = np.arctan2(turned[:, 1, 0], turned[:, 0, 0])
        on = feet[..., 2] - feet[..., 2].min(axis=1, keepdims=True) < FLOOR_CONTACT_HEIGHT
        period = float(times[-1] - times[0])
        return spline_gait(path.stem, period, (times[:-1] - times[0]) / period, feet, headings, on)

    def table(self, times: Floats, angles: Floats) -> str:
        """Return a table of the leg joints as CSV text: a column of times (s), and one of angles (rad) per joint."""
        out = StringIO()
        lines = csv.writer(out, lineterminator="\n")
        lines.writerow([TIME_COLUMN, *self.body.leg_joints])
        for time, row in zip(times.tolist(), angles.tolist(), strict=True):
            lines.writerow([f"{time:.4f}", *(f"{angle:.6f}" for angle in row)])
        return out.getvalue()


def format_gait(gait: Gait, name: str) -> str:
    """Return the text of a gait file with the pose of both soles at each point of the cycle."""
    lines = [f"gait: {json.dumps(name)}", f"period: {gait.period:.6g} s", "points:"]
    for place in range(len(gait.feet)):
        left, right = (_vector(gait.feet[place, number].tolist()) for number in (0, 1))
        turns = [f"{degrees(each):.4f} deg" for each in gait.headings[place].tolist()]
        on = "both" if gait.on_floor[place].all() else "left" if gait.on_floor[place, 0] else "right"
        at = 100 * place / len(gait.feet)
        ends = f"left_turn: {turns[0]}, right_turn: {turns[1]}, on: {on}"
        lines.append(f"  - {{at: {at:g} %, left: {left}, right: {right}, {ends}}}")
    return "\n".join(lines) + "\n"


def _vector(place: Sequence[float]) -> str:
    return "[" + ", ".join(f"{1000 * each:.3f} mm" for each in place) + "]"


DEFAULT_ROBOT = "humanoid"
"""Robot for which gaits are checked and loaded without ``--robot``."""

SHEET_SUFFIX = ".csv"

MAX_CYCLES = 1000
"""Maximum number of gait cycles in one spreadsheet: about a quarter of an hour."""

robot_option = shared_option("--robot", type=ROBOT, default=DEFAULT_ROBOT, show_default=True, help="Robot: one "
                            "with legs (a name or a file).")  # fmt: skip
output_option = click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    metavar="FILE",
    help="A gait file (.yaml), or a spreadsheet of angles in radians (.csv).",
)


@click.group("gait", cls=LazyGroup, epilog="Example: mission gait check stroll")
def command() -> None:
    """Check gaits, and create new ones from them; `mission show GAIT` describes and draws one.

    A gait is the name of a shipped one, a gait file, or a spreadsheet of the legs' angles (.csv, .xlsx, .xls, .ods)
    whose last row repeats the first one. A gait that the robot cannot play is refused, with the joint and the time, and
    nothing is written.
    """


@command.command(epilog="Example: mission gait check stroll --robot op3")
@click.argument("files", type=GAIT, nargs=-1, required=True, metavar="GAIT...")
@robot_option
def check(files: tuple[str, ...], robot: str) -> None:
    """Check whether a robot can walk gaits.

    Checks reach, limits, speeds, static torques, collisions, and support within the soles.
    """
    walker = _load_robot(robot)
    wrong = [each for path in files for each in walker.gait_errors(_load(walker, path))]
    if wrong:
        raise click.ClickException("\n".join(wrong))
    for path in files:
        click.echo(f"{path}: good for {robot}")


def show_gait(file: str, output: Path | None, robot: str | None) -> None:
    """Print the joints' angles and speeds in a cycle, with their limits, and the support margin.

    A picture shows soles, pelvis and centre of mass over the cycle, and the joints over time. A film shows two cycles
    as a stick figure, from its right and from the front.
    """
    walker = _load_robot(robot or DEFAULT_ROBOT)
    gait = _load(walker, file)
    for line in _describe(walker, gait):
        click.echo(line)
    if output is not None:
        (_film if output.suffix in CODECS else _draw)(walker, gait, output)


@command.command(epilog="Example: mission gait make stroll -o stroll.csv --cycles 4")
@click.argument("file", type=GAIT, metavar="GAIT")
@click.option(
    "--cycles",
    type=WholeNumber(min=1, max=MAX_CYCLES),
    default=1,
    show_default=True,
    help="Cycles of a spreadsheet.",
)
@output_option
@robot_option
def make(file: str, cycles: int, output: Path, robot: str) -> None:
    """Convert a gait to a gait file of keyframes, or to a spreadsheet."""
    walker = _load_robot(robot)
    _write(walker, _load(walker, file), output, cycles)


@command.command(epilog="Example: mission gait blend stroll curve --share 0.3 -o between.yaml")
@click.argument("one", type=GAIT)
@click.argument("other", type=GAIT)
@click.option("--share", type=RealNumber(0.0, 1.0), default=0.5, show_default=True, help="Share of the second gait.")
@output_option
@robot_option
def blend(one: str, other: str, share: float, output: Path, robot: str) -> None:
    """Create a gait between two gaits."""
    walker = _load_robot(robot)
    _write(walker, blend_gaits(_load(walker, one), _load(walker, other), share), output)


@command.command(epilog="Example: mission gait mirror curve -o right.yaml")
@click.argument("file", type=GAIT, metavar="GAIT")
@output_option
@robot_option
def mirror(file: str, output: Path, robot: str) -> None:
    """Create the mirror image of a gait, with left and right leg swapped."""
    walker = _load_robot(robot)
    _write(walker, mirror_gait(_load(walker, file)), output)


@command.command(epilog="Example: mission gait scale stroll --length 1.2 -o longer.yaml")
@click.argument("file", type=GAIT, metavar="GAIT")
@click.option("--length", type=RealNumber(0.0, 10.0), default=1.0, show_default=True, help="Factor of the step length.")
@click.option("--rise", type=RealNumber(0.0, 10.0), default=1.0, show_default=True, help="Factor of the foot rise.")
@click.option("--time", type=RealNumber(0.1, 10.0), default=1.0, show_default=True, help="Factor of the period.")
@output_option
@robot_option
def scale(file: str, length: float, rise: float, time: float, output: Path, robot: str) -> None:
    """Create a gait with longer steps, higher feet or another period."""
    walker = _load_robot(robot)
    _write(walker, scale_gait(_load(walker, file), length=length, rise=rise, time=time), output)


@command.command(name="sequence", epilog="Example: mission gait sequence stroll curve --cycles 3 -o way.csv")
@click.argument("files", type=GAIT, nargs=-1, required=True, metavar="GAIT...")
@click.option(
    "--cycles", type=WholeNumber(min=1, max=MAX_CYCLES), default=2, show_default=True, help="Cycles of each gait."
)
@output_option
@robot_option
def sequence_(files: tuple[str, ...], cycles: int, output: Path, robot: str) -> None:
    """Join gaits into one spreadsheet, after checking each gait by itself."""
    if output.suffix != SHEET_SUFFIX:
        raise click.BadParameter(f"{output}: a sequence is a spreadsheet: end its name in .csv", param_hint="-o")
    walker = _load_robot(robot)
    gaits = [_load(walker, path) for path in files]
    _require_feasible(walker, *gaits)
    _save(output, walker.table(*join_gaits(walker.body, [(gait, cycles) for gait in gaits])))


def _load_robot(robot: str) -> LeggedRobot:
    return LeggedRobot(load_robot(find_file("robots", robot)))


def _load(walker: LeggedRobot, gait: str) -> Gait:
    return walker.load(find_file("gaits", gait))


def _require_feasible(walker: LeggedRobot, *gaits: Gait) -> None:
    """Raise click.ClickException for gaits that the robot cannot play."""
    if wrong := [each for gait in gaits for each in walker.gait_errors(gait)]:
        raise click.ClickException("\n".join([*wrong, "nothing is written"]))


def _write(walker: LeggedRobot, gait: Gait, output: Path, cycles: int = 1) -> None:
    _require_feasible(walker, gait)
    if output.suffix == SHEET_SUFFIX:
        _save(output, walker.table(*join_gaits(walker.body, [(gait, cycles)])))
    elif output.suffix in (".yaml", ".yml"):
        _save(output, format_gait(gait, output.stem))
    else:
        raise click.BadParameter(f"{output}: end its name in .yaml or .csv", param_hint="-o")


def _draw(walker: LeggedRobot, gait: Gait, output: Path) -> None:
    """Draw a gait. Raises click.ClickException for an unreachable one, and click.UsageError without Matplotlib."""
    try:
        from missions.plugins.legs.gait_plot import draw_gait  # noqa: PLC0415 - an extra, and slow to import
    except ImportError as error:
        raise click.UsageError(PLOTS_MISSING) from error
    _require_reachable(walker, gait)
    with report_write_errors(output, "-o"):
        try:
            draw_gait(output, gait, walker.body, walker.limits)
        except ValueError as error:
            told = f"{error}, a film in {', '.join(CODECS)}"
            raise click.BadParameter(told, param_hint="-o") from error
    click.echo(f"wrote {output}", err=True)


def _film(walker: LeggedRobot, gait: Gait, output: Path) -> None:
    """Film a gait. Raises click.ClickException for an unreachable one, and for an unusable output path."""
    from missions.plugins.legs.gait_plot import FRAME_RATE, gait_pictures  # noqa: PLC0415 - as for pictures

    check_output(output, "-o")
    _require_reachable(walker, gait)
    with Movie(output, rate=FRAME_RATE, option="-o") as movie:
        for picture in gait_pictures(gait, walker.body):
            movie.write(picture)
    if movie.error:
        raise click.ClickException(movie.error)
    click.echo(f"wrote {output}", err=True)


def _require_reachable(walker: LeggedRobot, gait: Gait) -> None:
    if gait.angles(walker.body)[1].any():
        raise click.ClickException(f"{gait.name}: cannot be drawn: a foot is out of reach")


def _save(output: Path, text: str) -> None:
    with report_write_errors(output, "-o"):
        save_file(output, text)
    click.echo(f"wrote {output}", err=True)


def _describe(walker: LeggedRobot, gait: Gait) -> Iterator[str]:
    """Yield the description of a gait, line by line."""
    yield f"{gait.name}: a cycle of {gait.period:.2f} s"
    angles, reason = gait.angles(walker.body)
    if not reason.any():
        speeds = np.abs(np.roll(angles, -1, axis=0) - angles) * len(angles) / gait.period
        yield f"{'joint':<20} {'from':>7} {'to':>7} {'limits':>15} {'deg/s':>7} {'of':>5}"
        for column, joint in enumerate(walker.body.leg_joints):
            its, row = walker.limits[joint], np.degrees(angles[:, column])
            limits = f"{np.degrees(its.lower):.0f} to {np.degrees(its.upper):.0f}"
            fast = f"{np.degrees(speeds[:, column].max()):7.0f} {np.degrees(its.speed):5.0f}"
            yield f"{joint:<20} {row.min():7.1f} {row.max():7.1f} {limits:>15} {fast}"
        yield f"support margin: {1000 * support_margins(walker.body, gait, angles).min():.0f} mm at least"
    yield from walker.gait_errors(gait) or ["good"]
