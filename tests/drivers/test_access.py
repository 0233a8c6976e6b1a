"""What the user is told to type for a device that may not be opened."""

import grp
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from drivers.transport.programs import DEVICE_GROUPS, explain_denied

GID = 54321
"""The number of the group that the device of a test belongs to."""


@pytest.fixture
def device(tmp_path: Path) -> Path:
    path = tmp_path / "ttyUSB0"
    path.touch()
    path.chmod(0o660)
    return path


def belongs(monkeypatch: pytest.MonkeyPatch, device: Path, group: str, members: tuple[str, ...] = ()) -> None:
    """Let the device belong to a group that has those members."""
    status = device.stat()
    asked = SimpleNamespace(st_mode=status.st_mode, st_uid=status.st_uid, st_gid=GID)
    monkeypatch.setattr(Path, "stat", lambda _: asked)
    monkeypatch.setattr(Path, "group", lambda _: group)
    monkeypatch.setattr(grp, "getgrgid", lambda _: SimpleNamespace(gr_mem=list(members)))


@pytest.mark.parametrize("group", sorted(DEVICE_GROUPS))
def test_device_group_is_suggested(monkeypatch: pytest.MonkeyPatch, device: Path, group: str) -> None:
    belongs(monkeypatch, device, group)
    what, cure = explain_denied(device)
    assert what == f"no permission: it belongs to group {group}, which you are not in"
    assert cure == f"sudo usermod -a -G {group} $USER  (then log in again)"


@pytest.mark.parametrize("group", ["root", "disk", "kmem", "sudo", "docker", "shadow", "adm", "robots"])
def test_other_groups_are_not_suggested(monkeypatch: pytest.MonkeyPatch, device: Path, group: str) -> None:
    belongs(monkeypatch, device, group)
    what, cure = explain_denied(device, "/dev/ttyUSB0")
    assert "usermod" not in cure
    assert cure.startswith("sudo setfacl -m u:$USER:rw /dev/ttyUSB0  ")
    assert group in what


def test_login_console_port_suggests_raspi_config(monkeypatch: pytest.MonkeyPatch, device: Path) -> None:
    belongs(monkeypatch, device, "tty")
    assert explain_denied(device)[1].startswith("sudo raspi-config")


def test_group_without_access_is_not_suggested(monkeypatch: pytest.MonkeyPatch, device: Path) -> None:
    device.chmod(0o600)
    belongs(monkeypatch, device, "dialout")
    assert explain_denied(device)[1].startswith("sudo setfacl")


def test_user_who_joined_the_group_must_log_in_again(monkeypatch: pytest.MonkeyPatch, device: Path) -> None:
    me = next(each for each in (os.environ.get("USER"), "root") if each)
    monkeypatch.setattr("drivers.transport.programs._user_name", lambda _: me)
    belongs(monkeypatch, device, "dialout", (me,))
    assert explain_denied(device) == (
        "no permission: you have joined its group dialout, but not in this login", "log out, and in again"
    )  # fmt: skip


def test_member_of_the_group_is_not_told_to_join(monkeypatch: pytest.MonkeyPatch, device: Path) -> None:
    belongs(monkeypatch, device, "video")
    what, cure = explain_denied(device, groups={GID})
    assert (what, cure) == ("no permission, though you are in its group video", f"ls -l {device}")


def test_vanished_device_suggests_ls(tmp_path: Path) -> None:
    assert explain_denied(tmp_path / "gone") == ("no permission", f"ls -l {tmp_path / 'gone'}")
