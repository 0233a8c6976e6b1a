"""Click types of names (missions, robots, worlds, people...), with their shell completion."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import ClassVar

import click
from click.shell_completion import CompletionItem

from config.diagnostics import InvalidFileError
from config.library import LISTED_KINDS, OWN_ROBOT, SUFFIXES, UnknownNameError, find_file, kinds_of, shipped_files

FILE = "file"
"""Type of a completion item that makes the shell complete file names."""


class NameType(click.ParamType[str]):
    """A name of one of several kinds, or a file; completion offers names, and matching files of the current folder.

    A kind is one of ``config.library.LISTED_KINDS``, "tests", "person" or "behaviour".
    """

    name = "name"

    def __init__(self, *kinds: str) -> None:
        self._kinds = kinds

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the text unchecked; the command looks the name up."""
        del param, ctx
        return str(value)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        del param
        if incomplete.startswith((".", "/", "~")):
            return [CompletionItem(incomplete, type=FILE)]
        found = [*dict.fromkeys(name for kind in self._kinds for name in names_of(kind, ctx)), *self._local_files()]
        fitting = [CompletionItem(name) for name in found if name.startswith(incomplete)]
        return fitting or [CompletionItem(incomplete, type=FILE)]

    def _local_files(self) -> Iterator[str]:
        """Yield the names of the files in the current folder whose kind is one of the kinds of this type."""
        for path in sorted(Path().iterdir()):
            if path.suffix in (*SUFFIXES, ".mcap") and not {*kinds_of(path)}.isdisjoint(self._kinds):
                yield path.name


class ParamsType(click.ParamType[str]):
    """Click type for a param of the mission with its value: ``to=Anna``; completion knows the params of the mission."""

    name = "param"
    VALUES: ClassVar[Mapping[str, str]] = {"person": "person", "gesture": "gestures", "mission": "missions"}
    """Types of params whose values are names, each with the kind of names that completion lists."""

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the text unchecked; the option parses it."""
        del param, ctx
        return str(value)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the matching params, each with "="; after "=", the possible values if they can be listed."""
        del param
        # Commands without params skip this.
        from behaviours.catalogue import LEAVES  # noqa: PLC0415
        from missions.language.document import declared_params  # noqa: PLC0415
        from missions.library.lookups import LOOKUPS  # noqa: PLC0415
        from missions.library.shipped import find_mission  # noqa: PLC0415

        # An option without its value ends click's parsing: the arguments are left over.
        words = [ctx.params.get("name"), ctx.params.get("mission"), *(ctx.params.get("names") or ()), *ctx.args]
        mission = next(filter(None, words), "")
        with suppress(InvalidFileError, UnknownNameError):
            params = declared_params(find_mission(mission), LEAVES, LOOKUPS)
            name, equals, typed = incomplete.partition("=")
            if not equals:
                found = [each for each in params.values() if each.name.startswith(name)]
                return [CompletionItem(f"{each.name}=", help=each.help or each.kind) for each in found]
            if name in params:
                values = self._values(params[name].kind, params[name].type.choices, ctx)
                return [CompletionItem(f"{name}={value}") for value in values if value.startswith(typed)]
        return []

    def _values(self, kind: str, choices: Sequence[str], ctx: click.Context) -> Iterable[str]:
        """Return the possible values of a param of type ``kind``; empty if they cannot be listed."""
        if kind == "flag":
            return ("true", "false")
        return choices or (names_of(self.VALUES[kind], ctx) if kind in self.VALUES else ())


def names_of(kind: str, ctx: click.Context) -> Iterable[str]:
    """Return all names of a kind; imports only the modules of that kind, since a shell completes one at a time."""
    if kind == "missions":
        from missions.library.shipped import shipped_missions  # noqa: PLC0415

        return [*shipped_missions(), *_user_names(kind)]
    if kind == "behaviour":
        from behaviours.catalogue import LEAVES  # noqa: PLC0415

        return LEAVES
    if kind == "person":
        return _people(ctx.params.get("robot"))
    return [*shipped_files(kind), *_user_names(kind)] if kind in (*LISTED_KINDS, "gaits") else ()


def _user_names(kind: str) -> Iterable[str]:
    """Return the names of the user's own files of a kind; for robots also "mine", if a default robot is set."""
    from config.defaults import load_defaults, user_files  # noqa: PLC0415

    with suppress(InvalidFileError, OSError):
        return [*user_files(kind), *([OWN_ROBOT] if kind == "robots" and load_defaults().robot else [])]
    return ()


def _people(robot: str | None) -> Iterable[str]:
    """Return the names of the people that ``robot`` knows; for None, those in the user's data folder."""
    from missions.library.drivers import load_robot  # noqa: PLC0415
    from missions.library.people import PeopleError, people_of  # noqa: PLC0415

    with suppress(PeopleError, UnknownNameError, InvalidFileError):
        camera = None if robot is None else load_robot(find_file("robots", robot)).camera
        if robot is None or camera is not None:
            return [each.name for each in people_of(camera).known_people()]
    return ()


def complete_runs(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the process numbers of this user's runs that begin with ``incomplete``, to complete `mission stop`."""
    del ctx, param
    from missions.control.run_search import search_runs  # noqa: PLC0415

    found = {each.run: "" if each.holder is None else each.holder.name for each in search_runs().processes}
    return [CompletionItem(number, help=name) for number, name in found.items() if number.startswith(incomplete)]


MISSION = NameType("missions")
ROBOT = NameType("robots")
WORLD = NameType("worlds")
GESTURE = NameType("gestures")
GAIT = NameType("gaits")
CONTROLLER = NameType("controllers")
PERSON = NameType("person")
BEHAVIOUR = NameType("behaviour")
TESTED_NAME = NameType("missions", "tests")
SHOWN_NAME = NameType("missions", "records", "behaviour", "worlds", "gaits")
PARAMS = ParamsType()
