"""``mission doctor``: check the computer, connected devices, and each part of the robot."""

import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

import click

from config.defaults import DEFAULTS_FILE, config_folder, load_defaults
from config.diagnostics import InvalidFileError
from config.file_io import PRIVATE_MODE, save_file
from config.library import OWN_ROBOT, UnknownNameError, find_file
from config.robot import RobotConfig
from drivers.api.driver import Finding, failure
from drivers.clock import SystemClock, time_of_day
from drivers.finding.hardware_scan import scan_hardware
from drivers.finding.machine import HostMachine
from drivers.finding.machine_check import check_machine
from missions.cli.console import echo
from missions.cli.keys import interruptible
from missions.cli.names import ROBOT
from missions.cli.options import name_value_callback
from missions.cli.outputs import report_write_errors
from missions.cli.root import FAILURE, SUCCESS
from missions.library.drivers import load_robot
from missions.library.folders import checkup_file, state_folder
from missions.plugins.setup.checkup import PartFinding, check_folders, check_installation, check_robot
from missions.plugins.setup.doctor.movement_trials import try_movements
from missions.plugins.setup.doctor.report import anonymise, private_words, report_text

COMPUTER_PART = "computer"
"""Name under which findings on the computer are listed, instead of a part of the robot."""

VERDICT_STYLES = {"ok": "green", "warning": "yellow", "wrong": "bold red"}


@click.command(epilog="Example: mission doctor --robot turtlebot2_arm --report doctor.txt")
@click.option("--robot", type=ROBOT, help="Robot to check; by default this computer's own, if it has one.")
@click.option("--port", "ports", multiple=True, metavar="PART=PORT",
              callback=name_value_callback("base=/dev/ttyUSB0", empty=False),
              help="Port of a part, instead of the one in the robot file.")  # fmt: skip
@click.option("--move", is_flag=True, help="Try small movements, with a question before and after each.")
@click.option("--report", "file", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE",
              help="Also write a report for support questions, without names and serial numbers.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one line of JSON.")
@click.option("--root", type=click.Path(path_type=Path, file_okay=False, exists=True), default=Path("/"), metavar="DIR",
              help="Folder with a copy of another computer's /dev, /proc and /sys to examine.")  # fmt: skip
def command(robot: str | None, ports: dict[str, str], move: bool, file: Path | None, as_json: bool, root: Path) -> int:
    """Check this computer, its connected devices, and each part of the robot, at rest.

    Each line says ok, warning or wrong, and gives a command to try where one helps. Nothing moves without --move, and
    nothing is written to a device. Exit codes: 0 nothing is wrong, 1 something is wrong, 2 an error in the command or a
    file.
    """
    machine, (config, robot_finding) = HostMachine(root), _find_robot(robot)
    if unknown := sorted(set(ports) - set(config.sections if config else ())):
        raise click.UsageError(f"--port: the robot has no {' or '.join(unknown)}")
    if move and config is None:
        raise click.UsageError("--move needs a robot\n  try: mission doctor --move --robot NAME")
    found = list[PartFinding]()
    with interruptible():
        for each in _check_all(machine, config, robot_finding, robot or OWN_ROBOT, ports, found, move=move):
            if not as_json:
                _print_finding(each, new=not found or found[-1].part != each.part)
            found.append(each)
    if root == Path("/"):
        _save_for_studio(machine, config, found)
    return _finish(machine, config, found, file, as_json=as_json)


def _finish(
    machine: HostMachine, config: RobotConfig | None, found: list[PartFinding], file: Path | None, *, as_json: bool
) -> int:
    """Print the findings as JSON, or their totals as text; write the report to ``file``; return the exit code."""
    wrong = sum(each.finding.verdict == "wrong" for each in found)
    if as_json:
        findings = [{"part": each.part, **asdict(each.finding)} for each in found]
        click.echo(json.dumps({"robot": config.name if config else None, "ok": not wrong, "findings": findings}))
    else:
        warnings = sum(each.finding.verdict == "warning" for each in found)
        click.echo(f"{wrong} wrong, {warnings} warning{'s' * (warnings != 1)}, {len(found) - wrong - warnings} ok")
    if file is not None:
        with report_write_errors(file, "--report"):
            save_file(file, report_text(machine, found))
        click.echo(f"wrote {file}; read it before you send it", err=as_json)
    return FAILURE if wrong else SUCCESS


