"""User defaults for commands, in ``~/.config/missiontree/defaults.yaml``."""

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from config.diagnostics import InvalidFileError, SourceText
from config.fields import fields_of
from config.section_reader import read_keys
from config.yaml_nodes import read_source
from drivers.api.keys import key, keys

DEFAULTS_FILE = "defaults.yaml"

HEADING = "# What `mission` takes where a command names nothing; docs/robots.md says more.\n"


@keys
class DefaultsKeys:
    """Keys of the file with the user's defaults for commands, such as the robot and the world."""

    robot: str = key(
        default="",
        help="This computer's robot, a name or a file: `--robot mine` moves it, other commands simulate it.",
    )
    world: str = key(default="", help="World of simulations, a name or a file.")
    folders: tuple[str, ...] = key(
        default=(),
        help="Folders of yours with `robots/`, `worlds/`, `missions/`, `gestures/`, `controllers/` or `objects/`: "
        "their files are found by name.",
    )
    record: bool = key(
        default=True,
        help="Record runs on a robot, and runs from the studio, by default.",
    )


def home_folder() -> Path:
    """Return the user's home, or a folder that does not exist for a user without one, as in a container."""
    found = Path(os.environ.get("HOME") or _registered_home())
    return found if found.is_absolute() else Path("/nonexistent")


def _registered_home() -> str:
    """Return the home of the user from the system's user database, or an empty text."""
    import pwd  # noqa: PLC0415 - Python in a browser has no list, but HOME

    try:
        return pwd.getpwuid(os.getuid()).pw_dir
    except KeyError:
        return ""


def config_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of the user's own files, following the XDG base directory specification."""
    named = environment.get("XDG_CONFIG_HOME", "")
    return (Path(named) if Path(named).is_absolute() else home_folder() / ".config") / "missiontree"


def load_defaults() -> DefaultsKeys:
    """Return the user's defaults; empty without the file. Raises InvalidFileError with all errors."""
    path = config_folder() / DEFAULTS_FILE
    if not path.is_file():
        return DefaultsKeys()
    source = read_source(path)
    if not _has_content(source.text):
        return DefaultsKeys()
    fields = fields_of(source, subject="the file of defaults")
    found = read_keys(fields, DefaultsKeys)
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return found


def set_default(word: str, value: str) -> Path:
    """Set the default ``word`` in the user's defaults file, and return the path of the file.

    Raises InvalidFileError, NotEditableError, OSError.
    """
    from config.yaml_edit import rewrite, with_value  # noqa: PLC0415 - most commands write no defaults

    load_defaults()
    path = config_folder() / DEFAULTS_FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file():
        path.write_text(HEADING, encoding="utf-8")
    text = path.read_text(encoding="utf-8")
    rewrite(
        path,
        with_value(SourceText(str(path), text), (word,), value) if _has_content(text) else f"{text}{word}: {value}\n",
    )
    return path


def remove_default(word: str) -> Path:
    """Remove the default ``word`` from the user's defaults file; other lines stay. Return the path of the file.

    Raises InvalidFileError, NotEditableError, OSError.
    """
    from config.yaml_edit import rewrite, without_key  # noqa: PLC0415 - most commands write no defaults

    path = config_folder() / DEFAULTS_FILE
    rewrite(path, without_key(read_source(path), word))
    return path


def missing_folders() -> list[str]:
    """Return the folders under ``folders`` in the defaults file that do not exist."""
    return [each for each in load_defaults().folders if not Path(each).expanduser().is_dir()]


def unreadable_folders(kind: str) -> list[str]:
    """Return the user's folders for files of a kind that exist but cannot be read, with the reason."""
    found = list[str]()
    for folder in _folders(kind):
        try:
            next(folder.iterdir(), None)
        except FileNotFoundError:
            continue
        except OSError as error:
            found.append(f"{folder} cannot be read: {error.strerror or error}")
    return found


def _folders(kind: str) -> list[Path]:
    """Return the user's folders for files of a kind, existing or not."""
    return [each / kind for each in (config_folder(), *(Path(each).expanduser() for each in load_defaults().folders))]


def user_files(kind: str) -> dict[str, Path]:
    """Return the user's own files of a kind by name: those beside the defaults, then those in ``folders``.

    Unreadable folders are skipped; ``unreadable_folders`` lists them.
    """
    found: list[Path] = []
    for folder in _folders(kind):
        with suppress(OSError):
            found += [path for path in sorted(folder.iterdir()) if path.suffix == ".yaml"]
    return {path.stem: path for path in reversed(found) if not path.name.endswith(".test.yaml")}


def _has_content(text: str) -> bool:
    """Return True if a YAML text has a line that is neither empty nor a comment."""
    return any(line.strip() and not line.lstrip().startswith("#") for line in text.splitlines())
