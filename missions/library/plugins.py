"""Plug-ins of MissionTree (``missions.plugins``) and of other distributions.

Those of other distributions are searched if a command or a file belongs to none of ours, or if all plug-ins are listed.
Their declarations are first imported in a separate process. A broken plug-in is skipped with a warning on stderr.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from config.diagnostics import InvalidInputError
from missions.library.import_trial import (
    BrokenEntryPointError,
    describe_entry_point,
    entry_points_of,
    error_text,
    load_entry_point,
    owner_of,
    short_repr,
)
from missions.plugin import GROUP, CommandEntry, FileKind, Plugin

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

BUILT_IN = "missions.plugins"
"""Package of our own plug-ins, which lists them as ``PLUGINS``. The core works without it."""


class BrokenPluginError(InvalidInputError):
    """A plug-in whose code cannot be loaded; the message has its name and the reason."""


@cache
def built_in_plugins() -> Mapping[str, Plugin]:
    """Return our own plug-ins by name; empty if the package was removed."""
    if find_spec(BUILT_IN) is None:
        return {}
    return {plugin.name: plugin for plugin in import_module(BUILT_IN).PLUGINS}


@cache
def installed_plugins() -> Mapping[str, Plugin]:
    """Return the plug-ins of other distributions by name; warn once of each broken one."""
    found: dict[str, Plugin] = {}
    waiting: list[tuple[EntryPoint, Plugin]] = []
    for point in entry_points_of(GROUP):
        try:
            waiting.append((point, _load_declaration(point)))
        except BrokenEntryPointError as error:
            _warn(point, str(error))
    while waiting:  # a plug-in may need one that comes later in the list
        ready = [each for each in waiting if not _missing_needs(each[1], found)]
        for point, plugin in ready or waiting:
            if why := _conflict(plugin, [*built_in_plugins().values(), *found.values()]) if ready else "":
                _warn(point, why)
            elif ready:
                found[plugin.name] = plugin
            else:
                _warn(point, f"needs the plug-in {', '.join(_missing_needs(plugin, found))}, which is not installed")
        waiting = [each for each in waiting if ready and each not in ready]
    return found


def _load_declaration(point: "EntryPoint") -> Plugin:
    """Import the declaration of a plug-in. Raises BrokenEntryPointError."""
    found = load_entry_point(point)
    if not issubclass(type(found), Plugin):
        raise BrokenEntryPointError(f"is {short_repr(found)}, not a missions.plugin.Plugin")
    plugin: Plugin = found
    if plugin.name != point.name:
        raise BrokenEntryPointError(f"declares the plug-in '{plugin.name}': both must have the same name")
    for name in ("commands", "file_kinds"):
        if not isinstance(getattr(plugin, name), Mapping):
            raise BrokenEntryPointError(f"has {name} that are not a mapping")
    return plugin


def _missing_needs(plugin: Plugin, found: Mapping[str, Plugin]) -> list[str]:
    return [name for name in plugin.needs if name not in found and name not in built_in_plugins()]


def _conflict(plugin: Plugin, others: Iterable[Plugin]) -> str:
    """Return an error if another plug-in has the same name, command or file suffix; empty if there is none."""
    for other in others:
        if plugin.name == other.name:
            return f"a plug-in '{plugin.name}' exists already"
        for kind, mine, theirs in (
            ("command", plugin.commands, other.commands),
            ("kind of file", plugin.file_kinds, other.file_kinds),
        ):
            if duplicates := sorted(mine.keys() & theirs.keys()):
                return f"its {kind} '{duplicates[0]}' is taken by the plug-in '{other.name}'"
    return ""


def _warn(point: "EntryPoint", why: str) -> None:
    owner = owner_of(point)
    hint = f"\n  try: repair or uninstall {owner}" if owner else ""
    sys.stderr.write(f"mission: skipped plug-in {describe_entry_point(point)}: {why}{hint}\n")


def plugins() -> Iterator[Plugin]:
    """Yield all plug-ins, our own first; those of other distributions are loaded when they are reached."""
    yield from built_in_plugins().values()
    yield from installed_plugins().values()


def load(plugin: Plugin, path: str) -> Any:
    """Import the object at a dotted path of a plug-in.

    Raises BrokenPluginError; errors of our own plug-ins are raised unchanged, except a missing package.
    """
    module, _, attribute = path.partition(":")
    try:
        return getattr(import_module(module), attribute)
    except Exception as error:
        if plugin.name in built_in_plugins() and not isinstance(error, ModuleNotFoundError):
            raise
        hint = f"\n  try: pip install 'missiontree[{plugin.extra}]'" if plugin.extra else ""
        raise BrokenPluginError(f"the plug-in '{plugin.name}' cannot be loaded: {error_text(error)}{hint}") from error


def find_command(name: str) -> tuple[Plugin, CommandEntry] | None:
    """Return the plug-in with a command, and the command; None if there is none."""
    return next(((each, each.commands[name]) for each in plugins() if name in each.commands), None)


def find_file_kind(name: str) -> tuple[Plugin, FileKind] | None:
    """Return the plug-in that handles files with the suffix of ``name``, and its file kind; None if there is none."""
    found = ((each, kind) for each in plugins() for ending, kind in each.file_kinds.items() if name.endswith(ending))
    return next(found, None)


def service(name: str) -> Any:
    """Return the object that one of our plug-ins offers to the core as ``name``; None if there is no such plug-in.

    Plug-ins of other distributions are not searched: the thread that handles stops calls this function and must not
    wait. Raises BrokenPluginError.
    """
    found = next((each for each in built_in_plugins().values() if name in each.services), None)
    return None if found is None else load(found, found.services[name])
