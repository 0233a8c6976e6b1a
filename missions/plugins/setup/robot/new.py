"""``mission robot new``: wizard that creates a robot file from connected devices; can be interrupted and continued."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from config.defaults import DEFAULTS_FILE, config_folder, load_defaults, remove_default, set_default
from config.diagnostics import InvalidFileError, SourceText
from config.file_io import save_file
from config.library import UnknownNameError, find_file, shipped_files
from config.robot import RobotConfig
from config.yaml_edit import NotEditableError
from config.yaml_writer import write_new, yaml_word
from drivers.api.driver import Driver
from drivers.errors import DriverError
from drivers.finding.machine import HostMachine
from drivers.finding.port_probe import EXTRA_TIMEOUT
from drivers.servos.declared import DynamixelKeys
from missions.cli.keys import interruptible
from missions.cli.names import ROBOT
from missions.cli.outputs import check_writable, report_write_errors
from missions.cli.root import SUCCESS
from missions.library.drivers import DriverTable, load_robot, parse_robot
from missions.library.folders import state_folder
from missions.library.shipped import load_mission
from missions.library.target import target_of
from missions.plugins.setup.ports import root_option
from missions.plugins.setup.robot.device_scan import ProbedDevice, scan_devices
from missions.plugins.setup.robot.dialogue import Dialogue
from missions.plugins.setup.robot.part_selection import choose_parts, choose_reference
from missions.plugins.setup.robot.part_trials import try_camera, try_head
from missions.plugins.setup.robot.parts import RobotPart, ask_figures, robot_text, udev_rules
from missions.plugins.setup.robot.servos import adopt_limits, assign_ids, find_limits, name_joints, offer_calibration

# First mission of a new robot.

FIRST_MISSIONS: Sequence[tuple[str, Mapping[str, str]]] = (
    ("greet", {}),
    ("square_3m", {}),
    ("wave", {}),
    ("wave", {"gesture": "hello"}),
    ("wave", {"gesture": "arm_wave"}),
    ("look_around", {}),
)
"""Missions with params; the first one that a new robot can run is suggested to the user."""


def suggest_mission(config: RobotConfig) -> str:
    """Return a mission that the robot can run, with its options as typed; empty if no ``FIRST_MISSIONS`` can run."""
    for mission, params in FIRST_MISSIONS:
        with suppress(InvalidFileError, UnknownNameError):
            load_mission(mission, params=params, robot=target_of(config))
            return " ".join([mission, *(f"--param {name}={value}" for name, value in params.items())])
    return ""


# ``mission robot use``.


@click.command(epilog="Example: mission robot use turtlebot2_arm")
@click.argument("name", required=False, type=ROBOT)
@click.option("--none", "no_robot", is_flag=True, help="Remove the setting of this computer's own robot.")
def use(name: str | None, no_robot: bool) -> int:
    """Make a robot this computer's own: NAME is a name or a file.

    `--robot mine` selects it in every command, and `mission run greet --robot mine` moves it. Commands without --robot
    simulate it. --none undoes that; the robot file stays.
    """
    if no_robot == (name is not None):
        raise click.UsageError("name a robot or add --none, not both")
    if name is None:
        return _forget_robot()
    path = find_file("robots", name)
    config = load_robot(path)
    stored_name = name if name in shipped_files("robots") or not Path(name).is_file() else str(path.resolve())
    try:
        with report_write_errors(config_folder() / DEFAULTS_FILE, "NAME"):
            kept = set_default("robot", yaml_word(stored_name))
    except NotEditableError as error:
        raise click.UsageError(str(error)) from error
    click.echo(f"{stored_name} is this computer's robot now: {kept}")
    mission = suggest_mission(config)
    click.echo(f"  next: mission run {mission} --robot mine" if mission else "  next: mission robot check")
    return SUCCESS


def _forget_robot() -> int:
    """Remove the setting of this computer's own robot."""
    before = load_defaults().robot
    if not before:
        click.echo("no default robot is set on this computer")
        return SUCCESS
    try:
        with report_write_errors(config_folder() / DEFAULTS_FILE, "--none"):
            kept = remove_default("robot")
    except NotEditableError as error:
        raise click.UsageError(str(error)) from error
    click.echo(f"{before} is no longer this computer's robot: {kept}")
    return SUCCESS


MAX_NAME_LENGTH = 64
"""Maximum number of characters of a robot name."""


@click.command(epilog="Example: mission robot new --yes")
@click.option("--yes", is_flag=True, help="Take the default of each question: nothing moves, no servo is changed, "
              "this computer's robot stays.")  # fmt: skip
