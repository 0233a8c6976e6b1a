"""``mission servo record``: record a movement by hand."""

from pathlib import Path

import click

from config.library import shipped_files
from config.yaml_writer import gesture_text
from drivers.api import Joints
from drivers.clock import Clock
from drivers.servos.models import MODELS
from missions.cli.commands import SharingCommand
from missions.cli.numbers import QuantityInUnit
from missions.cli.outputs import check_writable, save
from missions.cli.root import FAILURE, SUCCESS
from missions.library.moves.record import JointRecording
from missions.plugins.setup.servo.connections import hold_option, open_arm, require_terminal, show_line, wait_for_end
from missions.plugins.setup.servo.target import ServoTarget, target_options


@click.command(cls=SharingCommand, epilog="Example: mission servo record my_hello --joint elbow --seconds 5")
@target_options
@click.argument("name")
@click.option("--joint", "names", multiple=True, metavar="JOINT", help="Joint or group to record; repeatable; "
              "by default all.")  # fmt: skip
@click.option("--seconds", type=QuantityInUnit("s", 0.1), metavar="N", help="Duration; by default until Enter.")
@click.option("-o", "--output", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE", help="Output "
              "file; by default NAME.yaml.")  # fmt: skip
@click.option("--force", is_flag=True, help="Replace an existing file.")
@hold_option
def record(
    target: ServoTarget, name: str, names: tuple[str, ...], seconds: float | None, output: Path | None, force: bool,
    yes: bool,
) -> int:  # fmt: skip
    """Record a movement by hand as a gesture.

    Hold the arm and press Enter; then its torque goes off, and the movement of the arm is recorded. Enter ends the
    recording, Ctrl-C discards it; either way the arm comes to rest. Without a terminal joints with torque need --yes.
    """
    require_terminal(seconds)
    path = Path(f"{name}.yaml") if output is None else output
    if output is None and name in shipped_files("gestures"):
        raise click.UsageError(f"'{name}' is a gesture that ships with MissionTree: choose another name")
    if path.exists() and not force:
        raise click.UsageError(f"{path} already exists: --force replaces it, -o FILE writes another")
    check_writable(path, "NAME" if output is None else "-o")
    with open_arm(target) as arm:
        chosen = arm.reach.resolve(names)
        recording = JointRecording({joint: MODELS[arm.config.joints[joint].model].tick for joint in chosen})
        arm.wait_for_reports(chosen)
        arm.confirm_limp(chosen, yes=yes)
        arm.joints.relax(chosen)
        click.echo(f"torque is off: {', '.join(chosen)}\nmove them by hand; Enter ends it", err=True)
        _record(arm.joints, recording, arm.clock, seconds)
    gesture = recording.gesture(name, f"Recorded by hand, {recording.seconds:.1f} s.")
    if not save(path, gesture_text(gesture, str(path))):
        return FAILURE
    click.echo(
        f"{path}: {gesture.keyframes[-1][0]:.1f} s of {', '.join(chosen)}, "
        f"{len(gesture.keyframes)} keyframes of {len(recording.snapshots)} readings"
    )
    robot = "" if target.robot is None else f" --robot {target.robot}"
    click.echo(f"  try: mission servo play {path} --dry-run{robot}", err=True)
    return SUCCESS


def _record(joints: Joints, recording: JointRecording, clock: Clock, seconds: float | None) -> None:
    """Record the joints' positions until the user ends it or ``seconds`` are over."""
    with wait_for_end(clock, seconds) as over:
        while not over():
            recording.add(joints.states(), clock.now())
            show_line(f"{recording.seconds:5.1f} s, {len(recording.snapshots)} readings")
