"""Tests of ``mission sweep``: what it prints and writes, how its runs are repeated, what it refuses."""

import io
import json
import shlex
import signal
import sys
from collections.abc import Generator
from pathlib import Path
from typing import Any

import cv2
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from config.world import load_world
from missions.plugins.testing.sweep.sweep import SweepPlan, run_seeds
from missions.plugins.testing.sweep.variation import SweepRow
from tests.missions.command import Process, command
from tests.missions.testing.sweep.labour import GLANCE
from tests.waiting import wait_until

VARY = ("--vary", "person.bearing=-100..100 deg", "--vary", "light=40 %,100 %", "--vary", "param.patience=2..3 s")


@pytest.fixture(scope="module", autouse=True)
def fonts() -> None:
    """Have Matplotlib open its fonts before the tests: it keeps their files open."""
    FigureCanvasAgg(figure := Figure())
    figure.suptitle("any words")
    figure.savefig(io.BytesIO())


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run sweeps in this process: what a test is about has nothing to do with workers."""
    monkeypatch.setattr(
        "missions.plugins.testing.commands.sweep.run_here", lambda sweep, seeds, _: iter_rows(sweep, seeds)
    )


def iter_rows(sweep: SweepPlan, seeds: range) -> Generator[SweepRow]:
    yield from run_seeds(sweep, seeds)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with a mission in it."""
    (tmp_path / "glance.yaml").write_text(GLANCE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def sweep(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> tuple[str, str]:
    outcome = command(capsys, "sweep", "glance.yaml", *arguments)
    assert outcome.code == code, outcome.err
    return outcome.out, outcome.err


def summary_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.usefixtures("here")
def test_a_sweep_prints_a_table_and_writes_runs_summary_and_picture(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, _ = sweep(capsys, "--runs", "12", *VARY)
    assert out.startswith("glance in living_room: 12 runs, eyes: truth; ")
    assert "person.bearing (deg)   runs   success     95 % interval\n" in out
    assert out.endswith("written to sweep-glance/: runs.csv, summary.json, sweep.png\n")
    written = folder / "sweep-glance"
    lines = (written / "runs.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("seed,person.bearing (deg),light (%),param.patience (s),result,")
    assert [line.split(",")[0] for line in lines[1:]] == [str(seed) for seed in range(12)]
    summary = summary_of(written)
    good = sum(",success," in line for line in lines)
    assert 0 < good < 12
    assert (summary["runs"], summary["successes"]) == (12, good)
    assert sum(part["runs"] for part in summary["varied"]["light (%)"]) == 12
    picture = cv2.imread(str(written / "sweep.png"))
    assert picture is not None
    assert picture.shape[0] > 400
    assert picture.std() > 10


@pytest.mark.usefixtures("here")
def test_printed_commands_repeat_the_worst_runs_exactly(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, _ = sweep(capsys, "--runs", "12", "--seed", "100", *VARY)
    lines = (folder / "sweep-glance" / "runs.csv").read_text(encoding="utf-8").splitlines()
    rows = {line.split(",")[0]: line.split(",") for line in lines}
    printed = [line.strip() for line in out.splitlines() if line.startswith("    mission run ")]
    assert len(printed) == 5
    for line in printed:
        _, *words = shlex.split(line)
        outcome = command(capsys, *words, "--json")
        result = json.loads(outcome.out)
        row = rows[words[words.index("--seed") + 1]]
        assert [result["result"], f"{result['seconds']:.6g}", str(result["ticks"])] == [
            row[4],
            f"{float(row[7]):.6g}",
            row[8],
        ]


def test_single_run_of_a_sweep_prints_events_and_saves_its_world(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vary = ("--vary", "person.distance=1..2", "--param", "patience=10 s")
    out, _ = sweep(capsys, *vary, "--only", "7", "--save-world", "seven.yaml")
    drawn, again, *events = out.splitlines()
    assert drawn == "run 7: person.distance=1.63 m"
    assert shlex.split(again)[-4:] == ["--world", "seven.yaml", "--param", "patience=10 s"]
    assert events[0].startswith("mission glance on ")
    assert events[-1].startswith("✓ glance: success after ")
    assert load_world(folder / "seven.yaml").people[0].x != 1.7
    assert command(capsys, *shlex.split(again)[1:]).out.splitlines() == events
    assert not (folder / "sweep-glance").exists()


def test_the_table_does_not_depend_on_the_number_of_workers(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for jobs in ("1", "2"):
        sweep(capsys, "--runs", "8", "--jobs", jobs, "-o", f"on{jobs}", *VARY)
    assert (folder / "on1" / "runs.csv").read_bytes() == (folder / "on2" / "runs.csv").read_bytes()
    assert (folder / "on1" / "summary.json").read_bytes() == (folder / "on2" / "summary.json").read_bytes()


@pytest.mark.usefixtures("here")
def test_earlier_sweep_is_overwritten_only_with_force(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sweep(capsys, "--runs", "3", "--seed", "50")
    before = (folder / "sweep-glance" / "runs.csv").read_text(encoding="utf-8")
    _, err = sweep(capsys, "--runs", "1", code=2)
    assert "sweep-glance/runs.csv already exists: name another folder with --output, or add --force" in err
    assert (folder / "sweep-glance" / "runs.csv").read_text(encoding="utf-8") == before
    sweep(capsys, "--runs", "1", "--force")
    assert len((folder / "sweep-glance" / "runs.csv").read_text(encoding="utf-8").splitlines()) == 2
    assert [path.name for path in (folder / "sweep-glance" / "worlds").iterdir()] == ["0.yaml"]


@pytest.mark.usefixtures("here")
def test_target_fails_if_the_interval_reaches_below(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del folder
    found = ("--runs", "6", "--param", "patience=10 s")
    sweep(capsys, *found, "--target", "60 %")
    _, err = sweep(capsys, *found, "--target", "90 %", "--force", code=1)
    assert err == "mission: the success rate may be as low as 61.0 %: below 90.0 %\n"


@pytest.mark.usefixtures("here")
def test_missing_matplotlib_gives_the_install_command_only(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "missions.plugins.testing.sweep.picture", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    out, err = sweep(capsys, "--runs", "1")
    assert err == "mission: no picture without Matplotlib: pip install 'missiontree[plots]'\n"
    assert out.endswith("written to sweep-glance/: runs.csv, summary.json\n")
    assert not (folder / "sweep-glance" / "sweep.png").exists()


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["--vary", "person.distanse=1..2"], "'person.distanse' cannot be varied; did you mean 'person.distance'?"),
        (["--vary", "person.distance=2..1"], "person.distance begins above its end: '2..1'"),
        (["--vary", "person.distance"], "'person.distance' is not NAME=VALUE, such as"),
        (["--vary", "person.distance=1..9"], "with person.distance=9 m: Anna is outside the room"),
        (["--vary", "person3.distance=1..2"], "with person3.distance=1 m: the world 'living_room' has no person 3"),
        (["--vary", "person.look=anna,bob"], "with person.look=bob: 'look' cannot be 'bob'"),
        (["--vary", "param.patiense=1..2 s"], "'param.patiense' cannot be varied; did you mean 'patience'?"),
        (["--vary", "param.rounds=0..3"], "param.rounds must be between 1 and 5"),
        (["--vary", "param.patience=1..2 m"], "param.patience needs values such as '2 s', got '1 m'"),
        (["--vary", "param.patience=1..2", "--param", "patience=3 s"], "param.patience is given by --param as well"),
        (["--world", "living_rom"], "unknown world 'living_rom'; did you mean 'living_room'?"),
        (["--param", "patiense=1 s"], "has no param 'patiense'"),
        (["--target", "95"], "needs a share such as '20 %': '95' has no unit"),
        (["--save-world", "x.yaml"], "--save-world needs --only SEED"),
        (["-o", "glance.yaml/x"], "glance.yaml/x: Not a directory"),
    ],
)
def test_invalid_sweep_arguments_are_refused_before_the_first_run(
    arguments: list[str], what: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, err = sweep(capsys, *arguments, code=2)
    assert out == ""
    assert what in " ".join(err.split())
    assert [path.name for path in folder.iterdir()] == ["glance.yaml"]


@pytest.mark.usefixtures("here")
def test_every_kind_of_param_can_be_varied(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    varied = ["--vary", "param.greeting=Hello,Good morning", "--vary", "param.rounds=1..3"]
    sweep(capsys, "--runs", "6", *varied)
    lines = (folder / "sweep-glance" / "runs.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert {line.split(",")[1] for line in lines} == {"Hello", "Good morning"}
    assert {line.split(",")[2] for line in lines} <= {"1", "2", "3"}


@pytest.mark.real_time
def test_ctrl_c_ends_the_sweep_and_finished_runs_are_written(folder: Path) -> None:
    process = Process("sweep", "glance.yaml", "--runs", "100000", folder=folder)
    try:
        wait_until(lambda: len(workers_of(process)) >= 2, seconds=30.0)
        children = workers_of(process)
    finally:
        code = process.end(signal.SIGINT)
    assert code == 130, process.errors
    assert process.errors[-1].startswith("mission: interrupted; ")
    missing = int(process.errors[-1].split()[2])
    runs = folder / "sweep-glance" / "runs.csv"
    assert missing == 100_000 - (len(runs.read_text(encoding="utf-8").splitlines()) - 1 if runs.exists() else 0)
    wait_until(lambda: not any(Path(f"/proc/{child}").exists() for child in children))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
@pytest.mark.real_time
def test_finished_runs_are_kept_when_the_sweep_is_killed(folder: Path, number: signal.Signals) -> None:
    runs = folder / "sweep-glance" / "runs.csv"
    process = Process("sweep", "glance.yaml", "--runs", "100000", "--jobs", "1", folder=folder)
    try:
        wait_until(lambda: runs.exists() and len(runs.read_text().splitlines()) > 3, seconds=60.0)
    finally:
        code = process.end(number)
    lines = runs.read_text().splitlines()
    assert lines[0].startswith("seed,")
    assert len(lines) > 3
    if number != signal.SIGKILL:
        assert code == 130
        assert process.errors[-1] == f"mission: interrupted; {100_001 - len(lines)} runs are missing\n"
        assert (runs.parent / "summary.json").exists()


@pytest.mark.real_time
def test_workers_end_when_the_sweep_is_killed(folder: Path) -> None:
    process = Process("sweep", "glance.yaml", "--runs", "100000", folder=folder)
    try:
        wait_until(lambda: len(workers_of(process)) >= 3, seconds=30.0)  # with the one that tracks semaphores
        children = workers_of(process)
    finally:
        process.end(signal.SIGKILL)
    wait_until(lambda: not any(Path(f"/proc/{child}").exists() for child in children), seconds=30.0)


def workers_of(process: Process) -> list[str]:
    """The processes that a process has started."""
    number = process.process.pid
    try:
        return Path(f"/proc/{number}/task/{number}/children").read_text(encoding="ascii").split()
    except OSError:
        return []