def _save_for_studio(machine: HostMachine, config: RobotConfig | None, found: list[PartFinding]) -> None:
    """Save the warnings and errors for the studio.

    Names that identify the user or the computer are replaced, because viewers of the studio may be strangers.
    """
    problems = [each for each in found if each.finding.verdict != "ok"]
    lines = [{"part": each.part, **asdict(each.finding)} for each in problems]
    content = {
        "at": time_of_day().isoformat(timespec="seconds"),
        "robot": config.name if config else "",
        "ailing": lines,
    }
    with suppress(OSError):  # no home or a full disk must not fail the check
        checkup_file().parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        save_file(checkup_file(), anonymise(json.dumps(content), private_words(machine)).encode(), PRIVATE_MODE)


def _find_robot(robot: str | None) -> tuple[RobotConfig | None, Finding]:
    """Return the named robot, or this computer's own robot if none is named, and a finding about it.

    The robot is None if this computer has none, or its file is invalid. Raises InvalidFileError, UnknownNameError for a
    named robot.
    """
    if robot is not None:
        config = load_robot(find_file("robots", robot))
        return config, Finding("robot", f"{config.name}: {', '.join(config.sections)}")
    fix = "mission robot use NAME, or: mission robot use --none"
    try:
        mine = load_defaults().robot
        if not mine:
            fix = "mission robot use NAME, or: mission robot new"
            return None, Finding("robot", "no default robot is set on this computer", fix=fix)
        config = load_robot(find_file("robots", OWN_ROBOT))
    except (UnknownNameError, InvalidFileError) as error:
        message = f"this computer's own robot, set in {config_folder() / DEFAULTS_FILE}, cannot be used: {error}"
        return None, failure("robot", message, fix)
    called = config.name if config.name == mine else f"{config.name} ({mine})"
    message = f"{called}, this computer's own, set in {config_folder() / DEFAULTS_FILE}: {', '.join(config.sections)}"
    return config, Finding("robot", message)


def _check_all(
    machine: HostMachine,
    config: RobotConfig | None,
    robot_finding: Finding,
    robot_name: str,
    ports: dict[str, str],
    found: list[PartFinding],
    *,
    move: bool,
) -> Iterator[PartFinding]:
    """Yield all findings as they are made; the caller appends each to ``found``, which later checks read."""
    clock, now = SystemClock(), time_of_day().timestamp()
    installed = Path(__file__).stat().st_mtime
    computer = check_machine(machine, scan_hardware(machine), now=now, installed_at=installed, folder=state_folder())
    yield from (PartFinding(COMPUTER_PART, finding) for finding in (*check_installation(), *check_folders(), *computer))
    yield PartFinding(COMPUTER_PART, robot_finding)
    if config is None:
        return
    move = move and _ask(f"{config.name} is going to move a little. Is there room, and are all hands off it?")
    yield from check_robot(config, robot_name, machine, clock, ports=ports, resets=move)
    if move:
        unwell = frozenset(each.part for each in found if each.finding.verdict == "wrong")
        yield from try_movements(config, robot_name, ports, faulty_parts=unwell, ask=_ask)


def _ask(question: str) -> bool:
    """Ask a yes/no question; at the end of the input the answer is no. Raises click.Abort at Ctrl-C."""
    try:
        return click.confirm(question, err=True)
    except click.Abort as error:
        if not isinstance(error.__context__, EOFError):
            raise
        click.echo("no answer: nothing moves", err=True)
        return False


def _print_finding(part_finding: PartFinding, *, new: bool) -> None:
    """Print a finding, and the command to try; before the first finding on a part (``new``), print the part's name."""
    if new:
        click.echo(part_finding.part)
    finding = part_finding.finding
    echo(f"  {finding.verdict:<8}", VERDICT_STYLES[finding.verdict], f"{finding.about}: {finding.message}".rstrip(": "))
    if finding.fix:
        click.echo(f"            try: {finding.fix}")
