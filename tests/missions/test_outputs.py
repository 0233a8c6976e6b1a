"""What is said of files that cannot be written."""

import errno
from pathlib import Path

import click
import pytest

from missions.cli.outputs import report_write_errors


@pytest.mark.parametrize(
    ("number", "cure"),
    [
        (errno.EACCES, "ls -ld {}  (may you write there?)"),
        (errno.ENOSPC, "df -h {}  (is there room?)"),
        (errno.EROFS, "findmnt -T {}  (is the disk read-only?)"),
    ],
)
def test_hint_for_a_write_error_names_an_existing_folder(tmp_path: Path, number: int, cure: str) -> None:
    with pytest.raises(click.BadParameter) as caught, report_write_errors(tmp_path / "not" / "there" / "x.yaml", "-o"):
        raise OSError(number, "no")
    assert caught.value.message.endswith(f"\n  try: {cure.format(tmp_path)}")
