"""A power cut at any moment: no task that was acknowledged is lost, and a record has all that was on the disk."""

import os
import sys
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from random import Random

import pytest

from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.recording.validation import InvalidRecordError
from missions.plugins.tasks.queue import TaskQueue
from missions.plugins.tasks.queue_database import open_db
from tests.power import ACKNOWLEDGED, Call, after_cut, recordable, recorded

pytestmark = pytest.mark.skipif(not recordable(), reason="strace is not here, or may not look at other programs")

CUTS = int(os.environ.get("CUTS", "25"))
"""Of each kind."""

QUEUE = """
import sys
from pathlib import Path
from missions.plugins.tasks.queue import TaskQueue
from missions.plugins.tasks.queue_database import open_db
from missions.plugins.tasks.task import NewTask, AttemptOutcome, RetryPolicy

queue = TaskQueue(open_db(Path(sys.argv[1]) / "tasks.db"), lambda _: ())
for number in range(int(sys.argv[2])):
    queue.add(NewTask(mission="note", due=0.0, policy=RetryPolicy("retry", 9)), 0.0)
    print(f"acknowledged {number + 1}:waiting", flush=True)
    if number % 3 == 2:
        claim = queue.claim(1.0)
        print(f"acknowledged {claim.task.id}:running", flush=True)
        queue.finish(claim, AttemptOutcome("success", ""), 2.0)
        print(f"acknowledged {claim.task.id}:done", flush=True)
"""


def placed(left: Mapping[str, bytes], old: Path, new: Path) -> None:
    """Write what a power cut has left into another folder."""
    for name, data in left.items():
        path = new / Path(name).relative_to(old)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def cuts(done: list[Call], number: int) -> list[int]:
    """Return after how many calls the power is cut, each time."""
    chance = Random(4)  # noqa: S311 - chance, not a secret
    return sorted(chance.randrange(1, len(done) + 1) for _ in range(number))


ORDER = ("waiting", "running", "done")


def lost_tasks(folder: Path, done: list[Call], at: int, chance: Random | None, into: Path) -> list[str]:
    """Return what was acknowledged before the power cut, and is not so after it."""
    wanted: dict[int, str] = {}
    for call in done[:at]:
        if call.what == ACKNOWLEDGED:
            number, _, state = call.path.partition(":")
            wanted[int(number)] = state
    left = {name: data for name, data in after_cut(done[:at], chance).items() if not name.endswith("-shm")}
    placed(left, folder, into)
    if not wanted and not (into / "tasks.db").exists():
        return []
    with closing(open_db(into / "tasks.db")) as connection:
        found = {task.id: str(task.state) for task in TaskQueue(connection, lambda _: ()).tasks()}
    return [
        f"task {number} was {state}, and is {found.get(number, 'gone')}"
        for number, state in wanted.items()
        if number not in found or ORDER.index(found[number]) < ORDER.index(state)
    ]


def test_power_cut_loses_no_acknowledged_task(tmp_path: Path, record_property: Callable[[str, object], None]) -> None:
    folder = tmp_path / "state"
    folder.mkdir()
    done = recorded([sys.executable, "-c", QUEUE, str(folder), "12"], folder, tmp_path / "trace")
    assert sum(call.what == ACKNOWLEDGED for call in done) == 20
    lost: list[str] = []
    for number, at in enumerate(cuts(done, CUTS)):
        chance = Random(number) if number % 2 else None  # noqa: S311 - chance, not a secret
        lost += lost_tasks(folder, done, at, chance, tmp_path / f"cut{number}")
    assert lost == []
    record_property("figure", f"{CUTS} power cuts of a queue")


def times(path: Path) -> list[float]:
    """Return the times of the moments in a record; none where it is none."""
    try:
        return [moment.t for moment in open_record(path).tick_records]
    except (InvalidRecordError, OSError):
        return []


def test_power_cut_keeps_the_synced_part_of_a_record(
    tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    folder = tmp_path / "records"
    folder.mkdir()
    run = [sys.executable, "-m", "missions", "run", "look_around", "--simulate", "fast", "--speed", "4"]
    done = recorded([*run, "--record", str(folder / "it.mcap")], folder, tmp_path / "trace")
    whole = times(folder / "it.mcap")
    assert len(whole) > 20
    for number, at in enumerate(cuts(done, CUTS)):
        into, safe = tmp_path / f"cut{number}", tmp_path / f"safe{number}"
        placed(after_cut(done[:at], Random(number)), folder, into)  # noqa: S311 - chance, not a secret
        placed(after_cut(done[:at], None), folder, safe)
        synced, left = times(safe / "it.mcap"), times(into / "it.mcap")
        assert synced == whole[: len(synced)]
        assert left[: len(synced)] == synced
        assert set(left) <= set(whole)
    record_property("figure", f"{CUTS} of a record")


def test_closed_record_survives_a_power_cut(tmp_path: Path) -> None:
    folder = tmp_path / "records"
    folder.mkdir()
    run = [sys.executable, "-m", "missions", "run", "look_around", "--simulate", "fast"]
    done = recorded([*run, "--record", str(folder / "it.mcap")], folder, tmp_path / "trace")
    placed(after_cut(done, None), folder, tmp_path / "after")
    assert (tmp_path / "after" / "it.mcap").read_bytes() == (folder / "it.mcap").read_bytes()
