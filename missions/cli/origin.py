"""Origin of the robot that a command took because the user named none: printed beside every error about it."""

from contextvars import ContextVar
from pathlib import Path

from config.library import DEFAULT_ROBOT, OWN_ROBOT, find_file

_origin: ContextVar[tuple[str, str]] = ContextVar("origin", default=("", ""))
"""The robot that was taken, and where its name came from; empty while one was named."""


def forget_origin() -> None:
    """Forget which robot was taken: another command begins."""
    _origin.set(("", ""))


def take_default(robot: str) -> None:
    """Remember that ``robot`` was taken from the file of defaults."""
    from config.defaults import DEFAULTS_FILE, config_folder  # noqa: PLC0415 - most commands name their robot

    ignore = "--robot NAME takes another, `mission robot use --none` forgets it"
    _origin.set((robot, f"the robot is '{robot}', this computer's own by {config_folder() / DEFAULTS_FILE}: {ignore}"))


def chosen_robot(robot: str | None) -> str | None:
    """Return the robot that a simulation takes: the named one, else this computer's own; None for the one that ships.

    One that was not named is remembered with its origin. Raises InvalidFileError for a wrong file of defaults.
    """
    from config.defaults import load_defaults  # noqa: PLC0415 - most commands name their robot

    if robot is None and (own := load_defaults().robot):
        take_default(own)
        return own
    if robot is None:
        robot_file(None)
    return robot


def robot_file(name: str | None, default: str = DEFAULT_ROBOT) -> Path:
    """Return the file of the named robot, else of ``default``; then its origin is remembered.

    Raises UnknownNameError.
    """
    if name is None:
        _origin.set((default, f"the robot is '{default}', for no other was named: --robot NAME takes another"))
    elif name == OWN_ROBOT:
        from config.defaults import load_defaults  # noqa: PLC0415 - as above

        if mine := load_defaults().robot:
            take_default(mine)
    return find_file("robots", name or default)


def origin_note(text: str) -> str:
    """Return where the robot came from, if ``text`` is about a robot that the user did not name; empty otherwise."""
    robot, note = _origin.get()
    told = note in text or "mission robot use --none" in text
    return note if robot and (robot in text or "robot" in text) and not told else ""
