"""A queue and its server on a disk of one megabyte, which is filled: `python -m ...small_disk FOLDER`.

It mounts that disk, so it runs in a name space of its own (`unshare -Umr`). What was told goes to stdout, as JSON.
"""

import json
import subprocess
import sys
from contextlib import closing, suppress
from functools import partial
from pathlib import Path

import pytest

from missions.plugins.tasks.commands import serve as serving
from missions.plugins.tasks.queue_database import DiskFullError, describe_retry, open_db
from missions.plugins.tasks.run_process import Say, Stopping
from missions.plugins.tasks.task import AttemptOutcome, Claim
from missions.plugins.tasks.task_server import TaskServer
from tests.missions.service.small_queue import Shop, new, shop

MOUNT = ("mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs")


def fill(folder: Path) -> None:
    """Leave no room at all."""
    with suppress(OSError), (folder / "filling").open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))


def main(folder: Path) -> None:
    subprocess.run([*MOUNT, str(folder)], check=True)
    path, told = folder / "tasks.db", dict[str, object]()
    with shop(path) as opened:
        opened.add(new("first"))
    fill(folder)
    try:
        open_db(path).close()
    except DiskFullError as error:
        told["refused"] = [str(error), error.hint]
    waited: list[str] = []

    def make_room(text: str, to: list[str]) -> None:
        to.append(text)
        (folder / "filling").unlink(missing_ok=True)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(serving, "DISK_CHECK_INTERVAL", 0.0)
        patch.setattr(serving, "_report", partial(make_room, to=waited))
        serving._open_recovered(path, wait_for_space=True).close()
    told["waited"] = waited
    with closing(open_db(path)) as connection:
        queue = Shop(connection)
        told["served"] = served = list[str]()

        def work(claim: Claim, stopping: Stopping, say: Say) -> AttemptOutcome:
            del stopping
            say(f"before {claim.task.name}")
            fill(folder)
            for number in range(200):  # more than the log has room for
                say(f"{number} of {claim.task.name}")
            return AttemptOutcome("success")

        explain = partial(describe_retry, path)
        now = queue.now
        TaskServer(queue.queue, work, lambda: now, partial(make_room, to=served), explain=explain).run(once=True)
        told["states"] = [task.state for task in queue.queue.tasks()]
        told["said"] = len(queue.told(1))
    sys.stdout.write(json.dumps(told))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
