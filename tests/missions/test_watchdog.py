"""Whatever a leaf does to the tick loop, it is named, the robot is kept still, and the run comes to an end."""

import json
import signal
from collections.abc import Callable
from pathlib import Path
from random import Random
from threading import Event

import pytest
from py_trees.common import Status

from behaviours.leaf import RUNNING, SUCCESS, Leaf
from behaviours.run import RunState
from drivers.api.kinds import KINDS
from drivers.clock import ManualClock, SystemClock
from drivers.errors import DeviceFault
from drivers.kobuki.virtual import VirtualKobuki
from drivers.virtual.terminal import PseudoTerminal
from missions.executive.events import Event as Told
from missions.executive.events import FaultRaised
from missions.executive.stream import EventStream
from missions.executive.watchdog import CHECK_INTERVAL, LoopState, Watchdog, WatchdogLimits
from missions.request import RunRequest
from missions.runner import Runner
from tests.machines import walk
from tests.missions.command import Process, command
from tests.waiting import wait_until

# --- one look at a time, on a clock that the test advances ------------------------------------------------------------


class Slow(Leaf):
    """Do within a tick what the test says."""

    tag = "slow"
    work_of_tick: Callable[[], Status] = staticmethod(lambda: RUNNING)

    def update(self) -> Status:
        return self.work_of_tick()


class Kennel:
    """A watchdog, what it watches, and what it did: parts kept still, what was told, and how it gave up."""

    def __init__(self, clock: ManualClock, *, still: Callable[[], None] | None = None) -> None:
        self.clock = clock
        self.run = RunState(clock)
        self.stilled = Event()
        self.kept: list[str] = []
        self.told: list[Told] = []
        self.word: str | None = None
        self.given_up: list[tuple[str, str]] = []
        self.dog = Watchdog(
            self.run,
            EventStream([self.told.append]),
            stop_actions={"base": still or (lambda: self.keep("base")), "arm": lambda: self.keep("arm")},
            first_signal=lambda: self.word,
            abandon=lambda result, reason: self.given_up.append((result, reason)),
        )
        self.dog.is_armed = True
        self.leaf = Slow("dawdle")
        self.leaf.run, self.leaf.scope, self.leaf.line = self.run, {}, 4

    def keep(self, part: str) -> None:
        self.kept.append(part)
        self.stilled.set()

    def pass_time(self, seconds: float) -> None:
        """Let time pass with the watchdog looking."""
        for _ in range(round(seconds / CHECK_INTERVAL)):
            self.clock.advance(CHECK_INTERVAL)
            self.dog.check()

    def hold(self, seconds: float, then: Status = RUNNING) -> Status:
        """Let the leaf hold a tick for so long."""

        def dawdle() -> Status:
            self.pass_time(seconds)
            return then

        self.leaf.work_of_tick = dawdle
        self.run.tick += 1
        status = self.leaf.execute_tick()
        self.run.record_heartbeat()
        return status

    def permitted(self) -> Status:
        """Ask for a permit, as a command does."""
        self.dog.permit()
        return SUCCESS

    @property
    def faults(self) -> list[str]:
        return [event.detail for event in self.told if isinstance(event, FaultRaised)]


def test_watchdog_stops_every_moving_part_but_not_the_voice() -> None:
    runner = Runner(RunRequest("greet", robot="turtlebot2_arm", simulate="fast", eyes="truth"))
    still = {kind.name for kind in KINDS.values() if kind.hold_still is not None and kind.name in runner.config.parts}
    assert "arm" in still
    assert runner.watchdog._stop_actions.keys() == still - {"voice"}


@pytest.fixture
def kennel(clock: ManualClock) -> Kennel:
    return Kennel(clock)


def test_quick_leaf_is_not_reported(kennel: Kennel) -> None:
    for _ in range(20):
        assert kennel.hold(0.1) is RUNNING
    assert (kennel.faults, kennel.kept) == ([], [])


def test_leaf_that_blocks_a_tick_is_reported_once(kennel: Kennel) -> None:
    assert kennel.hold(0.45) is RUNNING
    (fault,) = kennel.faults
    assert fault.startswith("dawdle (line 4) has held a tick for 0.")
    assert kennel.kept == []


def test_stalled_loop_stops_the_robot_twice(kennel: Kennel) -> None:
    assert kennel.hold(1.8) is RUNNING
    wait_until(lambda: len(kennel.kept) >= 4)
    kennel.hold(0.1)
    assert sorted(kennel.kept) == ["arm", "arm", "base", "base"]
    assert kennel.faults[-1].startswith("dawdle (line 4) has held up the robot for 0.5")


def test_each_stall_is_a_new_one(kennel: Kennel) -> None:
    kennel.hold(0.6)
    kennel.hold(0.1)
    kennel.hold(0.6)
    assert len([fault for fault in kennel.faults if "held up the robot" in fault]) == 2


