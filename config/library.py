"""Where files are found: by name in the folders that ship with MissionTree, or by path."""

from pathlib import Path

from config.faults import did_you_mean
from config.units import seen

HERE = Path(__file__).parent


class UnknownNameError(LookupError):
    """A name that is neither a file nor in the library; the message says what is there."""


def shipped(kind: str) -> dict[str, Path]:
    """Return the files of one kind (``robots``, ``gestures``, ``worlds``, ``controllers``) by name."""
    return {path.stem: path for path in sorted((HERE / kind).glob("*.yaml"))}


def find(kind: str, name: str, *, library: dict[str, Path] | None = None) -> Path:
    """Return the file that ``name`` means: a path where it looks like one or exists, else a name in the library.

    Raises UnknownNameError with the closest name, or all of them.
    """
    known = shipped(kind) if library is None else library
    if name in known:
        return known[name]
    path = Path(name)
    if is_file(path):
        return path
    if path.suffix in (".yaml", ".yml"):
        raise UnknownNameError(f"{seen(name)}: no such file")
    close = did_you_mean(name, known) or f"known are: {', '.join(known)}"
    raise UnknownNameError(f"unknown {kind.removesuffix('s')} {seen(name)}; {close}")


def is_file(path: Path) -> bool:
    """Say whether a file is there that can be asked for."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is too long, a folder that may not be read, a zero in the name
        return False
