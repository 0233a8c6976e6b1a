"""STOP from anywhere: 40 combinations of where a run begins, what becomes of its folders, and who stops it from where.

Each has a run that drives a virtual base, which lives in a process of its own and knows whether it moves. A stop that
is told must have happened: that holds in every combination. ``TRIES=most`` tries all; `--junitxml` keeps a row of each.
"""

import json
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from threading import Event

import pytest

from drivers.clock import SystemClock
from missions.control.run_folders import SYSTEM_ROOT
from missions.plugins.fleet.local_robot import LocalRobot
from tests.missions.command import Process
from tests.missions.lone_base import LONE_ROBOT, LoneBase, lone_base
from tests.missions.studio.running import DRIVING
from tests.missions.studio.serving import Served
from tests.tries import tries
from tests.waiting import wait_until

pytestmark = [pytest.mark.real_time, pytest.mark.long]

RUNTIME, STATE, HOME = "XDG_RUNTIME_DIR", "XDG_STATE_HOME", "HOME"
OF_USERS = (RUNTIME, STATE, HOME, "XDG_CONFIG_HOME", "XDG_DATA_HOME", "SUDO_UID")

REST_TIME = 3.0
"""Seconds within which a base stands that was stopped."""

GRACE = 1.5
"""Seconds in which a run notices that its socket has gone: it looks each second."""

ROOT = os.geteuid() == 0


@dataclass
class World:
    """The folders of a computer, and a run on it."""

    folder: Path
    base: LoneBase
    ends: ExitStack
    run: Process | None = None
    environment: dict[str, str] = field(default_factory=dict)

    @property
    def runtime(self) -> Path:
        return self.folder / "runtime"

    @property
    def state(self) -> Path:
        return self.folder / "home/.local/state"

    @property
    def session(self) -> Path:
        return self.folder / "system/run/user" / str(os.geteuid())

    @property
    def pid(self) -> int:
        assert self.run is not None
        return self.run.process.pid

    def usual(self) -> dict[str, str]:
        """Return the variables of a terminal."""
        return {RUNTIME: str(self.runtime), HOME: str(self.folder / "home")}

    def cron(self) -> dict[str, str]:
        """Return the variables of a cron job."""
        return {HOME: str(self.folder / "home")}

    def all_folders(self) -> list[Path]:
        """Return every folder in which a run can leave anything."""
        return [self.runtime, self.state, self.session, self.folder / "system/home", self.folder / "private"]


@contextmanager
def living(world: World, variables: Mapping[str, str]) -> Iterator[None]:
    """Let processes that begin meanwhile, and this one, have these variables alone of those that are a user's."""
    with pytest.MonkeyPatch.context() as patch:
        for name in OF_USERS:
            patch.delenv(name, raising=False)
        patch.setenv(SYSTEM_ROOT, str(world.folder / "system"))
        for name, value in variables.items():
            patch.setenv(name, value)
        yield


# --- where the run begins ---------------------------------------------------------------------------------------------


def in_a_login_session(world: World) -> dict[str, str]:
    world.session.mkdir(parents=True)
    return world.cron()


def in_folders_of_its_own(world: World) -> dict[str, str]:
    private = world.folder / "private"
    return {RUNTIME: str(private / "runtime"), STATE: str(private / "state"), HOME: str(world.folder / "home")}


def with_a_long_path(world: World) -> dict[str, str]:
    return {**world.usual(), RUNTIME: str(world.runtime / ("long" * 40))}


def without_a_home(world: World) -> dict[str, str]:
    return {**world.usual(), HOME: "/nonexistent"}


def where_the_runtime_folder_is_a_file(world: World) -> dict[str, str]:
    world.runtime.write_text("", encoding="utf-8")
    return world.usual()


def where_the_runtime_folder_is_full(world: World) -> dict[str, str]:
    world.runtime.mkdir()
    mounted(world, world.runtime)
    for number in range(100):
        with suppress(OSError):
            (world.runtime / str(number)).touch()
    return world.usual()