def test_a_stall_outside_of_any_leaf_counts_too(kennel: Kennel) -> None:
    kennel.pass_time(0.6)
    assert kennel.stilled.wait(5.0)
    assert kennel.faults == ["the executive has held up the robot for 0.55 s: it is kept still"]


def test_hanging_device_blocks_neither_watchdog_nor_other_parts(clock: ManualClock) -> None:
    release = Event()

    def stuck() -> None:
        release.wait(10.0)

    kennel = Kennel(clock, still=stuck)
    kennel.hold(1.8)
    wait_until(lambda: kennel.kept.count("arm") == 2)
    release.set()


def test_stalled_leaf_gets_no_permit_until_its_tick_ends(kennel: Kennel) -> None:
    refused: list[str] = []

    def drive() -> Status:
        kennel.pass_time(0.6)
        try:
            kennel.dog.permit()
        except DeviceFault as error:
            refused.append(str(error))
        return RUNNING

    kennel.leaf.work_of_tick = drive
    kennel.run.tick += 1
    kennel.leaf.execute_tick()
    assert refused == ["kept still: dawdle (line 4) holds the tick"]
    kennel.dog.permit()  # what comes after it in the same tick may
    kennel.run.tick += 1
    kennel.leaf.work_of_tick = kennel.permitted
    assert kennel.leaf.execute_tick() is SUCCESS


def test_second_leaf_that_blocks_the_same_tick_gets_no_permit_either(kennel: Kennel) -> None:
    second = Slow("second")
    second.run, second.scope, second.line = kennel.run, {}, 5

    def drive() -> Status:
        kennel.dog.permit()
        kennel.pass_time(0.6)
        with pytest.raises(DeviceFault, match="kept still: second"):
            kennel.dog.permit()
        return RUNNING

    def block() -> Status:
        kennel.pass_time(0.9)
        return RUNNING

    second.work_of_tick, kennel.leaf.work_of_tick = drive, block
    assert [leaf.execute_tick() for leaf in (kennel.leaf, second)] == [RUNNING, RUNNING]
    assert kennel.faults[-1].startswith("second (line 5) has held up the robot for 1.")


def test_leaf_that_blocks_a_tick_for_seconds_fails(kennel: Kennel) -> None:
    assert kennel.hold(3.0, then=SUCCESS) is Status.FAILURE
    assert kennel.leaf.reason.startswith("dawdle (line 4): blocked the tick for 2.9")
    assert kennel.hold(0.1, then=SUCCESS) is SUCCESS


def test_loop_that_never_returns_is_abandoned(kennel: Kennel) -> None:
    kennel.hold(16.0)
    assert kennel.given_up[0] == ("failure", "dawdle (line 4): blocked the tick for over 15 s")


def test_signal_handled_by_the_loop_does_not_end_the_process(kennel: Kennel) -> None:
    kennel.word = "Ctrl-C"
    for _ in range(40):
        kennel.hold(0.1)
    assert kennel.given_up == []


def test_unhandled_signal_ends_the_process(kennel: Kennel) -> None:
    kennel.dog.is_armed = False  # whatever the main thread is at: opening, ticking, closing
    kennel.word = "SIGTERM"
    kennel.pass_time(1.9)
    assert kennel.given_up == []
    kennel.pass_time(0.3)
    assert kennel.given_up[0] == ("interrupted", "SIGTERM")


def test_suspended_process_does_not_count_as_stalled(kennel: Kennel) -> None:
    kennel.hold(0.1)
    kennel.clock.advance(3600.0)
    kennel.dog.check()
    assert (kennel.kept, kennel.given_up) == ([], [])


def test_watchdog_thread_starts_and_stops_repeatedly() -> None:
    run, told = RunState(SystemClock()), list[Told]()
    limits = WatchdogLimits(stall=0.1)
    dog = Watchdog(
        run,
        EventStream([told.append]),
        stop_actions={},
        first_signal=lambda: None,
        abandon=lambda *_: None,
        limits=limits,
    )
    dog.stop()
    with dog:
        dog.start()
        dog.is_armed = True
        wait_until(lambda: bool(told))
    dog.stop()


# --- real processes that drive a virtual base -------------------------------------------------------------------------

