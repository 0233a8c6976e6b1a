"""``mission servo play``: play a movement on the arm with error statistics, or show its plan."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType

import click

from behaviours.joint_motion import RUN_IN_SPEED, JointSample
from behaviours.joint_ranges import degrees_text
from behaviours.keyframe_playback import KeyframeMotion, Play
from config.library import SHEET_SUFFIXES, find_file, shipped_files
from drivers.api import Gesture, JointLimits
from missions.cli.commands import SharingCommand
from missions.cli.names import GESTURE
from missions.cli.numbers import QuantityInUnit, RealNumber
from missions.cli.outputs import check_writable
from missions.cli.root import SUCCESS
from missions.library.moves.load import load_move
from missions.plugins.setup.servo.leaf_run import run_leaf
from missions.plugins.setup.servo.movement_tables import error_table, plan_playback, pose_table, write_csv
from missions.plugins.setup.servo.target import ServoTarget, target_options

CURVE_POINTS = 400
"""Number of points with which a curve of a movement is plotted."""

Curves = Mapping[str, tuple[Sequence[float], Sequence[float]]]
"""Curve of each joint in a movement, by joint name: its times (s) and its angles (rad)."""


@click.command(cls=SharingCommand, epilog="Example: mission servo play greeting --dry-run")
@partial(target_options, baud=False)
@click.argument("name", type=GESTURE, metavar="NAME|FILE")
@click.option(
    "--speed", type=RealNumber(0.05, 2.0), default=1.0, show_default=True, help="Speed relative to the movement's own."
)
@click.option("--rate", type=QuantityInUnit("Hz", 0.1), metavar="HZ", help="Rows per second of a spreadsheet "
              "without times.")  # fmt: skip
@click.option("--dry-run", is_flag=True, help="Move nothing: check the movement, and print the planned poses.")
@click.option("--plot", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE", help="Plot goals and "
              "measurements to a .png or .svg file.")  # fmt: skip
@click.option("--csv", "table", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE", help="Write the "
              "measurements as CSV: time, joint, goal, position, error; in s and rad.")  # fmt: skip
def play(
    target: ServoTarget,
    name: str,
    speed: float,
    rate: float | None,
    dry_run: bool,
    plot: Path | None,
    table: Path | None,
) -> int:
    """Play a movement, or show its plan.

    A recording, a gesture, or a spreadsheet of angles (.csv, .xlsx, .xls, .ods). Everything is checked before anything
    moves. The arm moves to the first pose slowly, and at the end to rest. Then the error of each joint is printed.
    """
    target.require_joints()
    config = target.config()
    _check_files(plot, table, dry_run=dry_run)
    file = _find_movement(name)
    movement = load_move(file, rate=rate, arm=target.keys)
    if file.suffix.lower() in SHEET_SUFFIXES and movement.summary:
        click.echo(movement.summary, err=True)
    limits = target.keys.limits
    playing = plan_playback(movement, limits, speed)
    click.echo(_summary(movement, playing, speed))
    if dry_run:
        click.echo(pose_table(playing))
        if plot is not None:
            _draw_plot(plot, movement.name, _goal_curves(playing), limits, None)
        return SUCCESS
    things = {"move": lambda _: movement}
    code, leaf = run_leaf(target, config, Play, {"move": "it", "speed": speed}, things=things)
    tracking = getattr(leaf, "tracking", None)  # missing if the leaf never started
    if tracking is None:
        return code
    if tracking.samples:
        click.echo(error_table(tracking.errors()))
    if table is not None:
        _write_file(table, lambda: write_csv(table, tracking.samples))
    if plot is not None:
        _draw_plot(
            plot,
            movement.name,
            _measured_curves(tracking.samples, "goal"),
            limits,
            _measured_curves(tracking.samples, "position"),
        )
    return code


def _find_movement(name: str) -> Path:
    """Return the file of a movement: a shipped one, NAME.yaml in the current folder, or a path."""
    recorded = Path(f"{name}.yaml")
    own = {name: recorded} if recorded.is_file() else {}
    return find_file("moves", name, library=own | shipped_files("gestures"))


def _check_files(plot: Path | None, table: Path | None, *, dry_run: bool) -> None:
    """Raise click.UsageError for output files that cannot be written, before anything moves."""
    if table is not None and dry_run:
        raise click.UsageError("--csv needs measurements, and --dry-run has none")
    if plot is not None and plot.suffix not in (formats := _import_plotting().FORMATS):
        raise click.UsageError(f"--plot: {plot}: a picture ends in {' or '.join(formats)}")
    for path, option in ((plot, "--plot"), (table, "--csv")):
        if path is not None:
            check_writable(path, option)


def _summary(movement: Gesture, playing: KeyframeMotion, speed: float) -> str:
    """Return the duration of a movement as text, and whether the joints' speed limits make it longer than planned."""
    frames = movement.keyframes
    wanted = (frames[-1].time - frames[0].time) / speed
    slower = (
        f" (not {wanted:.1f} s: limited by the speed of its joints)" if playing.duration > wanted * 1.01 + 0.01 else ""
    )
    return (
        f"{movement.name}: {len(frames)} keyframes in {playing.duration:.1f} s{slower}; "
        f"before that to its first pose, at {degrees_text(RUN_IN_SPEED)}/s at most"
    )


def _goal_curves(playing: KeyframeMotion) -> Curves:
    """Return the curve of planned angles of each joint in the movement."""
    times = [playing.duration * point / CURVE_POINTS for point in range(CURVE_POINTS + 1)]
    angles = [playing.at(time) for time in times]
    return {joint: (times, [each[joint] for each in angles]) for joint in playing.joints}


def _measured_curves(samples: Sequence[JointSample], what: str) -> Curves:
    """Return the curve of each joint of the recorded ``samples``; ``what`` is "goal" or "position"."""
    joints = dict.fromkeys(sample.joint for sample in samples)
    return {
        joint: (
            [sample.time for sample in samples if sample.joint == joint],
            [getattr(sample, what) for sample in samples if sample.joint == joint],
        )
        for joint in joints
    }


def _draw_plot(
    path: Path, title: str, goals: Curves, limits: Mapping[str, JointLimits], measured: Curves | None
) -> None:
    drawing = _import_plotting()
    _write_file(path, lambda: drawing.draw_move(path, title, goals, limits, measured=measured))


def _import_plotting() -> ModuleType:
    """Import the plotting module on first use. Raises click.UsageError if it is not installed."""
    try:
        from missions.plugins.pictures import moves_plot as plot  # noqa: PLC0415
    except ImportError as error:
        raise click.UsageError(f"--plot needs matplotlib ({error})\n  try: pip install 'missiontree[plots]'") from error
    return plot


def _write_file(path: Path, write: Callable[[], None]) -> None:
    try:
        write()
    except OSError as error:
        raise click.UsageError(f"{path}: {error.strerror}") from error
    click.echo(f"wrote {path}", err=True)
