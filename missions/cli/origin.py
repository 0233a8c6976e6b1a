"""Origin of a robot that the user did not name; it is printed with each error about that robot."""

from contextvars import ContextVar
from pathlib import Path

from config.library import DEFAULT_ROBOT, OWN_ROBOT, find_file

_origin: ContextVar[tuple[str, str]] = ContextVar("origin", default=("", ""))
"""The robot in use and where its name came from; empty if the user named the robot."""


def forget_origin() -> None:
    """Reset the origin, at the start of a command."""
    _origin.set(("", ""))


def take_default(robot: str) -> None:
    """Record that ``robot`` comes from the defaults file."""
    from config.defaults import DEFAULTS_FILE, config_folder  # noqa: PLC0415 - most commands name their robot

    ignore = "--robot NAME selects another, `mission robot use --none` removes it"
    _origin.set((robot, f"the robot is '{robot}', this computer's own by {config_folder() / DEFAULTS_FILE}: {ignore}"))


def chosen_robot(robot: str | None) -> str | None:
    """Return the robot for a simulation: ``robot``, else this computer's own; None for the default of MissionTree.

    The origin of an unnamed robot is recorded. Raises InvalidFileError for a defaults file with errors.
    """
    from config.defaults import load_defaults  # noqa: PLC0415 - most commands name their robot

    if robot is None and (default_robot := load_defaults().robot):
        take_default(default_robot)
        return default_robot
    if robot is None:
        robot_file(None)
    return robot


def robot_file(name: str | None, default: str = DEFAULT_ROBOT) -> Path:
    """Return the file of the named robot, or of ``default``; then its origin is recorded. Raises UnknownNameError."""
    if name is None:
        _origin.set((default, f"the robot is '{default}', the default: --robot NAME selects another"))
    elif name == OWN_ROBOT:
        from config.defaults import load_defaults  # noqa: PLC0415 - as above

        if mine := load_defaults().robot:
            take_default(mine)
    return find_file("robots", name or default)


def origin_note(text: str) -> str:
    """Return the origin of the robot if ``text`` is about a robot that the user did not name; empty otherwise."""
    robot, note = _origin.get()
    is_printed = note in text or "mission robot use --none" in text
    return note if robot and (robot in text or "robot" in text) and not is_printed else ""