def where_the_state_folder_is_full(world: World) -> dict[str, str]:
    world.state.mkdir(parents=True)
    mounted(world, world.state)
    with suppress(OSError):
        (world.state / "much").write_bytes(bytes(1 << 20))
    for number in range(100):
        with suppress(OSError):
            (world.state / str(number)).touch()
    return world.usual()


def mounted(world: World, place: Path) -> None:
    """Put a small file system there."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k,nr_inodes=20", "none", str(place)], check=True)
    world.ends.callback(subprocess.run, ["umount", "-l", str(place)], check=False)


STARTS: Mapping[str, Callable[[World], dict[str, str]]] = {
    "a terminal": World.usual,
    "a service": World.cron,
    "a login session": in_a_login_session,
    "folders of its own": in_folders_of_its_own,
    "a long path": with_a_long_path,
    "no home": without_a_home,
    "runtime folder a file": where_the_runtime_folder_is_a_file,
    "runtime folder full": where_the_runtime_folder_is_full,
    "state folder full": where_the_state_folder_is_full,
}

# --- what becomes of its folders --------------------------------------------------------------------------------------


def remove(*folders: Path) -> None:
    for each in folders:
        shutil.rmtree(each, ignore_errors=True)


def replace_by_files(*folders: Path) -> None:
    remove(*folders)
    for each in folders:
        each.parent.mkdir(parents=True, exist_ok=True)
        each.write_text("", encoding="utf-8")


def remove_sockets(world: World) -> None:
    for each in world.folder.rglob("*.sock"):
        each.unlink()


def remove_notes(world: World) -> None:
    for each in world.folder.rglob("*.note"):
        each.unlink()


def steal_the_socket(world: World) -> None:
    """Let another program listen in the place of the run."""
    for each in list(world.folder.rglob("*.sock")):
        each.unlink()
        thief = world.ends.enter_context(socket.socket(socket.AF_UNIX))
        with suppress(OSError):  # too long a path
            thief.bind(str(each))
            thief.listen()


def freeze(world: World) -> None:
    os.kill(world.pid, signal.SIGSTOP)
    world.ends.callback(os.kill, world.pid, signal.SIGCONT)


def take_its_descriptors(world: World) -> None:
    resource.prlimit(world.pid, resource.RLIMIT_NOFILE, (3, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))


def leave_old_notes(world: World) -> None:
    """Leave the notes and sockets of processes that are gone, and of one that another has got the number of."""
    for note in list(world.folder.rglob(f"{world.pid}.note")):
        told = json.loads(note.read_text(encoding="utf-8").splitlines()[0])
        _, start, boot, namespace = told["process"]
        for number in (os.getpid(), 1, 4_000_000):
            about = {**told, "process": [number, start + 1, boot, namespace], "sockets": [], "run": str(number)}
            (note.parent / f"{number}.note").write_text(json.dumps(about) + "\n", encoding="utf-8")


THEN: Mapping[str, Callable[[World], object]] = {
    "nothing": lambda _: None,
    "runtime emptied": lambda world: remove(world.runtime / "missiontree"),
    "runtime removed": lambda world: remove(world.runtime),
    "runtime a file": lambda world: replace_by_files(world.runtime),
    "session emptied": lambda world: remove(world.session),
    "state removed": lambda world: remove(world.state, world.folder / "system/home"),
    "all removed": lambda world: remove(*world.all_folders()),
    "all files": lambda world: replace_by_files(*world.all_folders()),
    "sockets removed": remove_sockets,
    "notes removed": remove_notes,
    "socket stolen": steal_the_socket,
    "old notes": leave_old_notes,
    "frozen": freeze,
    "no descriptors": take_its_descriptors,
}

# --- who stops it, from where -----------------------------------------------------------------------------------------


def by_command(world: World, variables: Mapping[str, str], *before: str) -> tuple[bool, str]:
    """Type `mission stop`; return whether it says that all is stopped, and its words."""
    with living(world, variables):
        command = [*before, sys.executable, "-m", "missions", "stop"]
        done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)
    return done.returncode == 0, done.stdout + done.stderr


def with_few_descriptors(world: World, count: int) -> tuple[bool, str]:
    return by_command(world, world.usual(), "prlimit", f"--nofile={count}")


def by_studio(world: World, variables: Mapping[str, str], *, starve: bool = False) -> tuple[bool, str]:
    """Press the page's STOP, in a studio with other variables than the run."""
    with living(world, {**variables, "XDG_CONFIG_HOME": str(world.folder / "studio")}):
        os.environ[STATE] = os.environ.get(STATE, str(world.folder / "studio state"))
        os.environ[RUNTIME] = os.environ.get(RUNTIME, "")
        process = Process("studio", "--port", "0")
        try:
            served = Served(process)
            with served.client(served.viewer) as client:
                if starve:
                    starve_of_descriptors(process.process.pid)
                told = client.ask("stop")
                if not told["ok"]:
                    return False, str(told)
                stopped = told["result"]["stopped"]
                return all("trouble" not in each for each in stopped.values()), json.dumps(stopped)
        finally:
            process.process.kill()
            process.process.wait()
            process.end()


