"""``mission teleop``: drive a robot by hand, with the keys of a terminal or with a game pad."""

import os
import signal
import sys
import termios
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from threading import Event

import click

from config.library import DEFAULT_WORLD, find_file
from config.units import si_value
from config.world import load_world
from drivers.api import Base, Head, ignore
from drivers.clock import Clock, SystemClock
from drivers.errors import NotConnected
from missions.assembly.assemble import assemble
from missions.assembly.assembled_robot import CONNECT_TIMEOUT
from missions.assembly.part_factory import Hooks, Overrides
from missions.cli.keys import KeyReader, interruptible
from missions.cli.leash import watch_outputs
from missions.cli.names import ROBOT, WORLD
from missions.cli.origin import OTHER_SIMULATED_ROBOT, robot_file
from missions.cli.outputs import check_writable
from missions.cli.printable import overwrite_line
from missions.cli.root import SUCCESS
from missions.control.holders import hold_robot
from missions.control.pilot import MAX_SHARE, MIN_SHARE, Pilot
from missions.library.drivers import load_robot
from missions.plugins.setup.head_connection import DEFAULT_HEAD, head_keys, head_option
from missions.plugins.teleop import FIRST_PAD, hand_driving, pad
from missions.plugins.teleop.hand_driving import LineDelay, drive_by_hand
from missions.plugins.teleop.pad import load_layouts, pads_file, save_layout
from missions.plugins.teleop.teaching import PadTeacher

# The line between a person's keyboard and this program: whether it may be long, and how late it is.

RELAYS: Mapping[str, str] = {"TMUX": "tmux", "STY": "screen", "ZELLIJ": "zellij"}
"""Terminal multiplexers, by an environment variable that is set inside them.

A multiplexer answers queries in place of a remote terminal, so the delay to that terminal cannot be measured.
"""

RELAY_PROGRAMS = ("tmux", "screen", "zellij", "mosh-server")
REMOTE_PROGRAMS = ("sshd", "dropbear", "telnetd", "in.telnetd", "ttyd", "gotty")
REMOTE_VARIABLES = ("SSH_CONNECTION", "SSH_TTY")

LAST_ANSWERS_TIMEOUT = 0.6
"""Seconds to wait at the end for the terminal's last answers to queries; the shell would read later ones as keys."""


@contextmanager
def measure_line(
    descriptor: int, clock: Clock, *, allow_unknown: bool = False
) -> Iterator[tuple[LineDelay, Callable[[Callable[[float], str]], None]]]:
    """Measure the delay of the terminal behind ``descriptor`` while the context is entered.

    Yield the measurement, and a function to call at the end: it waits for the terminal's last answers, given a function
    that reads keys. With ``allow_unknown``, keys drive even if the delay is unknown.
    """
    programs = [*ancestors(os.getpid())]
    relay = _find_relay(programs)
    remote = bool(relay) or any(map(os.environ.get, REMOTE_VARIABLES)) or _has_program(programs, REMOTE_PROGRAMS)
    terminal = os.open(os.ttyname(descriptor), os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)

    def write(text: str) -> None:
        with suppress(OSError):  # a blocked line does not answer either, which is measured
            os.write(terminal, text.encode("ascii"))

    def size() -> tuple[int, int]:
        with suppress(OSError):
            columns, rows = os.get_terminal_size(descriptor)
            if columns > 0 and rows > 0:
                return columns, rows
        return 80, 24

    line = LineDelay(write, clock, size, remote=remote, relay=relay, allow_unknown=allow_unknown)

    def settle(typed: Callable[[float], str]) -> None:
        until = clock.now() + LAST_ANSWERS_TIMEOUT
        while line.has_open_queries and clock.now() < until:
            if typed(0.05) == "end":
                Event().wait(0.05)  # the terminal has closed, or Ctrl-D was pressed
        with suppress(termios.error):
            termios.tcflush(descriptor, termios.TCIFLUSH)

    try:
        yield line, settle
    finally:
        os.close(terminal)