@click.option("--fresh", is_flag=True, help="Discard the saved answers.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Output file, instead of one in the folder of your robots.",
)
@root_option
def new(yes: bool, fresh: bool, output: Path | None, root: Path) -> int:
    """Create a robot file: connected devices, parts, names, limits, trims, camera.

    Each question has its default in round brackets. Ctrl-C interrupts the dialogue; the same command continues it.
    Nothing moves, and nothing is written to a servo, without a question of its own.
    """
    talk = Dialogue(state_folder() / "robot_new.json", yes=yes)
    if fresh:
        talk.forget_answers()
    try:
        with interruptible():
            return run_dialogue(talk, HostMachine(root), output)
    except (click.Abort, KeyboardInterrupt):
        kept = "your answers are saved; `mission robot new` continues, --fresh starts over"
        click.echo(f"\n{kept if talk.is_saved else 'no answers are saved'}", err=True)
        raise


def run_dialogue(
    talk: Dialogue, machine: HostMachine, output: Path | None, *, extra_timeout: float = EXTRA_TIMEOUT
) -> int:
    """Ask all questions of `mission robot new`, and write the robot file; return the exit code."""
    if talk.has_answers:
        talk.print("continuing with your saved answers; --fresh starts over")
    name = talk.ask_text("name", "what is the name of the robot?", "my_robot", lambda said: _check_name(said, output))
    path = output or config_folder() / "robots" / f"{name}.yaml"
    if output is None:
        with report_write_errors(path, "-o"):
            path.parent.mkdir(parents=True, exist_ok=True)
    check_writable(path, "-o")
    table = DriverTable()
    desk, found = scan_devices(talk, machine, table, extra_timeout=extra_timeout)
    model = choose_reference(talk, found)
    if talk.yes and model is None and not found and not desk.cameras:
        raise click.UsageError("no device of a robot found: connect it, or leave out --yes to name its parts")
    parts = choose_parts(talk, table, desk, found, model)
    summary = talk.ask_text("summary", "what is it, in one line?", f"{', '.join(parts) or 'no parts'}.")
    config = _fill_sections(talk, machine, name, summary, parts, extra_timeout)
    _try_parts(talk, machine, parts, config, extra_timeout)
    text = robot_text(name, summary, _sections_of(parts))
    config = parse_robot(SourceText(str(path), text), path)
    talk.print("", *text.splitlines(), "")
    if not talk.ask_yes_no("write", f"write this to {path}?", default=True):
        talk.forget_answers("write")
        raise click.Abort
    used = _ask_default_robot(talk, found)
    return _write_files(talk, path, text, parts, config, is_default=used)


def _ask_default_robot(talk: Dialogue, devices: Sequence[ProbedDevice]) -> bool:
    """Ask whether to make the new robot this computer's own; return the answer.

    It asks nothing and returns False with --yes, or if no device is connected.
    """
    if talk.yes or not any(each.about or each.units for each in devices):
        return False
    return talk.ask_yes_no("use", "make it this computer's robot?", default=True)


def _check_name(name: str, output: Path | None) -> None:
    if not name.replace("-", "_").isidentifier():
        raise ValueError(f"'{name:.40}' is not a valid name: letters, digits and _")
    if len(name) > MAX_NAME_LENGTH:
        raise ValueError(f"a name has at most {MAX_NAME_LENGTH} characters")
    if name in shipped_files("robots"):
        raise ValueError(f"{name} ships with MissionTree: choose another name")
    path = output or config_folder() / "robots" / f"{name}.yaml"
    if path.exists():
        raise ValueError(f"{path} already exists: choose another name")


def _sections_of(parts: Mapping[str, RobotPart]) -> dict[str, tuple[Driver, dict[str, Any]]]:
    return {kind: (part.driver, part.section) for kind, part in parts.items()}


def _fill_sections(
    talk: Dialogue, machine: HostMachine, name: str, summary: str, parts: dict[str, RobotPart], extra_timeout: float
) -> RobotConfig:
    """Ask for the values of each part's section until the robot file is valid; return the robot.

    If a part stays invalid, such as a neck without an arm, the user can leave it out. It is then deleted from
    ``parts``.
    """
    whole: dict[str, RobotPart] = {}
    for kind in sorted(parts, key=lambda kind: (bool(parts[kind].driver.needs), list(parts).index(kind))):
        part, before, last_error = parts[kind], dict(parts[kind].section), ""
        while True:
            if issubclass(part.driver.keys, DynamixelKeys):
                _ask_servos(talk, machine, kind, part, max(extra_timeout, 0.004))
                if not part.section["joints"]:
                    talk.print(f"the {kind} is left out: none of its servos has a known model")
                    del parts[kind]
                    break
            ask_figures(talk, kind, part)
            try:
                parse_robot(SourceText(name, robot_text(name, summary, _sections_of({**whole, kind: part}))))
                whole[kind] = part
                break
            except InvalidFileError as error:
                if talk.yes:
                    raise
                talk.print(str(error))
                again, last_error = last_error == str(error), str(error)
            if again and talk.ask_yes_no(f"{kind}?out", f"the same error again: leave the {kind} out?", default=True):
                del parts[kind]
                break
            talk.print(f"the questions about the {kind} are repeated")
            for ending in ". ?":
                talk.forget_answers(f"{kind}{ending}")
            part.section = dict(before)
    return parse_robot(SourceText(name, robot_text(name, summary, _sections_of(parts))))


