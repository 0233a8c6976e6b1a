"""Worker processes that end with their parent."""

import multiprocessing
import os
import threading


def end_with_parent() -> None:
    """Set up this process to end when its parent ends, even if the parent is killed."""
    threading.Thread(target=_wait, name="parent", daemon=True).start()


def _wait() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
