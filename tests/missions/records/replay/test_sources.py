"""Which files a record is decided again with: today's, or those that it holds."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.recording.validation import InvalidRecordError
from missions.plugins.records.replay.rerun import RerunResult, rerun
from missions.plugins.records.replay.rerun_files import RerunFiles
from missions.request import RunRequest
from tests.missions.records.replay.written import record_of

MISSION = """\
mission: mine
tree:
  sequence:
    - count_ticks: 3
    - mission: inner.yaml
"""

INNER = """\
mission: inner
tree:
  gesture: {gesture}
"""

GESTURE = """\
gesture: nod
keyframes:
  - {at: 0.5 s, elbow: 20 deg}
"""

LEAF = '''\
"""Leaves of a user's own."""

from py_trees.common import Status

from behaviours.leaf import RUNNING, SUCCESS, Leaf, argument


class CountTicks(Leaf):
    """Count."""

    tag = "count_ticks"
    most: float = argument("number", "how many", principal=True)
    _count = 0

    def update(self) -> Status:
        self._count += 1
        return SUCCESS if self._count >= self.most else RUNNING
'''


@pytest.fixture
def mine(tmp_path: Path) -> tuple[RunRecord, Path]:
    """The record of a mission that has a mission inside, a gesture and a leaf of its own; and where its files are."""
    for name in ("gestures", "behaviours"):
        (tmp_path / name).mkdir()
    gesture = tmp_path / "gestures/nod.yaml"
    gesture.write_text(GESTURE)
    (tmp_path / "mine.yaml").write_text(MISSION)
    (tmp_path / "inner.yaml").write_text(INNER.replace("{gesture}", str(gesture)))
    leaf = tmp_path / "behaviours/counting.py"
    leaf.write_text(LEAF)
    order = RunRequest(str(tmp_path / "mine.yaml"), simulate="fast", eyes="truth", behaviours=[leaf])
    return record_of(order, tmp_path / "mine.mcap"), tmp_path


def again(
    record: RunRecord, folder: Path, *, recorded: bool = False, code: Sequence[Path] = ()
) -> tuple[RerunResult, list[str]]:
    sources = RerunFiles(record.header, record.files, folder, recorded=recorded, code=code, trusted=True)
    sources.unpack()
    robot = sources.robot()
    return rerun(record, sources.plan(robot), robot), list(sources.changed_files())


def test_missing_files_are_read_from_the_record(mine: tuple[RunRecord, Path], tmp_path: Path) -> None:
    record, folder = mine
    for path in ("mine.yaml", "inner.yaml", "gestures/nod.yaml", "behaviours/counting.py"):
        (folder / path).unlink()
    found, changed = again(record, tmp_path / "unpacked")
    assert found.is_identical
    assert found.nodes == 4
    assert sorted(changed) == sorted(
        f"{folder / path} no longer exists"
        for path in ("mine.yaml", "inner.yaml", "gestures/nod.yaml", "behaviours/counting.py")
    )


@pytest.mark.parametrize(
    ("path", "was", "becomes"),
    [
        ("mine.yaml", "count_ticks: 3", "count_ticks: 4"),
        ("gestures/nod.yaml", "0.5 s", "0.2 s"),
    ],
)
def test_changed_files_are_used_unless_recorded_ones_are_requested(
    mine: tuple[RunRecord, Path], tmp_path: Path, path: str, was: str, becomes: str
) -> None:
    record, folder = mine
    file = folder / path
    file.write_text(file.read_text().replace(was, becomes))
    found, changed = again(record, tmp_path / "today")
    assert not found.is_identical
    assert changed == [f"{file} has changed since the run"]
    assert again(record, tmp_path / "recorded", recorded=True)[0].is_identical


def test_python_is_read_from_the_record_or_the_given_file(mine: tuple[RunRecord, Path], tmp_path: Path) -> None:
    record, folder = mine
    file = folder / "behaviours/counting.py"
    file.write_text(LEAF.replace(">= self.most", "> self.most"))
    found, changed = again(record, tmp_path / "trusted")
    assert found.is_identical
    assert changed == [f"{file} has changed since the run"]
    assert not again(record, tmp_path / "own", code=[file])[0].is_identical


def test_recorded_python_runs_only_if_trusted(mine: tuple[RunRecord, Path], tmp_path: Path) -> None:
    record, folder = mine
    sources = RerunFiles(record.header, record.files, tmp_path / "unpacked")
    sources.unpack()
    (line,) = sources.foreign_code()
    assert line == f"behaviours/counting.py, {len(LEAF)} bytes, from {folder / 'behaviours/counting.py'}"
    with pytest.raises(InvalidFileError, match="unknown behaviour 'count_ticks'"):
        sources.plan(sources.robot())


def test_fault_of_a_changed_file_is_reported(mine: tuple[RunRecord, Path], tmp_path: Path) -> None:
    record, folder = mine
    (folder / "inner.yaml").write_text("mission: inner\ntree: {fly: 1 m}\n")
    with pytest.raises(InvalidFileError, match="fly"):
        again(record, tmp_path / "unpacked")


def test_rerun_does_not_overwrite_files_of_the_mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    mission = tmp_path / "mine.yaml"
    mission.write_text(
        "mission: mine\ntree:\n  sequence:\n    - parallel:\n        - gesture: hello\n"
        "        - record_move: {move: taken, duration: 2 s}\n"
    )
    record = record_of(RunRequest("mine.yaml", simulate="fast", eyes="truth"), tmp_path / "mine.mcap")
    taken = tmp_path / "taken.yaml"
    taken.write_text("another by now\n")
    found, changed = again(record, tmp_path / "unpacked")
    assert found.is_identical
    assert changed == []
    assert taken.read_text() == "another by now\n"
    assert (tmp_path / "unpacked/new/taken.yaml").is_file()


def test_no_name_of_a_file_leads_out_of_the_folder(greeted: RunRecord, tmp_path: Path) -> None:
    folder = tmp_path / "unpacked"
    RerunFiles(
        greeted.header, {"../../evil": b"1", "mission/../../evil": b"3", "nul\0": b"", "/": b""}, folder
    ).unpack()
    assert {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()} == {
        "evil",
        "mission/evil",
        "nul",
        "unnamed",
    }
    assert not (tmp_path / "evil").exists()


def test_two_record_files_of_one_path_are_refused(greeted: RunRecord, tmp_path: Path) -> None:
    files = {"behaviours/mine.py": b"good", "behaviours/../mine.py": b"evil"}
    with pytest.raises(
        InvalidRecordError, match=r"two files of the record have the same name: behaviours/\.\./mine\.py"
    ):
        RerunFiles(greeted.header, files, tmp_path / "unpacked").unpack()