def _ask_servos(talk: Dialogue, machine: HostMachine, arm: str, part: RobotPart, extra_timeout: float) -> None:
    """Ask for IDs, calibration and names of an arm's servos."""
    if part.port is None:
        name_joints(talk, arm, part)
        return
    path = str(machine.local_path(part.port.path))
    assign_ids(talk, arm, part, path, extra_timeout=extra_timeout)
    offer_calibration(talk, arm, part, path, extra_timeout=extra_timeout)
    name_joints(talk, arm, part)
    adopt_limits(talk, arm, part, path, extra_timeout=extra_timeout)


def _try_parts(
    talk: Dialogue, machine: HostMachine, parts: Mapping[str, RobotPart], config: RobotConfig, extra_timeout: float
) -> None:
    """Find limits, directions and trims of a new robot's parts by moving them.

    If that fails for a part, the error is printed, and the part is skipped.
    """
    paths = {kind: str(machine.local_path(part.port.path)) for kind, part in parts.items() if part.port is not None}
    try:
        for name, part in parts.items():
            if part.driver.kind == "arm" and name in paths:
                find_limits(talk, name, part, config, paths[name], extra_timeout=max(extra_timeout, 0.004))
        for name, part in parts.items():
            if part.driver.kind == "head":
                needs = part.driver.needs or (name,)
                there = machine.local_path(f"/dev/i2c-{getattr(config.sections[name].keys, 'bus', '')}").exists()
                reached = {kind: path for kind, path in paths.items() if kind in needs}
                try_head(talk, parts, config, reached, name=name, reachable=there)
    except DriverError as error:
        talk.print(f"{error}", f"  try: {error.hint}" if error.hint else "  left out")
    camera = config.sections.get("camera")
    if camera is not None and camera.driver.checkup:
        try_camera(talk, camera)


def _write_files(
    talk: Dialogue, path: Path, text: str, parts: Mapping[str, RobotPart], config: RobotConfig, *, is_default: bool
) -> int:
    """Write the robot file and udev rules, and print the next commands; return the exit code."""
    name = config.name
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        write_new(path, text)
    except FileExistsError as error:
        raise click.UsageError(str(error)) from error
    talk.print(f"wrote {path}")
    rules = udev_rules(name, {kind: part.port for kind, part in parts.items() if part.port is not None})
    if rules:
        beside = path.with_suffix(".rules")
        save_file(beside, rules)
        talk.print(f"wrote {beside}: names, permissions and speed of its ports; to install it:")
        talk.print(f"  sudo cp {beside} /etc/udev/rules.d/99-{name}.rules && sudo udevadm control --reload")
    called = name if path.parent == config_folder() / "robots" else str(path)
    if is_default:
        with suppress(NotEditableError):
            set_default("robot", called if called == name else str(path.resolve()))
    elif (mine := load_defaults().robot) != called:
        talk.print(f"this computer's robot stays {mine or 'none'}; to change that: mission robot use {called}")
    talk.forget_answers()
    talk.print("next:", f"  mission robot check {called}", f"  mission doctor --robot {called}")
    talk.print(*(f"  {line}" for line in _calibration_commands(config, called)))
    mission = suggest_mission(config)
    if mission:
        talk.print(f"  mission run {mission} --robot {called} --simulate   (nothing moves)")
        talk.print(f"  mission run {mission} --robot {called}")
    return SUCCESS


def _calibration_commands(config: RobotConfig, called: str) -> Iterator[str]:
    """Yield the calibration command for each arm that has joints without limits in the robot file.

    ``called`` is the name or path of the robot file in these commands.
    """
    arms = {part: section for part, section in config.sections.items() if section.driver.kind == "arm"}
    for part, section in arms.items():
        keys = section.keys
        if not isinstance(keys, DynamixelKeys) or getattr(keys, "calibration", False):
            continue
        if any(joint.limits is None and joint.ticks is None for joint in keys.joints.values()):
            command = "home" if section.driver.name == "feetech" else "calibrate"
            arm = f" --arm {part}" if len(arms) > 1 else ""
            yield f"mission servo {command} --robot {called}{arm}   (the limits of its joints, by hand)"
