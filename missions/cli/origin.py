"""Origin of a robot that the user did not name; it is printed with each error about that robot."""

from contextvars import ContextVar
from pathlib import Path

from config.library import DEFAULT_ROBOT, OWN_ROBOT, find_file

_origin: ContextVar[tuple[str, str]] = ContextVar("origin", default=("", ""))
"""The default robot in use and a note on where its name is set; both empty if the user named the robot."""


def forget_origin() -> None:
    """Forget where the name of the robot came from, at the start of a command."""
    _origin.set(("", ""))


OTHER_ROBOT = "--robot NAME selects another"
"""Hint how to select another robot, for a command in which ``--robot`` does not decide whether hardware moves."""

OTHER_SIMULATED_ROBOT = "--robot NAME --simulate selects another"
"""Hint how to select another robot, for a command that simulates unless the user names a robot.

It includes ``--simulate``, since ``--robot`` alone would move hardware.
"""

OTHER_ROBOT_OF_TESTS = "`with: {robot: NAME}` in the test file selects another"
"""Hint how to select another robot, for `mission test`, which has no ``--robot``."""


def take_default(robot: str, other: str = OTHER_ROBOT) -> None:
    """Record for error messages that ``robot`` comes from the defaults file.

    ``other`` is the hint how to select another robot.
    """
    from config.defaults import DEFAULTS_FILE, config_folder  # noqa: PLC0415 - most commands name their robot

    ignore = f"{other}, `mission robot use --none` removes it"
    _origin.set((robot, f"the robot is '{robot}', this computer's own by {config_folder() / DEFAULTS_FILE}: {ignore}"))


def chosen_robot(robot: str | None, other: str = OTHER_ROBOT) -> str | None:
    """Return the robot for a simulation: ``robot``, else this computer's own; None for the default of MissionTree.

    If ``robot`` is None, the function also stores for error messages where the name of the robot was set. ``other`` is
    the hint in these messages how to select another robot. Raises InvalidFileError for a defaults file with errors.
    """
    from config.defaults import load_defaults  # noqa: PLC0415 - most commands name their robot

    if robot is None and (default_robot := load_defaults().robot):
        take_default(default_robot, other)
        return default_robot
    if robot is None:
        robot_file(None, other=other)
    return robot


def robot_file(name: str | None, default: str = DEFAULT_ROBOT, other: str = OTHER_ROBOT) -> Path:
    """Return the file of the robot ``name``. Raises UnknownNameError.

    Without a name, return the file of ``default``, and record its origin for error messages.
    """
    if name is None:
        _origin.set((default, f"the robot is '{default}', the default: {other}"))
    elif name == OWN_ROBOT:
        from config.defaults import load_defaults  # noqa: PLC0415 - as above

        if mine := load_defaults().robot:
            take_default(mine)
    return find_file("robots", name or default)


def origin_note(text: str) -> str:
    """Return a note that says where the default robot was set, if the error ``text`` is about that robot.

    Empty if the user named the robot, or if the text is not about a robot.
    """
    robot, note = _origin.get()
    is_printed = note in text or "mission robot use --none" in text
    return note if robot and (robot in text or "robot" in text) and not is_printed else ""
