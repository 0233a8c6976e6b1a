"""The library: files by name, or by path."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.library import UnknownNameError, find_file, kinds_of, shipped_files

KINDS = ("robots", "gestures", "worlds", "controllers")


@pytest.mark.parametrize("kind", KINDS)
def test_shipped_files_are_found_by_name(kind: str) -> None:
    library = shipped_files(kind)
    assert library
    assert list(library) == sorted(library)
    for name, path in library.items():
        assert find_file(kind, name) == path
        assert path.is_file()


def test_file_is_found_by_path(tmp_path: Path) -> None:
    with_suffix, without = tmp_path / "mine.yaml", tmp_path / "mine"
    for file in (with_suffix, without):
        file.write_text("robot: mine\n", encoding="utf-8")
        assert find_file("robots", str(file)) == file


def test_the_library_comes_before_a_file_of_the_same_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("hello").write_text("gesture: mine\n", encoding="utf-8")
    assert find_file("gestures", "hello") == shipped_files("gestures")["hello"]


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
def test_unknown_name_lists_the_available_ones(name: str, message: str) -> None:
    library = {"hello": Path("hello.yaml"), "wave": Path("wave.yaml")}
    with pytest.raises(UnknownNameError) as caught:
        find_file("gestures", name, library=library)
    assert caught.value.args[0] == message


def test_irregular_file_is_reported_as_such(folder: Path) -> None:
    os.mkfifo(folder / "pipe.yaml")
    (folder / "folder.yaml").mkdir()
    (folder / "loop.yaml").symlink_to("loop.yaml")
    (folder / "device.yaml").symlink_to("/dev/zero")
    for name in ("pipe.yaml", "folder.yaml", "loop.yaml", "device.yaml"):
        with pytest.raises(UnknownNameError, match=rf"^'{name}': not a regular file$"):
            find_file("gestures", name, library={})


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that the user is in, with a file of each of three kinds."""
    monkeypatch.chdir(tmp_path)
    for name, text in {
        "ask.yaml": "mission: ask\ntree: succeed\n",
        "home.yaml": "# mine\nworld: home\nroom: {}\n",
        "gestures/nicken.yaml": "gesture: nicken\n",
        "ask.test.yaml": "tests: ask\ncases: []\n",
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "ask.mcap").write_bytes(b"\x89MCAP0\r\n")
    return tmp_path


MISSIONS = {name: Path(name) for name in ("greet", "asking", "patrol", "patrol_two", "wander", "wave")}


def said_of(kind: str, name: str, *, library: dict[str, Path] | None = None, beside: Path = Path()) -> str:
    with pytest.raises(UnknownNameError) as caught:
        find_file(kind, name, library=library, folder=beside)
    return str(caught.value.args[0])


@pytest.mark.parametrize(
    ("kind", "name", "said"),
    [
        ("missions", "ask", "unknown mission 'ask'; did you mean the file 'ask.yaml'?"),
        ("worlds", "home", "unknown world 'home'; did you mean the file 'home.yaml'?"),
        ("worlds", "home.yml", "'home.yml': no such file; did you mean the file 'home.yaml'?"),
        ("worlds", "hoem.yaml", "'hoem.yaml': no such file; did you mean the file 'home.yaml'?"),
        ("missions", "hoem.yaml", "'hoem.yaml': no such file"),
        ("missions", "greet.yaml", "'greet.yaml': no such file; did you mean 'greet'?"),
        ("missions", "gone.mcap", "'gone.mcap': no such file"),
        ("missions", "trol", "unknown mission 'trol'; did you mean one of patrol, patrol_two?"),
        ("missions", "ander", "unknown mission 'ander'; did you mean 'wander'?"),
        ("gestures", "nicken", "unknown gesture 'nicken'; did you mean the file 'gestures/nicken.yaml'?"),
        ("missions", "aks", "unknown mission 'aks'; did you mean the file 'ask.yaml'?"),
        ("worlds", "hoem", "unknown world 'hoem'; did you mean the file 'home.yaml'?"),
        ("missions", "xyzzy", "unknown mission 'xyzzy'; `mission list missions` has all"),
    ],
)
def test_misspelt_name_gives_a_suggestion(folder: Path, kind: str, name: str, said: str) -> None:
    del folder
    assert said_of(kind, name, library=MISSIONS if kind == "missions" else None) == said


def test_suggestions_are_limited_to_five(folder: Path) -> None:
    del folder
    many = {f"patrol_{number}": Path("x") for number in range(9)}
    said = said_of("missions", "trol", library=many)
    assert said.count("patrol_") == 5
    assert said.endswith("; `mission list missions` has more")


def test_file_is_found_beside_the_referring_file(folder: Path) -> None:
    assert said_of("missions", "ask", library={}, beside=folder).endswith("did you mean the file 'ask.yaml'?")
    assert find_file("missions", "ask.yaml", library={}, folder=folder) == folder / "ask.yaml"


@pytest.mark.parametrize(
    ("kind", "name", "said"),
    [
        ("missions", "home.yaml", "home.yaml is a world: mission show home.yaml, or mission run MISSION --world"),
        ("missions", "ask.test.yaml", "ask.test.yaml is a test: mission test ask.test.yaml"),
        ("missions", "ask.mcap", "ask.mcap is a record: mission record replay ask.mcap"),
        ("worlds", "ask.yaml", "ask.yaml is a mission: mission run ask.yaml"),
        ("robots", "home.yaml", "home.yaml is a world: "),
        ("missions", "home.yml", "'home.yml': no such file; home.yaml is a world: "),
    ],
)
def test_file_of_another_kind_is_reported_with_its_use(folder: Path, kind: str, name: str, said: str) -> None:
    del folder
    assert said_of(kind, name).startswith(said)


@pytest.mark.parametrize("text", ["", "sumary: a world: of things\n", "{mission: m}", "tree:\n  world: x\n", "\xff"])
def test_file_without_a_kind_is_accepted_as_the_requested_kind(folder: Path, text: str) -> None:
    (folder / "x.yaml").write_bytes(text.encode("latin-1"))
    assert find_file("worlds", "x.yaml") == Path("x.yaml")


def test_file_with_its_kind_key_may_have_other_keys(folder: Path) -> None:
    (folder / "x.yaml").write_text("robot: marvin\nworld: x\n", encoding="utf-8")
    assert find_file("worlds", "x.yaml") == Path("x.yaml")


@pytest.mark.parametrize("kind", [*KINDS, "objects"])
def test_shipped_files_have_the_right_kind(kind: str) -> None:
    assert {tuple(kinds_of(path)[:1]) for path in shipped_files(kind).values()} == {(kind,)}


@given(st.text())
def test_any_name_is_a_file_or_unknown(name: str) -> None:
    try:
        found = find_file("gestures", name)
    except UnknownNameError:
        found = None
    assert found is None or found.is_file()