def ancestors(process: int, folder: Path = Path("/proc")) -> Iterator[str]:
    """Yield the names of the parent processes, the nearest first; none without /proc."""
    while process > 1:
        try:
            text = (folder / str(process) / "stat").read_text(encoding="utf-8", errors="replace")
            name, _, rest = text.partition("(")[2].rpartition(")")
            process = int(rest.split()[1])
        except (OSError, ValueError, IndexError):
            return
        yield name


def _find_relay(programs: list[str]) -> str:
    """Return the name of the program, such as tmux, that answers in place of the terminal; empty if there is none.

    It is found by an environment variable, or among the parent ``programs``.
    """
    found = next((name for variable, name in RELAYS.items() if os.environ.get(variable)), "")
    return found or next((each for each in RELAY_PROGRAMS if _has_program(programs, (each,))), "")


def _has_program(programs: list[str], names: tuple[str, ...]) -> bool:
    return any(program.lower().startswith(names) for program in programs)


SHOW_INTERVAL = 0.1
"""Seconds between two updates of the status line: a slow connection could not transmit more."""


def _parse_share(ctx: click.Context, option: click.Parameter, value: str) -> float:
    """Convert an option value such as 30 % to a share (0.3). Raises click.BadParameter."""
    try:
        share = si_value(value, "share")
    except ValueError as error:
        raise click.BadParameter(str(error), ctx=ctx, param=option) from error
    if not MIN_SHARE <= share <= MAX_SHARE:
        raise click.BadParameter(f"'{value}' is not within {MIN_SHARE:.0%} and {MAX_SHARE:.0%}", ctx=ctx, param=option)
    return share


@click.command(epilog="Example: mission teleop --robot turtlebot2 --speed 30%")
@click.option("--robot", type=ROBOT, help="Robot to drive (name or file); it moves. Without it, a simulated one.")
@click.option("--simulate", is_flag=True, help="Drive a simulated robot, even with --robot.")
@click.option("--world", type=WORLD, help="World of a simulated robot (name or file).")
@click.option("--port", metavar="PATH", help="Port of the base, instead of that in the robot file.")
@head_option
@click.option(
    "--speed",
    "pace",
    default="50%",
    show_default=True,
    metavar="SHARE",
    callback=_parse_share,
    help="Initial speed, as a share of the robot's limits.",
)
@click.option(
    "--pad",
    "node",
    is_flag=False,
    flag_value=FIRST_PAD,
    metavar="[DEVICE]",
    help="Drive with a game pad: the first one found, or that at /dev/input/event...",
)
@click.option(
    "--teach-pad",
    "taught",
    is_flag=False,
    flag_value=FIRST_PAD,
    metavar="[DEVICE]",
    help="Teach the buttons of a game pad, once per model; no robot is opened.",
)
@click.option(
    "--unknown-delay",
    is_flag=True,
    help="Drive even if the delay of the line cannot be measured, as in tmux over SSH.",
)
def command(
    robot: str | None,
    simulate: bool,
    world: str | None,
    port: str | None,
    head: str,
    pace: float,
    node: str | None,
    taught: str | None,
    unknown_delay: bool,
) -> int:
    """Drive a robot by hand: hold a key to drive, release it to stop. Works over SSH.

    Keys do not drive if the round trip of the connection exceeds 0.5 s. Without --robot the robot is simulated, as with
    `mission run`. The limits and reflexes of the robot file apply. The robot is left at rest however the command ends,
    even if the line breaks.
    """
    if taught is not None:
        return _teach_pad(taught, SystemClock())
    virtual = simulate or robot is None
    if virtual and port is not None:
        raise click.UsageError("--port names a real port, which is used only with --robot NAME and without --simulate")
    if not virtual and world is not None:
        raise click.UsageError("--world is for a simulated robot: add --simulate, or leave out --world")
    if node is None and not sys.stdin.isatty():
        raise click.UsageError("the keys need a terminal; or drive with a game pad: --pad")
    wishes = Overrides(
        world=load_world(find_file("worlds", world or DEFAULT_WORLD)) if virtual else None,
        ports={} if port is None else {"base": port},
    )
    clock = wishes.clock()
    with ExitStack() as open_things:
        open_things.enter_context(interruptible())
        open_things.enter_context(watch_outputs((sys.stdout,), lambda _: os.kill(os.getpid(), signal.SIGTERM)))
        held = None
        if node is not None:
            held = open_things.enter_context(closing(pad.make_pad(node, clock)))
            held.open()
        base, turned = open_things.enter_context(_open_robot(robot, head, wishes, clock))
        click.echo(hand_driving.KEYS_HELP if held is None else pad.PAD_HELP)
        typed: Callable[[float], str] = _pause
        line = None
        if sys.stdin.isatty():
            if sys.stdout.isatty():
                open_things.callback(click.echo)  # below the status line
            terminal = sys.stdin.fileno()
            line, settle = open_things.enter_context(measure_line(terminal, clock, allow_unknown=unknown_delay))
            typed = open_things.enter_context(KeyReader(terminal, line.on_answer)).read
            open_things.callback(settle, typed)
        drive_by_hand(Pilot(base, turned, speed_share=pace), typed, held, clock, _make_line_display(clock), line)
    return SUCCESS


