"""Something else in place of a file that is locked or read: it is named, and nothing waits for it."""

import os
import socket
from pathlib import Path

import pytest

from missions.control.notes import STAMP_FILE, was_stopped_since
from missions.control.processes import identity_of
from missions.control.run_folders import run_folders
from missions.plugins.records.recording.repair import repair_record
from missions.plugins.studio.audit_log import AuditLog
from missions.plugins.tasks.file_lock import hold_lock, is_locked, lock_holder

KINDS = ("fifo", "socket", "folder", "device", "dangling", "loop")


def odd(path: Path, kind: str) -> Path:
    """Put something that is no file at a path."""
    match kind:
        case "fifo":
            os.mkfifo(path)
        case "socket":
            with socket.socket(socket.AF_UNIX) as made:
                made.bind(str(path))
        case "folder":
            path.mkdir()
        case "device":
            path.symlink_to("/dev/zero")
        case "dangling":
            path.symlink_to(path.parent / "nowhere")
        case "loop":
            path.symlink_to(path)
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_lock_on_an_odd_file_is_refused_with_its_path(tmp_path: Path, kind: str) -> None:
    path = odd(tmp_path / "run.lock", kind)
    with pytest.raises(OSError, match=r"run\.lock"), hold_lock(path):
        pytest.fail("it was taken")
    if kind == "dangling":
        assert not (tmp_path / "nowhere").exists()
    if kind in ("folder", "dangling"):
        assert not is_locked(path)
    else:
        with pytest.raises(OSError, match=r"run\.lock"):
            is_locked(path)
    assert lock_holder(path) == ""


@pytest.mark.parametrize("kind", KINDS)
def test_repair_of_an_odd_file_is_refused(tmp_path: Path, kind: str) -> None:
    with pytest.raises(OSError, match=r"record\.mcap"):
        repair_record(odd(tmp_path / "record.mcap", kind))


@pytest.mark.parametrize("kind", KINDS)
def test_audit_log_on_an_odd_file_drops_its_lines(tmp_path: Path, kind: str) -> None:
    AuditLog(odd(tmp_path / "studio.log", kind)).write("Ada", "operator", {"do": "stop"}, "ok")


@pytest.mark.parametrize("kind", KINDS)
def test_odd_stop_stamp_file_is_ignored(tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    folder = run_folders()[0].prepare()
    odd(folder / STAMP_FILE, kind)
    process = identity_of(os.getpid())
    assert process is not None
    assert not was_stopped_since(process)