def starve_of_descriptors(pid: int) -> None:
    """Leave a process no descriptor beyond those that it has."""
    used = max(int(each.name) for each in Path(f"/proc/{pid}/fd").iterdir())
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (used + 1, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))


def by_fleet(world: World, variables: Mapping[str, str]) -> tuple[bool, str]:
    with living(world, variables), LocalRobot() as machine:
        return machine.stop("operator 1")


STOPS: Mapping[str, Callable[[World], tuple[bool, str]]] = {
    "the same terminal": lambda world: by_command(world, world.usual()),
    "cron": lambda world: by_command(world, world.cron()),
    "no variables": lambda world: by_command(world, {}),
    "another state folder": lambda world: by_command(world, {**world.cron(), STATE: str(world.folder / "other")}),
    "another runtime folder": lambda world: by_command(world, {**world.cron(), RUNTIME: str(world.folder / "other")}),
    "relative variables": lambda world: by_command(world, {**world.cron(), RUNTIME: "run", STATE: "state"}),
    "40 descriptors": partial(with_few_descriptors, count=40),
    "5 descriptors": partial(with_few_descriptors, count=5),
    "another container": lambda world: by_command(world, world.cron(), "unshare", "-p", "-f", "--mount-proc"),
    "another network": lambda world: by_command(world, world.cron(), "unshare", "-n"),
    "studio": lambda world: by_studio(world, world.usual()),
    "studio of a service": lambda world: by_studio(world, {}),
    "studio without descriptors": lambda world: by_studio(world, world.cron(), starve=True),
    "fleet": lambda world: by_fleet(world, world.cron()),
}

NEEDS_ROOT = {"runtime folder full", "state folder full", "another container", "another network"}


@dataclass(frozen=True)
class Combination:
    """A start, what happens then, who stops; ``at_once`` before the run can notice what happens to its folders.

    ``is_stopped`` is None where that may be or not, and is told as it is.
    """

    start: str
    then: str
    stop: str
    at_once: bool = False
    is_stopped: bool | None = True

    @property
    def name(self) -> str:
        return f"{self.start}, {self.then}{' just now' * self.at_once}, {self.stop}"


