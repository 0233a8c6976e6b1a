"""How a process that works for another ends: with it, however that ends."""

import multiprocessing
import os
import threading


def end_with_parent() -> None:
    """Begin as a worker, which ends with its parent, also where that was killed."""
    threading.Thread(target=_wait, name="parent", daemon=True).start()


def _wait() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
