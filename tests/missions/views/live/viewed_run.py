"""A run with a view, as a program of its own: what ``mission run --view`` does, on its own controlling terminal.

Its arguments are a file, into which it writes how the run ended before anything is said of it, a speed, and, where that
is not to be as ever, for how many seconds it waits for the terminal and for the process of the view.
"""

import fcntl
import os
import sys
import termios
from pathlib import Path

from missions.cli.live import RunDisplay
from missions.plugins.view import terminal, viewer
from missions.plugins.view.live_view import LiveView
from missions.request import RunRequest
from missions.runner import Runner


def main(result: Path, speed: float, patience: float | None = None) -> int:
    """Run greet; return the exit code of the command."""
    if patience is not None:
        terminal.WRITE_TIMEOUT = viewer.EXIT_TIMEOUT = patience
    os.setsid()
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    runner = Runner(RunRequest("greet", simulate="fast", eyes="truth", speed=speed))
    watcher = RunDisplay(sys.stdout)
    watcher.show_tree(runner.root)
    view = LiveView(runner, watcher)
    runner.stream.listeners.append(view)
    with view:
        ended = runner.run()
        result.write_text(f"{ended.result}: {ended.reason}")
    return {"success": 0, "interrupted": 130}.get(ended.result, 1)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), *map(float, sys.argv[2:])))