LEAVES = '''
import ctypes, os, pathlib, signal, sys, _thread, threading
from behaviours.leaf import RUNNING, SUCCESS, Leaf, argument
from drivers.api import Velocity
from drivers.errors import DriverError

class _Driver(Leaf):
    needs = drives = frozenset({"base"})
    _ticks = 0
    def update(self):
        self.robot.base.drive(Velocity(0.2, 0.0))
        self._ticks += 1
        state = self.robot.base.state().value
        return self.hang() if self._ticks > 20 and state and state.velocity.linear > 0.1 else RUNNING
    def hang(self):
        return RUNNING

class Sleepy(_Driver):
    """Fall asleep at the wheel."""
    tag = "sleepy"
    def hang(self):
        threading.Event().wait(3.0)
        return SUCCESS

class Stubborn(_Driver):
    """Drive on and on, within one tick."""
    tag = "stubborn"
    def hang(self):
        while True:
            try:
                self.robot.base.drive(Velocity(0.2, 0.0))
            except DriverError:
                pass
            threading.Event().wait(0.02)

class Petrified(_Driver):
    """Lock, in C, what it has locked already: no Python runs on this thread any more, no signal handler either."""
    tag = "petrified"
    def hang(self):
        mutex, lock = ctypes.create_string_buffer(64), ctypes.CDLL(None).pthread_mutex_lock
        lock(mutex)
        lock(mutex)

class Rude(Leaf):
    """Raise whatever there is, or worse."""
    tag = "rude"
    how: str = argument("text", "how", principal=True)
    def update(self):
        return getattr(self, self.how)()
    def leave(self): sys.exit(0)
    def end_thread(self): _thread.exit()
    def interrupt(self): raise KeyboardInterrupt
    def close(self): raise GeneratorExit
    def recurse(self): self.recurse()
    def exhaust(self): raise MemoryError
    def speechless(self):
        class Odd(Exception):
            def __str__(self): raise ValueError
        raise Odd
    def nothing(self): self.feedback_message = object()
    def leave_when_asked(self):
        class Odd(Exception):
            def __str__(self): raise SystemExit(3)
        raise Odd
    def leave_as_a_driver(self):
        class Odd(DriverError):
            def __str__(self): raise SystemExit(3)
        raise Odd("odd")
    def leave_when_shown(self):
        class Odd:
            def __repr__(self): raise SystemExit(3)
            __str__ = __repr__
        return Odd()
    def leave_when_kept(self):
        class Odd:
            def __repr__(self): raise SystemExit(3)
            __str__ = __eq__ = __repr__
        self.scope["odd"] = Odd()
        return self.fail("kept")

class Deaf(_Driver):
    """Ignore the signals that end a run, and drive on."""
    tag = "deaf"
    def hang(self):
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        signal.set_wakeup_fd(-1)
        return RUNNING

class Twofold(_Driver):
    """Become two, both of which drive on."""
    tag = "twofold"
    _child = None
    def hang(self):
        if self._child is None:
            self._child = os.fork()
            if self._child:
                pathlib.Path("child").write_text(str(self._child))
        return RUNNING

class Heir(Twofold):
    """Become two, of which one drives on by itself."""
    tag = "heir"
    def hang(self):
        super().hang()
        while self._child == 0:
            try:
                self.robot.base.drive(Velocity(0.2, 0.0))
            except DriverError as error:
                pathlib.Path("refused").write_text(str(error))
                os._exit(0)
        return RUNNING
'''

ROBOT = "robot: tester\nbase: {driver: kobuki, port: PORT}\n"


