"""Interface of plug-ins: the declaration of an optional feature. See docs/plugins.md.

A plug-in is one ``Plugin`` that names its code by dotted paths, ``package.module:attribute``. The code is imported when
it is used, so the declaring module must not import it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

GROUP = "missiontree.plugins"
"""Entry point group of plug-ins: an entry point has the name of a plug-in, and refers to its ``Plugin``."""

COMMAND_GROUPS = RUN, LOOK, TRY, BACK, SET_UP, BY_HAND = (
    *("Run missions", "Look into them", "Test and simulate"),
    *("Look back", "Set up a robot", "Use it by hand"),
)
"""Headings of our commands in ``mission --help``. Headings of plug-ins come after these."""


class CommandEntry(NamedTuple):
    """Command of a plug-in: heading in ``mission --help``, click command as ``module:name``, and a line of help."""

    group: str
    path: str
    help: str


class FileKind(NamedTuple):
    """Files with one suffix that a plug-in handles: dotted paths of the functions that the core calls.

    ``check`` is ``(path, behaviours) -> str``: return a description for `mission check`; raise InvalidFileError.
    ``drawing`` is ``(path, time) -> TreeDrawing``: the tree for `mission show`, at a time in seconds or None.
    """

    check: str = ""
    drawing: str = ""


@dataclass(frozen=True, slots=True)
class Plugin:
    """Optional feature: a set of commands, options and files.

    ``extra`` is the pip extra with its requirements, and ``needs`` are the plug-ins that it imports. ``commands`` are
    its commands by name; a subcommand has a space in its name: ``record replay``. ``run_options`` is the path of a
    dataclass that extends ``missions.request.RunOptions``: options for `mission run`. ``run_context`` is the path of a
    function ``(options, session) -> context manager``. Its context is entered after the mission was checked and before
    anything moves, if the user gives one of the options; ``session`` is a ``missions.cli.session.RunSession``.
    ``file_kinds`` are its kinds of files by suffix, such as ``.mcap``. ``services`` are functions that the core calls
    by name (``missions.library.plugins.service``); only our own plug-ins can have them.
    """

    name: str
    extra: str = ""
    needs: tuple[str, ...] = ()
    commands: Mapping[str, CommandEntry] = field(default_factory=dict)
    run_options: str = ""
    run_context: str = ""
    file_kinds: Mapping[str, FileKind] = field(default_factory=dict)
    services: Mapping[str, str] = field(default_factory=dict)
