"""How a task is done: a process that tells how it went, stops when it is told to, and does not outlive its server."""

import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

from missions.library.shipped import shipped_missions
from missions.plugins.tasks.file_lock import hold_lock, is_locked
from missions.plugins.tasks.run_process import RunProcess, arguments_of
from missions.plugins.tasks.task import AttemptOutcome, Claim, How, Task
from tests.missions.service.small_queue import START, new
from tests.waiting import wait_until

ROOT = Path(__file__).parents[3]


def claim(**more: object) -> Claim:
    values = {name: getattr(new(), name) for name in new().__dataclass_fields__}
    known: dict[str, object] = {"id": 7, "added": START, "state": "running", "reason": "", "attempts": 1}
    known |= {"failures": 0, "interruptions": 0, "not_before": 0.0, "cancelling": False, "series": None}
    return Claim(Task(**(values | known | more)), 1)


class Attended:
    """A child that runs a piece of Python instead of a mission, and all that was heard of it."""

    def __init__(
        self,
        script: str,
        *,
        stop: bool = False,
        stopping: Callable[[], bool] = lambda: True,
        say: Callable[[str], None] | None = None,
        hold: tuple[int, ...] = (),
        grace: float = 30.0,
    ) -> None:
        self.lines: list[str] = []
        self.said: list[str] = []
        begun = "import sys, os, json, signal, time\n"
        child = RunProcess(hold, self.lines.append, command=(sys.executable, "-c", begun + script), stop_timeout=grace)
        heard = self.said.append if say is None else say
        self.outcome = child(claim(), lambda: stop and "ready" in self.lines and stopping(), heard)


RESULT = "print(json.dumps({{'result': '{0}', 'reason': 'so'}}))"

PATIENT = "signal.signal(signal.SIGTERM, {0}); print('ready', file=sys.stderr, flush=True); time.sleep(600)"


def test_run_gets_mission_params_and_robot_as_arguments() -> None:
    task = claim(
        mission="-odd.yaml", params={"to": "Ana=1", "x": "--simulate"}, robot="r.yaml", options=("--eyes=truth",)
    )
    words = ["--param=to=Ana=1", "--param=x=--simulate", "--robot=r.yaml", "--eyes=truth", "--", "-odd.yaml"]
    assert arguments_of(task.task) == words


