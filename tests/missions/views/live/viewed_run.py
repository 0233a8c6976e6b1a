"""A run with a view, as a program of its own: what ``mission run --view`` does, on its own controlling terminal.

Its arguments are a file, into which it writes how the run ended before anything is said of it, and a speed.
"""

import fcntl
import os
import sys
import termios
from pathlib import Path

from missions.cli.live import Watcher
from missions.cli.viewing import LiveView
from missions.order import RunRequest
from missions.runner import Runner


def main(result: Path, speed: float) -> int:
    """Run greet; return the exit code of the command."""
    os.setsid()
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    runner = Runner(RunRequest("greet", simulate="fast", eyes="truth", speed=speed))
    watcher = Watcher(sys.stdout)
    watcher.watch(runner.root)
    view = LiveView(runner, watcher)
    runner.stream.listeners.append(view)
    with view:
        ended = runner.run()
        result.write_text(f"{ended.result}: {ended.reason}")
    return {"success": 0, "interrupted": 130}.get(ended.result, 1)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), float(sys.argv[2])))
