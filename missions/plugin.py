"""The interface of a plug-in: what an optional feature adds to MissionTree. See docs/plugins.md.

A plug-in is one ``Plugin``: a declaration that names its code by dotted paths, ``package.module:attribute``. The code
is imported when it is used, so the module that declares a plug-in must import nothing else of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

GROUP = "missiontree.plugins"
"""The entry points by which distributions offer plug-ins: the name of the plug-in, and its ``Plugin``."""

COMMAND_GROUPS = RUN, LOOK, TRY, BACK, SET_UP, BY_HAND = (
    *("Run missions", "Look into them", "Try them in simulated time"),
    *("Look back", "Set up a robot", "Use it by hand"),
)
"""The headings of ``mission --help``. A plug-in may name another, which comes after these."""


class CommandEntry(NamedTuple):
    """A command: its heading in ``mission --help``, its click command as ``module:name``, and a line of help."""

    group: str
    path: str
    help: str


class FileKind(NamedTuple):
    """Files that end alike: what the core does with them, as dotted paths.

    ``check`` is ``(path, behaviours) -> str``: return what is in the file, for `mission check`; raise InvalidFileError.
    ``drawing`` is ``(path, time) -> Drawing``: the tree to show, at a time in seconds or None, for `mission show`.
    """

    check: str = ""
    drawing: str = ""


@dataclass(frozen=True, slots=True)
class Plugin:
    """An optional feature.

    ``extra`` is the pip extra that installs what it needs, and ``needs`` are the plug-ins that it imports.
    ``commands`` are its commands by name; the name of one below another has a space: ``record replay``.
    ``run_options`` is a dataclass that extends ``missions.options.RunOptions``: what it adds to `mission run`.
    ``run_context`` is ``(options, session) -> context manager``, entered around a run that asks for it, after the
    mission was checked and before anything moves; ``session`` is a ``missions.cli.session.RunSession``.
    ``file_kinds`` are its kinds of files by ending, ``.mcap``. ``services`` are hooks of the core by name, which only
    our own plug-ins may fill: ``missions.library.plugins.service``.
    """

    name: str
    extra: str = ""
    needs: tuple[str, ...] = ()
    commands: Mapping[str, CommandEntry] = field(default_factory=dict)
    run_options: str = ""
    run_context: str = ""
    file_kinds: Mapping[str, FileKind] = field(default_factory=dict)
    services: Mapping[str, str] = field(default_factory=dict)
