"""The entry of the ``mission`` command.

Our packages have plain names (``config``, ``drivers``...), which something else may shadow: a ``config.py`` in the
working directory, a ROS ``PYTHONPATH``, another distribution. So before anything of ours is used, each is looked at.
"""

import signal
import sys
from importlib import import_module

INTERRUPTED = 130

PACKAGES = ("missions", "behaviours", "drivers", "perception", "config")


def shadowed() -> list[str]:
    """Return a line for each of our packages of which Python finds another."""
    found = []
    for name in PACKAGES:
        try:
            package = import_module(name)
        except Exception as error:
            found.append(f"  {name}: {type(error).__name__}: {error}")
            continue
        if getattr(package, "__project__", None) != "missiontree":
            found.append(f"  {name}: found {getattr(package, '__file__', None) or 'a folder without __init__.py'}")
    return found


def main() -> None:
    """Run the ``mission`` command."""
    try:
        _main()
    except KeyboardInterrupt:  # before or after the command, which has its own way of stopping
        sys.exit(INTERRUPTED)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done: a second Ctrl-C has nothing left to interrupt


def _main() -> None:
    problems = shadowed()
    if problems:
        lines = ["mission: another module hides a part of MissionTree:", *problems]
        lines.append("  try: leave that folder, rename the module, or `unset PYTHONPATH`")
        sys.exit("\n".join(lines))
    import_module("missions.cli.root").main()


if __name__ == "__main__":
    main()
