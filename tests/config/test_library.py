"""The library: files by name, or by path."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.library import UnknownNameError, find, shipped

KINDS = ("robots", "gestures", "worlds", "controllers")


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_ships_files_that_are_found_by_name(kind: str) -> None:
    library = shipped(kind)
    assert library
    assert list(library) == sorted(library)
    for name, path in library.items():
        assert find(kind, name) == path
        assert path.is_file()


def test_a_file_is_found_by_its_path(tmp_path: Path) -> None:
    with_suffix, without = tmp_path / "mine.yaml", tmp_path / "mine"
    for file in (with_suffix, without):
        file.write_text("robot: mine\n", encoding="utf-8")
        assert find("robots", str(file)) == file


def test_the_library_comes_before_a_file_of_the_same_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("hello").write_text("gesture: mine\n", encoding="utf-8")
    assert find("gestures", "hello") == shipped("gestures")["hello"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("helo", "unknown gesture 'helo'; did you mean 'hello'?"),
        ("xyz", "unknown gesture 'xyz'; known are: hello, wave"),
        ("", "unknown gesture ''; known are: hello, wave"),
        ("gone.yaml", "'gone.yaml': no such file"),
        ("gone.yml", "'gone.yml': no such file"),
        ("a\0b", "unknown gesture 'a\0b'; known are: hello, wave"),
        ("x" * 5000, f"unknown gesture '{'x' * 60}...'; known are: hello, wave"),
    ],
)
def test_an_unknown_name_says_what_there_is(name: str, message: str) -> None:
    library = {"hello": Path("hello.yaml"), "wave": Path("wave.yaml")}
    with pytest.raises(UnknownNameError) as caught:
        find("gestures", name, library=library)
    assert caught.value.args[0] == message


@given(st.text())
def test_any_name_is_a_file_or_unknown(name: str) -> None:
    try:
        found = find("gestures", name)
    except UnknownNameError:
        found = None
    assert found is None or found.is_file()