def _teach_pad(node: str, clock: Clock) -> int:
    """Ask a person to press the controls of a game pad one by one, and save the button layout found.

    Return the exit code. Raises NotConnected and TeachingError.
    """
    if node == FIRST_PAD:
        found = pad.find_pads()
        if len(found) > 1:
            cure = f"mission teleop --teach-pad {found[0]}  (or {', '.join(found[1:])})"
            raise click.UsageError(f"--teach-pad: several game pads are plugged in\n  try: {cure}")
        node = pad.find_pad()
    load_layouts()  # before any questions: with a damaged file, the layout could not be saved
    pads_file().parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    check_writable(pads_file(), "--teach-pad")
    with ExitStack() as open_things:
        open_things.enter_context(interruptible())
        raw = open_things.enter_context(closing(pad.Pad(node, clock)))
        model = raw.identify()
        if model is None:
            raise NotConnected(
                f"pad: {node}: the kernel does not know the model of this pad", hint="ls -l /dev/input/by-id"
            )
        click.echo(f"{model.key}; nothing moves. Release all controls, then follow the instructions. Ctrl-C cancels.")
        spans, values = raw.read_axes(model)
        layout = PadTeacher(raw, spans, values, clock, click.echo, _pause).teach()
        path = save_layout(model.key, layout)
        click.echo(f"saved in {path} for all pads of this model: mission teleop --pad {node}")
    return SUCCESS


@contextmanager
def _open_robot(name: str | None, head: str, overrides: Overrides, clock: Clock) -> Iterator[tuple[Base, Head | None]]:
    """Open the base of a robot and its ``head``, if any, wait for the base, and close them at the end.

    Raises NotConnected, with the reason, after ``CONNECT_TIME``.
    """
    config = load_robot(robot_file(name, other=OTHER_SIMULATED_ROBOT))
    if config.base is None:
        raise click.UsageError(f"{config.name} has no base")
    if head != DEFAULT_HEAD:
        head_keys(config, head)
    audience = Hooks(ignore, ignore, click.echo, ignore, ignore)
    robot = assemble(config, frozenset({"base", head}), clock, overrides, audience)
    base = robot.robot.base
    with hold_robot(config.name, simulated=overrides.world is not None):
        try:
            robot.open()
            begun = clock.now()
            while not (health := base.health()).online:
                if clock.now() - begun > CONNECT_TIMEOUT:
                    raise NotConnected(health.detail, hint=health.hint)
                _pause(0.02)
            yield base, robot.robot.with_named_parts({DEFAULT_HEAD: head}).head_part
        finally:
            for problem in robot.close():
                click.echo(problem, err=True)


def _pause(seconds: float) -> str:
    """Wait ``seconds`` and return an empty text, which means no key: used without a terminal."""
    Event().wait(seconds)
    return ""


def _make_line_display(clock: Clock) -> Callable[[str], None]:
    """Return a function that replaces the status line if it has changed, at most every ``SHOW_INTERVAL``."""
    shown, at = "", -SHOW_INTERVAL

    def show(line: str) -> None:
        nonlocal shown, at
        if line != shown and clock.now() - at >= SHOW_INTERVAL and sys.stdout.isatty():
            shown, at = line, clock.now()
            overwrite_line(line)

    return show
