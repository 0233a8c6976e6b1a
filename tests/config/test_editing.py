"""Changing one value in a robot file: that value, and not a byte more."""

import os
import stat
from errno import ENOSPC
from math import radians
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.diagnostics import SourceText
from config.yaml_edit import NotEditableError, rewrite, with_value
from config.yaml_nodes import Mapping, compose
from drivers.arduino.declared import ArduinoKeys
from missions.library.drivers import load_robot
from missions.library.tuning import save_values


def keep_trims(path: Path, pan: float, tilt: float) -> list[str]:
    return save_values(path, {"head.pan.trim": pan, "head.tilt.trim": tilt}, "mission head trim --robot FILE --keep")


ROBOT = """\
# Mine.
robot: mine
head:
  driver: arduino  # on a Nano
  port: /dev/nano
  pan: {servo: 0, trim: 1 deg,  flip: true}   # the horn sits askew

  tilt:
    # wide
    limits: [-1.4 rad, 0.35 rad]
    servo: 1
"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / "mine.yaml"
    path.write_text(ROBOT)
    return path


def edited(text: str, *keys: str, value: str = "3 deg") -> str:
    return with_value(SourceText("mine.yaml", text), keys, value)


def test_existing_value_is_replaced_in_place() -> None:
    assert edited(ROBOT, "head", "pan", "trim") == ROBOT.replace("trim: 1 deg", "trim: 3 deg")
    assert edited("a: {b: '1 deg' }\n", "a", "b") == "a: {b: 3 deg }\n"


def test_missing_value_is_inserted_first() -> None:
    assert edited(ROBOT, "head", "tilt", "trim") == ROBOT.replace("    limits", "    trim: 3 deg\n    limits")
    assert edited("a: {}\n", "a", "b") == "a: {b: 3 deg}\n"
    assert edited("a:\r\n    c: 1\r\n", "a", "b") == "a:\r\n    b: 3 deg\r\n    c: 1\r\n"
    assert edited("a: {\n  c: 1}\n", "a", "b") == "a: {b: 3 deg, \n  c: 1}\n"


@pytest.mark.parametrize("keys", [("arm", "trim"), ("robot", "trim"), ("head", "pan", "servo", "trim"), ("head",)])
def test_missing_section_is_not_editable(keys: tuple[str, ...]) -> None:
    with pytest.raises(NotEditableError, match=r"mine\.yaml: "):
        edited(ROBOT, *keys)


words = st.text("abcd", min_size=1, max_size=4)
leaves = st.one_of(words, st.integers(0, 9).map(str))


@given(st.dictionaries(words, leaves, min_size=1, max_size=5), words, st.sampled_from(["block", "flow"]))
def test_whatever_the_mapping_only_the_one_entry_changes(entries: dict[str, str], key: str, style: str) -> None:
    if style == "flow":
        body = "{" + ", ".join(f"'{name}': {value}" for name, value in entries.items()) + "}"
        text = f"top: {body}\nend: 1\n"
    else:
        text = "top:\n" + "".join(f"  '{name}':   {value}  # why\n" for name, value in entries.items()) + "end: 1\n"
    root = compose(SourceText("x", edited(text, "top", key, value="here")))
    assert isinstance(root, Mapping)
    top = root.get("top")
    assert isinstance(top, Mapping)
    found = {name.text: getattr(value, "text", None) for name, value in top.entries}
    assert found == {**entries, key: "here"}


def test_keep_trims_preserves_permissions_and_symlink(robot: Path, tmp_path: Path) -> None:
    robot.chmod(0o640)
    link = tmp_path / "link.yaml"
    link.symlink_to(robot)
    assert keep_trims(link, radians(-2), radians(45)) == [
        "head: pan: trim: -2 deg",
        "head: tilt: trim: 45 deg",
    ]
    assert link.is_symlink()
    assert stat.S_IMODE(robot.stat().st_mode) == 0o640
    head = load_robot(robot).head
    assert isinstance(head, ArduinoKeys)
    assert (head.pan.trim, head.tilt.trim) == pytest.approx((radians(-2), radians(45)))
    assert robot.read_text() == ROBOT.replace("trim: 1 deg", "trim: -2 deg").replace(
        "    limits", "    trim: 45 deg\n    limits"
    )
    assert {path.name for path in tmp_path.iterdir()} == {"mine.yaml", "link.yaml"}


def test_a_byte_order_mark_and_windows_line_ends_stay(robot: Path) -> None:
    data = b"\xef\xbb\xbf" + ROBOT.replace("\n", "\r\n").encode()
    robot.write_bytes(data)
    keep_trims(robot, radians(3), 0.0)
    assert robot.read_bytes() == data.replace(b"trim: 1 deg", b"trim: 3 deg")


def test_unchanged_trims_leave_the_file_untouched(robot: Path) -> None:
    before = robot.stat().st_mtime_ns
    assert keep_trims(robot, radians(1), 0.0) == []
    assert robot.stat().st_mtime_ns == before


def test_shared_anchor_is_not_edited(robot: Path) -> None:
    text = "robot: mine\nhead:\n  driver: arduino\n  port: /dev/nano\n"
    text += "  pan: {servo: 0, trim: &askew 1 deg}\n  tilt: {servo: 1, trim: *askew}\n"
    robot.write_text(text)
    with pytest.raises(NotEditableError, match=r"write head: pan: trim: 3 deg"):
        keep_trims(robot, radians(3), radians(1))
    assert robot.read_text() == text


def test_a_robot_without_a_head_has_nothing_to_trim(robot: Path) -> None:
    robot.write_text("robot: mine\n")
    with pytest.raises(NotEditableError, match="no head"):
        keep_trims(robot, 0.1, 0.0)


def test_full_disk_is_reported_with_the_file_name(robot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(number: int, _: str) -> object:
        os.close(number)
        raise OSError(ENOSPC, "No space left on device")

    monkeypatch.setattr("config.file_io.os.fdopen", full)
    with pytest.raises(OSError, match="No space left") as raised:
        rewrite(robot, "robot: other\n")
    assert raised.value.filename == str(robot)
    assert [path.name for path in robot.parent.iterdir()] == [robot.name]
