"""``mission head`` as its users meet it: by options, by arrow keys on a terminal, and its change to a robot file."""

import json
import os
import pty
import re
import signal
import termios
from collections.abc import Callable
from functools import partial
from math import radians
from pathlib import Path

import click
import pytest

from config.library import find_file
from drivers.arduino.declared import ArduinoKeys
from drivers.arduino.virtual import VirtualRodney
from drivers.errors import BadRequest
from drivers.virtual.patient_clock import PatientClock
from drivers.virtual.terminal import PseudoTerminal
from missions.assembly.learnt_delays import MIN_SAMPLES
from missions.cli.keys import KeyReader, interruptible
from missions.library.drivers import load_robot
from missions.plugins.setup.head import trim_by_hand
from tests.missions.command import Outcome, command
from tests.waiting import wait_until

Mission = Callable[..., Outcome]

SHIPPED = find_file("robots", "turtlebot2_arm")


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    """The command, run in a folder where ``mine.yaml`` is a robot of one's own."""
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text(SHIPPED.read_text())
    return lambda *arguments: command(capsys, "head", *arguments)


def test_head_look_reports_angles_limited_by_its_range(mission: Mission) -> None:
    outcome = mission("look", "--pan", "100", "--tilt", "5")
    assert (outcome.code, outcome.out) == (0, "looks at +80, +5 deg, the limit for +100, +5 deg\n")


def test_where_names_the_joints_with_their_angles_limits_and_trims(mission: Mission) -> None:
    outcome = mission("where", "--json", "--robot", "mine.yaml", "--simulate")
    assert "its board does not report its pose" in outcome.err
    # Its board has just been switched on: its sketch has put the servos at 90 and 120 degrees, and tilt is flipped.
    assert json.loads(outcome.out) == {
        "head_pan": {"from": -80.0, "to": 80.0, "trim": 0.0, "angle": 0.0},
        "head_tilt": {"from": -60.0, "to": 20.0, "trim": 0.0, "angle": pytest.approx(-30.0)},
    }


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> PatientClock:
    """The command's clock, which waits for virtual boards as if they were simulated."""
    clock = PatientClock()
    monkeypatch.setattr("missions.assembly.part_factory.SystemClock", lambda: clock)
    return clock


def stands(board: VirtualRodney, clock: PatientClock, degrees: tuple[int, int]) -> bool:
    return (board.angle(0, clock.now()), board.angle(1, clock.now())) == degrees


def test_head_does_not_jump_between_two_commands(mission: Mission, clock: PatientClock) -> None:
    board = VirtualRodney(tacho=True)
    terminal = PseudoTerminal("teensy", board, clock)
    terminal.open()
    try:
        at = ("--robot", "mine.yaml", "--port", terminal.path)
        for pan, tilt in ((20, 10), (20, -29), (-10, 0)):
            assert mission("look", *at, "--pan", str(pan), "--tilt", str(tilt)).code == 0
            wait_until(partial(stands, board, clock, (90 + pan, 90 - tilt)))  # to the last degree
            board.commands.clear()
            told = json.loads(mission("where", *at, "--json").out)
            assert (told["head_pan"]["angle"], told["head_tilt"]["angle"], board.commands) == (pan, tilt, [])
    finally:
        terminal.close()
    assert board.max_step <= 12 + 2


@pytest.mark.parametrize(
    "words", [("look", "--pan", "20"), ("center",), ("trim", "--pan", "1")], ids=lambda each: each[0]
)
def test_head_command_warns_of_an_unknown_board_before_motion(
    mission: Mission, clock: PatientClock, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    board, told = VirtualRodney(tacho=True), list[tuple[str, int]]()
    say = click.echo

    def noted(text: str = "", *, err: bool = False) -> None:
        told.append((text, len(board.commands)))
        say(text, err=err)

    terminal = PseudoTerminal("teensy", board, clock)
    terminal.open()
    try:
        monkeypatch.setattr("missions.plugins.setup.head.click.echo", noted)
        at = ("--robot", "mine.yaml", "--port", terminal.path)
        assert mission(*words, *at).code == 0
        warnings = [count for text, count in told if "the first movement may leap\n  try: keep clear of it now" in text]
        assert warnings == [0]
        told.clear()
        assert mission(*words, *at).code == 0
        assert not [text for text, _ in told if "may leap" in text]  # it was left where we know
    finally:
        terminal.close()


@pytest.mark.real_time
def test_the_delay_of_the_camera_is_found_while_the_head_looks_about(mission: Mission) -> None:
    outcome = mission("calibrate", "--seconds", "3")
    assert outcome.code == 0
    found = re.search(r"stamped (-?\d+) ms after their exposure \(one sigma (\d+) ms, (\d+) pairs\)", outcome.out)
    assert found is not None
    assert abs(int(found[1])) <= 50  # a virtual board and a drawn picture share one machine
    assert int(found[3]) >= MIN_SAMPLES


def test_head_trim_is_saved_on_request_without_other_changes(mission: Mission) -> None:
    before = Path("mine.yaml").read_text()
    outcome = mission("trim", "--robot", "mine.yaml", "--simulate", "--pan", "4", "--tilt", "-3.5")
    assert (outcome.code, Path("mine.yaml").read_text()) == (0, before)
    assert "--keep writes them" in outcome.out
    outcome = mission("trim", "--robot", "mine.yaml", "--simulate", "--pan", "4", "--tilt", "-3.5", "--keep")
    assert (outcome.code, outcome.out.splitlines()[-1]) == (
        0,
        "trimmed: pan +4 deg, tilt -3.5 deg; written to mine.yaml",
    )
    after = Path("mine.yaml").read_text()
    assert after.replace("{trim: 4 deg, ", "{").replace("{trim: -3.5 deg, ", "{") == before != after
    head = load_robot(Path("mine.yaml")).head
    assert isinstance(head, ArduinoKeys)
    assert (head.pan.trim, head.tilt.trim) == pytest.approx((radians(4), radians(-3.5)))


def test_head_trim_never_writes_a_shipped_robot_file(mission: Mission) -> None:
    before = SHIPPED.read_bytes()
    outcome = mission("trim", "--pan", "4", "--keep")
    assert (outcome.code, SHIPPED.read_bytes()) == (2, before)
    assert f"cp {SHIPPED} my_turtlebot2_arm.yaml" in outcome.err
    assert "mission head trim --robot my_turtlebot2_arm.yaml --keep" in outcome.err


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("trim",), 2, "the arrow keys need a terminal"),
        (("trim", "--pan", "50"), 3, "not within -45..45 deg"),
        (("look", "--pan", "nan"), 2, "'nan' is not an angle"),
        (("look", "--port", "/dev/nano"), 2, "--port needs --robot NAME"),
        (("where", "--robot", "bodiless.yaml"), 2, "bodiless has no head"),
    ],
)
def test_invalid_teleop_arguments_are_refused_with_a_reason(
    mission: Mission, arguments: tuple[str, ...], code: int, words: str
) -> None:
    Path("bodiless.yaml").write_text("robot: bodiless\n")
    outcome = mission(*arguments)
    assert outcome.code == code
    assert words in outcome.err


