"""Advice for a device that the user may not open: the group to join, or what gives the right where no group does."""

import os
import stat
from collections.abc import Collection
from pathlib import Path

DEVICE_GROUPS = frozenset({"audio", "dialout", "input", "plugdev", "uucp", "video"})
"""The groups that systems made for devices. To join another one, such as root or disk, gives far more away."""


def explain_denied(device: Path, path: str = "", groups: Collection[int] | None = None) -> tuple[str, str]:
    """Return why the user may not open ``device``, and the next command to type.

    ``path`` is the name to show, ``groups`` holds the group numbers of this login; by default those of this process.
    """
    import grp  # noqa: PLC0415 - Python in a browser does not have it

    path = path or str(device)
    try:
        status, group = device.stat(), device.group()
    except (OSError, KeyError):
        return "no permission", f"ls -l {path}"
    if group not in DEVICE_GROUPS or not status.st_mode & stat.S_IRGRP or not status.st_mode & stat.S_IWGRP:
        owner = f"it belongs to {_user(status.st_uid)} alone" if group in (_user(status.st_uid), "root") else (
            f"it belongs to {_user(status.st_uid)} and group {group}, which is not made for devices")  # fmt: skip
        return f"no permission: {owner}", _grant(path, group)
    if status.st_gid in (groups if groups is not None else {os.getegid(), *os.getgroups()}):
        return f"no permission, though you are in its group {group}", f"ls -l {path}"
    if _user(os.geteuid()) in grp.getgrgid(status.st_gid).gr_mem:
        return f"no permission: you have joined its group {group}, but not in this login", "log out, and in again"
    what = f"no permission: it belongs to group {group}, which you are not in"
    return what, f"sudo usermod -a -G {group} $USER  (then log in again)"


def _grant(path: str, group: str) -> str:
    """Return the command that gives the user this one device."""
    if group == "tty":  # a Raspberry Pi gives its serial port to the login console
        return "sudo raspi-config  (Interface Options, Serial Port: no login shell, but the port)"
    return (
        f"sudo setfacl -m u:$USER:rw {path}  (until it is plugged in anew; for good: a rule as in `mission robot udev`)"
    )


def _user(number: int) -> str:
    import pwd  # noqa: PLC0415 - as above

    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return str(number)
