"""The names that a command line takes (missions, robots, worlds, people...), with what a shell completes them to."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import ClassVar

import click
from click.shell_completion import CompletionItem

from config.faults import InvalidFileError
from config.library import LISTED, MINE, SUFFIXES, UnknownNameError, find, kinds_of, shipped

FILE = "file"
"""What tells the shell to complete the names of files itself."""


class Name(click.ParamType[str]):
    """A name of one of some kinds, or a file: the shell is offered the names, and the files of that kind that are here.

    A kind is one of ``config.library.LISTED``, "tests", "person" or "behaviour".
    """

    name = "name"

    def __init__(self, *kinds: str) -> None:
        self._kinds = kinds

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the text: whether there is such a thing, the command finds out."""
        del param, ctx
        return str(value)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return what the text may become."""
        del param
        if incomplete.startswith((".", "/", "~")):
            return [CompletionItem(incomplete, type=FILE)]
        found = [*dict.fromkeys(name for kind in self._kinds for name in names_of(kind, ctx)), *self._here()]
        fitting = [CompletionItem(name) for name in found if name.startswith(incomplete)]
        return fitting or [CompletionItem(incomplete, type=FILE)]

    def _here(self) -> Iterator[str]:
        """Yield the files of this folder that are of its kinds."""
        for path in sorted(Path().iterdir()):
            if path.suffix in (*SUFFIXES, ".mcap") and not {*kinds_of(path)}.isdisjoint(self._kinds):
                yield path.name


class Params(click.ParamType[str]):
    """A param of the mission of this command line, and its value: ``to=Anna``."""

    name = "param"
    VALUES: ClassVar[Mapping[str, str]] = {"person": "person", "gesture": "gestures", "mission": "missions"}
    """The types of params whose values are names, and of what."""

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the text, which the option reads."""
        del param, ctx
        return str(value)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the params that begin so, each with "=" behind it; behind "=", its values where they are names."""
        del param
        # Commands without params need none of this.
        from behaviours.catalogue import LEAVES  # noqa: PLC0415
        from missions.language.document import declared_params  # noqa: PLC0415
        from missions.library.shipped import find_mission  # noqa: PLC0415
        from missions.library.things import THINGS  # noqa: PLC0415

        # An option that waits for its value ends click's parsing: the arguments are left over, then.
        given = [ctx.params.get("name"), ctx.params.get("mission"), *(ctx.params.get("names") or ()), *ctx.args]
        mission = next(filter(None, given), "")
        with suppress(InvalidFileError, UnknownNameError):
            params = declared_params(find_mission(mission), LEAVES, THINGS)
            name, equals, begun = incomplete.partition("=")
            if not equals:
                found = [each for each in params.values() if each.name.startswith(name)]
                return [CompletionItem(f"{each.name}=", help=each.help or each.kind) for each in found]
            if name in params:
                values = self._values(params[name].kind, params[name].type.choices, ctx)
                return [CompletionItem(f"{name}={value}") for value in values if value.startswith(begun)]
        return []

    def _values(self, kind: str, choices: Sequence[str], ctx: click.Context) -> Iterable[str]:
        """Return the values that a param can have, where they can be listed."""
        if kind == "flag":
            return ("true", "false")
        return choices or (names_of(self.VALUES[kind], ctx) if kind in self.VALUES else ())


def names_of(kind: str, ctx: click.Context) -> Iterable[str]:
    """Return all names of a kind. What a kind needs is imported here: a shell asks for one of them."""
    if kind == "missions":
        from missions.library.shipped import shipped_missions  # noqa: PLC0415

        return [*shipped_missions(), *_own(kind)]
    if kind == "behaviour":
        from behaviours.catalogue import LEAVES  # noqa: PLC0415

        return LEAVES
    if kind == "person":
        return _people(ctx.params.get("robot"))
    return [*shipped(kind), *_own(kind)] if kind in (*LISTED, "gaits") else ()


def _own(kind: str) -> Iterable[str]:
    """Return the names of the user's own files of a kind, and that of this computer's robot."""
    from config.defaults import load_defaults, own_files  # noqa: PLC0415

    with suppress(InvalidFileError, OSError):
        return [*own_files(kind), *([MINE] if kind == "robots" and load_defaults().robot else [])]
    return ()


def _people(robot: str | None) -> Iterable[str]:
    """Return the names of those whom a robot, or this user, knows."""
    from missions.library.drivers import load_robot  # noqa: PLC0415
    from missions.library.people import PeopleError, people_of  # noqa: PLC0415

    with suppress(PeopleError, UnknownNameError, InvalidFileError):
        camera = None if robot is None else load_robot(find("robots", robot)).camera
        if robot is None or camera is not None:
            return [each.name for each in people_of(camera).known()]
    return ()


def runs(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return what runs on this machine, by the numbers of the processes: for `mission stop`."""
    del ctx, param
    from missions.control.searching import search  # noqa: PLC0415

    found = {each.run: "" if each.holder is None else each.holder.name for each in search().found}
    return [CompletionItem(number, help=name) for number, name in found.items() if number.startswith(incomplete)]


MISSION = Name("missions")
ROBOT = Name("robots")
WORLD = Name("worlds")
GESTURE = Name("gestures")
GAIT = Name("gaits")
CONTROLLER = Name("controllers")
PERSON = Name("person")
BEHAVIOUR = Name("behaviour")
TESTED = Name("missions", "tests")
SHOWN = Name("missions", "records", "behaviour", "worlds", "gaits")
PARAMS = Params()