# --- by hand ----------------------------------------------------------------------------------------------------------


class Straightened:
    """A head that keeps its trims."""

    def __init__(self) -> None:
        self.trims = (0.1, -0.1)

    def skip_start_move(self) -> None:
        pass

    def trim(self, *, pan: float | None = None, tilt: float | None = None) -> tuple[float, float]:
        wanted = tuple(old if new is None else new for old, new in zip(self.trims, (pan, tilt), strict=True))
        if max(map(abs, wanted)) > radians(45):
            raise BadRequest("too much")
        self.trims = (wanted[0], wanted[1])
        return self.trims


def by_hand(typed: bytes, head: Straightened, signs: tuple[int, int] = (1, 1)) -> tuple[bool, list[str]]:
    """Type into a terminal at which the head is trimmed; return whether it was kept, and the lines shown."""
    shown: list[str] = []
    master, slave = pty.openpty()
    try:
        with KeyReader(slave) as keys:
            os.write(master, typed)
            return trim_by_hand(head, keys, signs, shown.append, lambda: ""), shown
    finally:
        os.close(master)
        os.close(slave)


def test_arrow_keys_trim_the_head_in_the_shown_direction() -> None:
    for signs in ((1, 1), (1, -1), (-1, 1)):
        head = Straightened()
        kept, shown = by_hand(b"\x1b[D\x1b[D\x1bOA\r", head, signs)
        assert kept
        assert head.trims == pytest.approx((0.1 + signs[0] * radians(2), -0.1 - signs[1] * radians(1)))
    assert "step 1" in shown[0]


def test_the_step_can_be_changed_and_the_trim_undone() -> None:
    head = Straightened()
    by_hand(b"0++\x1b[C-\x1b[B\r", head)
    assert head.trims == pytest.approx((-radians(5), radians(2)))


@pytest.mark.parametrize("ending", [b"q", b"\x1b", b"\x04"], ids=["q", "escape", "ctrl-d"])
def test_cancelled_trim_restores_the_previous_trims(ending: bytes) -> None:
    head = Straightened()
    kept, _ = by_hand(b"\x1b[D\x1b[A\x1b[1;2Cx" + ending, head)
    assert (kept, head.trims) == (False, (0.1, -0.1))


def test_trim_is_limited() -> None:
    head = Straightened()
    by_hand(b"++" + 20 * b"\x1b[D" + b"\r", head)
    assert radians(40) < head.trims[0] <= radians(45)


def test_terminal_is_restored_after_an_interrupt() -> None:
    master, slave = pty.openpty()
    try:
        before, handler = termios.tcgetattr(slave), signal.getsignal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt):
            _hang_up_while_reading(slave)
        assert termios.tcgetattr(slave) == before
        assert signal.getsignal(signal.SIGTERM) == handler
    finally:
        os.close(master)
        os.close(slave)


def _hang_up_while_reading(terminal: int) -> None:
    before = termios.tcgetattr(terminal)
    with interruptible(), KeyReader(terminal) as keys:
        assert termios.tcgetattr(terminal) != before
        assert keys.read(0.0) == ""
        os.kill(os.getpid(), signal.SIGTERM)
        keys.read(5.0)


def test_key_reader_joins_split_escape_sequences_and_ends_with_the_terminal() -> None:
    master, slave = pty.openpty()
    try:
        with KeyReader(slave) as keys:
            os.write(master, b"\x1b")
            assert keys._has_input(1.0)
            os.write(master, b"[")
            os.write(master, b"D")
            assert keys.read(1.0) == "left"
            os.close(master)
            assert keys.read(1.0) == "end"
    finally:
        os.close(slave)