COMBINATIONS = [
    # The five that were seen: without the variable, emptied at log-out, full, and two studios.
    Combination("a terminal", "nothing", "cron"),
    Combination("a terminal", "runtime emptied", "the same terminal"),
    Combination("runtime folder full", "nothing", "the same terminal"),
    Combination("a terminal", "nothing", "studio of a service"),
    Combination("a terminal", "nothing", "studio without descriptors"),
    Combination("a terminal", "nothing", "the same terminal"),
    Combination("a terminal", "nothing", "no variables"),
    Combination("a terminal", "nothing", "another container"),
    Combination("a terminal", "nothing", "another network"),
    Combination("a terminal", "nothing", "40 descriptors"),
    Combination("a terminal", "nothing", "5 descriptors", is_stopped=None),
    Combination("a terminal", "frozen", "cron", is_stopped=False),
    Combination("a terminal", "no descriptors", "the same terminal"),
    Combination("a terminal", "runtime emptied", "the same terminal", at_once=True),
    Combination("a terminal", "runtime removed", "cron"),
    Combination("a terminal", "runtime removed", "studio of a service"),
    Combination("a terminal", "runtime a file", "the same terminal"),
    Combination("a terminal", "all removed", "no variables", at_once=True),
    Combination("a terminal", "all removed", "another network"),
    Combination("a terminal", "all files", "cron"),
    Combination("a terminal", "sockets removed", "the same terminal", at_once=True),
    Combination("a terminal", "all removed", "another network", at_once=True),
    Combination("a terminal", "notes removed", "cron", at_once=True),
    Combination("a terminal", "socket stolen", "the same terminal", at_once=True),
    Combination("a terminal", "socket stolen", "another network"),
    Combination("a terminal", "old notes", "cron"),
    Combination("a terminal", "nothing", "fleet"),
    Combination("a terminal", "runtime emptied", "fleet", at_once=True),
    Combination("a service", "nothing", "the same terminal"),
    Combination("a service", "state removed", "another state folder"),
    Combination("a service", "state removed", "studio"),
    Combination("a login session", "nothing", "no variables"),
    Combination("a login session", "session emptied", "another runtime folder"),
    Combination("folders of its own", "nothing", "cron"),
    Combination("folders of its own", "all removed", "studio of a service"),
    Combination("folders of its own", "nothing", "another network"),
    Combination("a long path", "runtime removed", "relative variables"),
    Combination("no home", "nothing", "cron"),
    Combination("runtime folder a file", "state removed", "no variables", at_once=True),
    Combination("state folder full", "runtime emptied", "the same terminal"),
]


def tried() -> list[Combination]:
    """Return those that are tried: the five that were seen first."""
    return COMBINATIONS[: tries(6, most=len(COMBINATIONS))]


@contextmanager
def world_of(combination: Combination, folder: Path) -> Iterator[World]:
    """Have a run drive a base there."""
    if not ROOT and NEEDS_ROOT & {combination.start, combination.stop}:
        pytest.skip("only root may mount file systems, and make containers")
    with ExitStack() as ends:
        world = World(folder, ends.enter_context(lone_base()), ends)
        (folder / "home").mkdir()
        mission = folder / "mission.yaml"
        mission.write_text(DRIVING, encoding="utf-8")
        with living(world, STARTS[combination.start](world)):
            words = ["run", str(mission), "--robot", LONE_ROBOT, "--port", f"base={world.base.port}", "--no-record"]
            world.run = Process(*words)
        ends.callback(end, world.run)
        wait_until(lambda: moves(world) or world.run is None or world.run.process.poll() is not None)
        assert world.run.process.poll() is None, world.run.errors
        yield world


def moves(world: World) -> bool:
    return world.base.seen().top > 0.1


def end(process: Process) -> None:
    process.process.kill()
    process.process.wait()
    process.end()


def comes_to_rest(base: LoneBase) -> bool:
    clock = SystemClock()
    while base.seen().moving:
        if clock.now() > REST_TIME:
            return False
        Event().wait(0.05)
    Event().wait(0.3)
    return not base.seen().moving


@pytest.mark.parametrize("combination", tried(), ids=lambda each: each.name)
def test_reported_stop_has_happened_in_any_combination(
    combination: Combination, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    with world_of(combination, tmp_path) as world:
        THEN[combination.then](world)
        if not combination.at_once:
            Event().wait(GRACE)
        says_so, words = STOPS[combination.stop](world)
        rests = comes_to_rest(world.base)
    outcome = f"{'stopped' if rests else 'moves on'} | {'told so' if says_so else 'told: perhaps not'}"
    record_property("outcome", f"{combination.name} | {outcome} | {words.strip().splitlines()[:1]}")
    assert rests or not says_so, "a stop was told that has not happened"
    assert combination.is_stopped in (None, rests and says_so), words
    assert says_so or "perhaps not" in words or "trouble" in words