class Held:
    """A `mission run` process, with the leaves above, on a virtual Kobuki of ours."""

    def __init__(self, folder: Path, tree: str) -> None:
        self.kobuki = VirtualKobuki()
        self.terminal = PseudoTerminal("kobuki", self.kobuki, SystemClock())
        self.terminal.open()
        self.events = folder / "events.jsonl"
        (folder / "leaves.py").write_text(LEAVES)
        (folder / "held.yaml").write_text(f"mission: held\ntree:\n  {tree}\n")
        (folder / "robot.yaml").write_text(ROBOT.replace("PORT", self.terminal.path))
        options = ["--behaviours", "leaves.py", "--robot", "robot.yaml", "--json", "--events", "events.jsonl"]
        self.process = Process("run", "held.yaml", *options, folder=folder)

    def wait_for_event(self, words: str) -> None:
        wait_until(lambda: self.events.exists() and words in self.events.read_text())

    @property
    def speed(self) -> float:
        return self.terminal.call_paused(lambda: abs(self.kobuki.wheels.velocity.linear))

    @property
    def summary(self) -> tuple[str, str]:
        told = json.loads(self.process.lines[-1])
        return told["result"], told["reason"]

    def close(self) -> None:
        self.process.end(signal.SIGKILL)  # where it has ended already, this only closes its pipes
        self.terminal.close()


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("leave", "SystemExit: 0"),
        ("end_thread", "SystemExit"),
        ("interrupt", "KeyboardInterrupt"),
        ("close", "GeneratorExit"),
        ("recurse", "RecursionError: maximum recursion depth exceeded"),
        ("exhaust", "MemoryError"),
        ("speechless", "Odd"),
        ("nothing", "returned None instead of a status"),
        ("leave_when_asked", "Odd"),
        ("leave_as_a_driver", "Odd"),
        ("leave_when_shown", "returned a Odd instead of a status"),
        ("leave_when_kept", "kept"),
    ],
)
def test_raising_leaf_fails_the_run_with_its_name_and_line(
    how: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("leaves.py").write_text(LEAVES)
    Path("rude.yaml").write_text(f"mission: rude\ntree:\n  rude: {how}\n")
    outcome = command(capsys, "run", "rude.yaml", "--behaviours", "leaves.py", "--json")
    assert outcome.code == 1
    told = json.loads(outcome.out.splitlines()[-1])
    assert (told["result"], told["reason"].removeprefix("rude (line 3): ").startswith(reason)) == ("failure", True), (
        told
    )


def test_sleeping_leaf_stops_the_base_and_fails_the_run(tmp_path: Path) -> None:
    held = Held(tmp_path, "sleepy")
    try:
        held.wait_for_event("it is kept still")
        wait_until(lambda: held.speed == 0.0)
        assert held.process.end() == 1
        result, reason = held.summary
        assert (result, reason.startswith("sleepy (line 3): blocked the tick for ")) == ("failure", True), reason
        assert held.speed == 0.0
    finally:
        held.close()


@pytest.mark.parametrize("tree", ["stubborn", "petrified"])
def test_signal_ends_a_hanging_loop_with_the_base_stopped(tree: str, tmp_path: Path) -> None:
    held = Held(tmp_path, tree)
    try:
        held.wait_for_event("it is kept still")
        wait_until(lambda: held.speed == 0.0)  # though one of them goes on commanding it
        assert held.process.end(signal.SIGTERM) == 130
        assert held.summary == ("interrupted", "SIGTERM")
        assert held.speed == 0.0
        assert json.loads(held.events.read_text().splitlines()[-1])["event"] == "ended"
    finally:
        held.close()


def test_base_stays_stopped_after_a_slow_tick(tmp_path: Path) -> None:
    held = Held(tmp_path, "sequence: [{sleepy: , on_failure: succeed}, {wait: 1 s}]")
    try:
        held.wait_for_event("it is kept still")
        wait_until(lambda: held.speed == 0.0)
        held.wait_for_event('"kind": "wait"')
        assert held.speed == 0.0
        assert held.process.end() == 0
    finally:
        held.close()


@pytest.mark.real_time
def test_signal_ends_a_run_whose_leaf_ignores_signals(tmp_path: Path) -> None:
    held = Held(tmp_path, "deaf")
    try:
        held.wait_for_event("a behaviour had taken SIGINT, SIGTERM, SIGHUP")
        assert held.process.end(signal.SIGTERM) == 130
        assert held.summary == ("interrupted", "SIGTERM")
        wait_until(lambda: held.speed == 0.0)  # it was told to stop, and its wheels roll out
    finally:
        held.close()


@pytest.mark.parametrize("tree", ["twofold", "heir"])
def test_process_forked_by_a_leaf_ends_without_driving(tree: str, tmp_path: Path) -> None:
    held = Held(tmp_path, tree)
    try:
        child = tmp_path / "child"
        wait_until(lambda: child.exists() and bool(child.read_text()), seconds=20.0)
        wait_until(lambda: _is_dead(int(child.read_text())))
        if tree == "heir":
            assert "a forked process cannot drive the robot" in (tmp_path / "refused").read_text()
        assert held.process.process.poll() is None
        assert held.process.end(signal.SIGTERM) == 130
        assert held.summary == ("interrupted", "SIGTERM")
        wait_until(lambda: held.speed == 0.0)  # it was told to stop, and its wheels roll out
    finally:
        held.close()


def _is_dead(process: int) -> bool:
    """Say whether a process has ended; its parent may not have asked for its end yet."""
    status = Path(f"/proc/{process}/stat")
    return not status.exists() or status.read_text().rpartition(")")[2].split()[0] == "Z"


def test_random_silences_take_every_transition_and_a_stalled_leaf_moves_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def look(kennel: Kennel, chance: Random) -> None:
        kennel.clock.advance(chance.choice((CHECK_INTERVAL, 0.3, 0.6)))
        kennel.dog.check()
        if kennel.dog._loop is not LoopState.ALIVE:
            with pytest.raises(DeviceFault, match="holds the tick"):
                kennel.dog.permit()

    def live(kennel: Kennel, _: Random) -> None:
        kennel.run.record_heartbeat()
        kennel.dog.check()
        kennel.dog.permit()

    def new_kennel() -> Kennel:
        return Kennel(ManualClock())

    table = walk(monkeypatch, "missions.executive.watchdog.TRANSITIONS", new_kennel, [look, look, look, live], walks=30)
    assert table.visited == set(table)
    assert not table.missing
