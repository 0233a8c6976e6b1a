"""Files that are written whole or not at all."""

import errno
import os
import re
import stat
from pathlib import Path

import pytest

from config.file_io import PRIVATE_MODE, replace_file, save_file

ROOT = Path(__file__).parents[2]

RAW = re.compile(r"\.write_text\(|\.write_bytes\(|\bopen\([^)]*[\"'][wx]b?[\"']|savefig\(path")
"""How a file is written so that a full disk leaves half of it."""

NEW_OR_OWN = {
    "config/defaults.py": 1,  # a heading, where no file is
    "config/file_io.py": 1,  # what is no regular file
    "config/yaml_writer.py": 1,  # a new file, removed where it fails
    "missions/__init__.py": 1,  # an example in a docstring
    "missions/plugins/fleet/membership.py": 1,  # a token in a folder of its own, renamed
    "missions/cli/root.py": 1,  # /dev/null
    "missions/library/private_files.py": 1,  # events, as they come
    "missions/plugins/records/recording/writer_process.py": 1,  # a record, as it comes, beside the earlier one
    "missions/plugins/records/replay/rerun_files.py": 1,  # copies in a temporary folder
    "missions/plugins/tasks/fleet_latch.py": 1,  # renamed
    "missions/cli/commands.py": 1,  # the help of a command
    "missions/plugins/studio/audit_log.py": 1,  # a log, line by line
    "missions/plugins/studio/studio.py": 1,  # new pictures
    "missions/plugins/studio/page_opener.py": 1,  # a new file
    "missions/plugins/studio/access.py": 1,  # a new file
}
"""How often a module may do that: for files that are new, or that nobody needs once they are broken."""


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may give a file to another user")
def test_replaced_file_keeps_its_owner_unless_it_is_private(tmp_path: Path) -> None:
    path = tmp_path / "mission.yaml"
    path.write_text("old")
    os.chown(path, 12345, 12346)
    save_file(path, "new")
    assert (path.stat().st_uid, path.stat().st_gid) == (12345, 12346)
    save_file(path, "secret", PRIVATE_MODE)
    assert path.stat().st_uid == 0


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt(), ValueError()])
def test_failed_replace_keeps_the_old_file(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "report.html"
    path.write_text("good")

    def write_half() -> None:
        with replace_file(path) as file:
            file.write(b"half")
            raise error

    with pytest.raises(type(error)):
        write_half()
    assert path.read_text() == "good"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_names_the_file(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"report\.html"), replace_file(tmp_path / "report.html"):
        raise OSError(errno.ENOSPC, "No space left on device")


def test_save_file_preserves_permissions_and_symlink(tmp_path: Path) -> None:
    path, link = tmp_path / "real", tmp_path / "link"
    path.write_text("old")
    path.chmod(0o640)
    link.symlink_to(path)
    save_file(link, "new")
    assert (link.is_symlink(), path.read_text(), stat.S_IMODE(path.stat().st_mode)) == (True, "new", 0o640)


def test_private_file_is_readable_by_its_owner_only(tmp_path: Path) -> None:
    path = tmp_path / "film.webm"
    path.write_text("old")
    save_file(path, b"new", PRIVATE_MODE)
    assert stat.S_IMODE(path.stat().st_mode) == PRIVATE_MODE


def test_save_file_writes_into_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        save_file(pipe, "told")
        assert os.read(reader, 100) == b"told"
    finally:
        os.close(reader)
    assert pipe.is_fifo()


def test_a_write_protected_file_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "kept"
    path.write_text("good")
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write everything
    with pytest.raises(PermissionError, match="write-protected"):
        save_file(path, "new")
    assert path.read_text() == "good"


def test_no_module_writes_a_file_of_the_user_in_any_other_way() -> None:
    found = {}
    for folder in ("missions", "behaviours", "drivers", "perception", "config"):
        for module in sorted((ROOT / folder).rglob("*.py")):
            count = len(RAW.findall(module.read_text(encoding="utf-8")))
            name = str(module.relative_to(ROOT))
            if count > NEW_OR_OWN.get(name, 0):
                found[name] = count
    assert found == {}


def test_a_new_file_has_the_mode_of_any_other(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        save_file(tmp_path / "new", "told")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640