def test_library_mission_is_preferred_to_a_local_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "greet.yaml").write_text("mission: greet\ntree: stop\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert arguments_of(claim(mission="greet").task)[-1] == str(shipped_missions()["greet"])
    assert arguments_of(claim(mission="square").task)[-1] == str(shipped_missions()["motions/square"])


@pytest.mark.parametrize("how", ["success", "failure", "error"])
def test_run_result_is_its_outcome(how: How) -> None:
    assert Attended(RESULT.format(how)).outcome == AttemptOutcome(how, "so")


def test_run_that_a_person_has_ended_is_cancelled() -> None:
    assert Attended(RESULT.format("interrupted")).outcome == AttemptOutcome("cancelled", "so")


def test_run_output_is_received_and_shown_line_by_line() -> None:
    notices = "; ".join(f"print(json.dumps({{'notice': 'n{turn}'}}))" for turn in range(3))
    ran = Attended(f"{notices}; print('words', file=sys.stderr); print('[1]'); print('{{'); {RESULT.format('success')}")
    assert ran.said == ["n0", "n1", "n2"]
    assert sorted(ran.lines) == ["[1]", "words", "{"]
    assert ran.outcome.how == "success"


def test_large_output_is_received_completely() -> None:
    ran = Attended(f"for n in range(20000): print('x' * 50, file=sys.stderr)\n{RESULT.format('success')}")
    assert ran.lines == ["x" * 50] * 20000
    assert ran.outcome.how == "success"


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_killed_run_without_a_result_is_cancelled(number: signal.Signals) -> None:
    """A person has killed it, or its lifeline has, after a person's signal: its robot must stay at rest."""
    reason = f"the run was ended by signal {int(number)}"
    assert Attended(f"os.kill(os.getpid(), {int(number)})").outcome == AttemptOutcome("cancelled", reason)


def test_run_that_dies_of_another_signal_is_interrupted() -> None:
    script = f"os.kill(os.getpid(), {int(signal.SIGUSR1)})"
    assert Attended(script).outcome == AttemptOutcome("interrupted", "the run died: signal 10")


def test_run_without_a_result_gives_the_reason() -> None:
    script = "print('mission: no such file', file=sys.stderr); sys.exit(2)"
    assert Attended(script).outcome == AttemptOutcome("error", "mission: no such file")
    assert Attended("sys.exit(70)").outcome.reason == "the run ended with exit code 70 and no output"


def test_result_counts_even_if_the_run_dies_afterwards() -> None:
    script = f"{RESULT.format('success')}; sys.stdout.flush(); os.kill(os.getpid(), 9)"
    assert Attended(script).outcome.how == "success"


def test_stop_signal_ends_a_run_with_its_own_result() -> None:
    script = f"def end(*_): {RESULT.format('interrupted')}; sys.exit(130)\n{PATIENT.format('end')}"
    assert Attended(script, stop=True).outcome == AttemptOutcome("interrupted", "so")


def test_unresponsive_run_is_killed_with_its_children(tmp_path: Path) -> None:
    script = "import subprocess; subprocess.Popen(['sleep', '600'], close_fds=False)\n"
    with hold_lock(tmp_path / "run.lock") as held:
        ran = Attended(script + PATIENT.format("signal.SIG_IGN"), stop=True, hold=(held,), grace=0.5)
    wait_until(lambda: not is_locked(tmp_path / "run.lock"))
    assert ran.outcome == AttemptOutcome("interrupted", "it did not stop within 0.5 s, and was killed")


def test_server_error_stops_the_run_safely(tmp_path: Path) -> None:
    rested = tmp_path / "rested"
    # It says more than a pipe holds meanwhile: to be heard no more must not keep it from its rest.
    end = f"def end(*_): print('x' * 300000); sys.stdout.flush(); open({str(rested)!r}, 'w').close(); sys.exit(130)\n"

    def fail(*_: object) -> NoReturn:
        raise sqlite3.DatabaseError("database disk image is malformed")

    with pytest.raises(sqlite3.DatabaseError):
        Attended(end + PATIENT.format("end"), stop=True, stopping=fail)
    assert rested.exists()
    rested.unlink()
    told = "signal.signal(signal.SIGTERM, end); print('ready', file=sys.stderr, flush=True); "
    with pytest.raises(sqlite3.DatabaseError):
        Attended(f"{end}{told}print(json.dumps({{'notice': 'n'}}), flush=True); time.sleep(600)", say=fail)
    assert rested.exists()


def test_unresponsive_run_is_killed_after_a_server_error() -> None:
    def fail(*_: object) -> NoReturn:
        raise sqlite3.DatabaseError("database disk image is malformed")

    with pytest.raises(sqlite3.DatabaseError):
        Attended(PATIENT.format("signal.SIG_IGN"), stop=True, stopping=fail, grace=0.5)


def test_unencodable_characters_become_question_marks() -> None:
    script = "print(json.dumps({'notice': 'hello Ren\\udce9'})); "
    script += "print(json.dumps({'result': 'failure', 'reason': 'no \\udce9'}))"
    ran = Attended(script)
    assert (ran.said, ran.outcome) == (["hello Ren?"], AttemptOutcome("failure", "no ?"))


def test_background_process_of_a_run_does_not_delay_its_end() -> None:
    ran = Attended(f"import subprocess; subprocess.Popen(['sleep', '3'])\n{RESULT.format('success')}")
    assert ran.outcome.how == "success"


def test_run_inherits_the_servers_locks(tmp_path: Path) -> None:
    with hold_lock(tmp_path / "run.lock") as held:
        script = f"os.fstat({held}); print('ready', file=sys.stderr); {RESULT.format('success')}"
        assert Attended(script, hold=(held,)).lines == ["ready"]


SERVER = """
import sys
from missions.plugins.tasks.run_process import RunProcess
from tests.missions.service.test_task_child import claim
script = "import sys, select, os; print(os.getpid(), file=sys.stderr, flush=True); n = int(sys.argv[2].split('=')[1]); "
script += "select.select([n], [], []); assert os.read(n, 1) == b''"
process = RunProcess([], lambda line: print(line, flush=True), command=(sys.executable, "-c", script))
process(claim(), lambda: False, print)
"""


def test_run_ends_when_its_server_is_killed() -> None:
    with subprocess.Popen([sys.executable, "-c", SERVER], cwd=ROOT, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        run = int(server.stdout.readline())
        assert Path(f"/proc/{run}").exists()
        server.send_signal(signal.SIGKILL)
    wait_until(lambda: not Path(f"/proc/{run}").exists() or gone(run))


def gone(process: int) -> bool:
    """Say whether a process is dead, and only nobody has asked about it."""
    try:
        return Path(f"/proc/{process}/stat").read_text(encoding="ascii").split()[2] == "Z"
    except OSError:
        return True
