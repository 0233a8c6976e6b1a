"""Entry point of the ``mission`` command.

Our packages have plain names (``config``, ``drivers``...) that other modules may shadow: a ``config.py`` in the working
directory, a ROS ``PYTHONPATH``, another distribution. So each package is checked before it is used.
"""

import gc
import json
import os
import signal
import sys
from collections.abc import Iterable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

if TYPE_CHECKING:
    from importlib.metadata import Distribution

EXIT_INTERRUPTED = 130

PACKAGES = ("missions", "behaviours", "drivers", "perception", "config")


DISTRIBUTION = "missiontree"
"""Name of our distribution on the package index."""


def shadowed_packages() -> dict[str, str]:
    """Return our packages that another module shadows, each with a description of that module."""
    found = {}
    for name in PACKAGES:
        try:
            package = import_module(name)
        except Exception as error:
            found[name] = f"{type(error).__name__}: {error}"
            continue
        if getattr(package, "__project__", None) != DISTRIBUTION:
            found[name] = f"found {getattr(package, '__file__', None) or 'a folder without __init__.py'}"
    return found


def shadowing_fixes(hidden: Iterable[str]) -> list[str]:
    """Return pip commands, or advice, that make the ``hidden`` packages of ours importable again."""
    from importlib import metadata  # noqa: PLC0415 - only where something is wrong

    others: dict[str, None] = {}
    again, advice = False, dict[str, None]()
    for name in hidden:
        file = _file(name)
        owners = metadata.packages_distributions().get(name, ())
        rivals = [
            owner for owner in owners if owner != DISTRIBUTION and _contains_file(metadata.distribution(owner), file)
        ]
        again = again or (DISTRIBUTION in owners and _contains_file(metadata.distribution(DISTRIBUTION), file))
        others |= dict.fromkeys(rivals)
        if not rivals and not again:
            advice[_stray_module_fix(file)] = None
    pip = f"{sys.executable} -m pip"
    commands = [f"{pip} uninstall {' '.join(others)}"] if others else []
    return [*commands, *([f"{pip} install --force-reinstall --no-deps {_origin()}"] if again else []), *advice]


def _file(name: str) -> Path:
    """Return the file or folder that Python imports under the module name ``name``."""
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        return Path(name)
    return Path(spec.origin or next(iter(spec.submodule_search_locations or [name])))


def _contains_file(distribution: "Distribution", file: Path) -> bool:
    """Return True if ``file`` is inside the folder in which ``distribution`` is installed."""
    return Path(str(distribution.locate_file(""))) in file.parents


def _origin() -> str:
    """Return the folder or file that our distribution was installed from; its name if it came from an index."""
    from importlib import metadata  # noqa: PLC0415 - see ``shadowing_fixes``

    direct_url = metadata.distribution(DISTRIBUTION).read_text("direct_url.json")
    url = str(json.loads(direct_url)["url"]) if direct_url else ""
    return unquote(url.removeprefix("file://")) if url.startswith("file://") else DISTRIBUTION


def _stray_module_fix(file: Path) -> str:
    """Return the fix for the module ``file``, which no distribution contains: rename it, or unset PYTHONPATH."""
    entries = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    if any(entry and Path(entry).resolve() in file.parents for entry in entries):
        return "unset PYTHONPATH"
    if Path.cwd() in file.parents:
        return f"rename {file}, or run mission in another folder"
    return f"rename {file}"


def main() -> None:
    """Run the ``mission`` command, unless another module shadows one of our packages."""
    try:
        _main()
    except KeyboardInterrupt:  # before or after the command, which has its own way of stopping
        sys.exit(EXIT_INTERRUPTED)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done: a second Ctrl-C has nothing left to interrupt


def _main() -> None:
    gc.disable()  # while modules are imported, which stay; `missions.cli.root` takes it up again
    # The threads of numpy's OpenBLAS look for work for 2 ** 26 ticks (some 60 ms each, at the start and after each
    # piece of work) before they sleep; so they sleep at once.
    os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")
    problems = shadowed_packages()
    if problems:
        lines = [f"  {name}: {found}" for name, found in problems.items()]
        tried = [f"  {'then' if place else 'try'}: {cure}" for place, cure in enumerate(shadowing_fixes(problems))]
        sys.exit("\n".join(["mission: another module shadows a package of MissionTree:", *lines, *tried]))
    import_module("missions.cli.root").main()


if __name__ == "__main__":
    main()
