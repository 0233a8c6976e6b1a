"""Which files are read at all, and how much of them."""

import os
import socket
from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError
from config.file_io import parse_object, read_regular
from config.library import kinds_of
from config.yaml_nodes import read_source


def test_pipes_devices_and_sockets_are_refused_without_waiting(tmp_path: Path) -> None:
    pipe, plug = tmp_path / "pipe.yaml", tmp_path / "plug"
    os.mkfifo(pipe)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(plug))
        for path in (pipe, plug, Path("/dev/zero"), Path("/dev/null")):
            with pytest.raises(OSError, match="not a regular file"):
                read_regular(path, 100)
    assert kinds_of(pipe) == []
    with pytest.raises(InvalidFileError, match=r"cannot be read: not a regular file"):
        read_source(pipe)


def test_read_regular_is_limited_in_size(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"1234")
    assert read_regular(path, 4) == b"1234"
    with pytest.raises(OSError, match="larger than 3 bytes"):
        read_regular(path, 3)


def test_read_regular_raises_is_a_directory_error_for_a_folder(tmp_path: Path) -> None:
    with pytest.raises(IsADirectoryError):
        read_regular(tmp_path, 1)


@pytest.mark.parametrize("text", ["", "[]", "null", "[" * 100_000, '{"a":' * 100_000, b"\xff", "9" * 5000])
def test_text_that_is_not_a_json_object_raises_value_error(text: str | bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse_object(text)
