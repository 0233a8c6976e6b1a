"""``mission run`` that also notes what its ticks take, and when a stop has reached the latch of each driver.

    python -m tests.benchmarks.watched_run FILE WORDS...

``FILE`` gets one line of JSON for each tick: when it began, how long it took by the clock and in processor time, and
when the mission's own time began; and one for each part that is stopped: by which stop, when it was told, and when it
was done. All by the clock that the processes of one machine share.
"""

import json
import sys
import time
from collections.abc import Callable
from typing import Any

from missions.cli.root import main
from missions.executive.executive import Executive
from missions.executive.stop_latch import StopLatch


def note_in(path: str) -> None:
    """Have ticks and latches noted in a file."""
    notes: list[object] = []
    file = open(path, "w", encoding="utf-8", buffering=1)  # noqa: SIM115, PTH123 - until the process ends

    def around(kind: Any, name: str, told: Callable[[Any, int, tuple[Any, ...], float, float, float], object]) -> None:
        plain = getattr(kind, name)

        def noted(self: Any, *given: Any, **named: Any) -> Any:
            stop, worked, began = getattr(self, "number", 0), time.thread_time(), time.monotonic()
            try:
                return plain(self, *given, **named)
            finally:
                notes.append(told(self, stop, given, began, time.monotonic(), time.thread_time() - worked))
                if len(notes) >= 20 or name != "tick":
                    file.write("".join(json.dumps(each) + "\n" for each in notes))
                    notes.clear()

        setattr(kind, name, noted)

    def ticked(self: Executive, _: int, given: tuple[Any, ...], began: float, ended: float, work: float) -> object:
        del given
        return {"tick": [began, ended - began, work], "zero": ended - self.time()}

    def latched(_: StopLatch, stop: int, given: tuple[Any, ...], began: float, ended: float, work: float) -> object:
        del work
        return {"latched": [stop, given[0], began, ended]}

    around(Executive, "tick", ticked)
    around(StopLatch, "_still", latched)


if __name__ == "__main__":
    note_in(sys.argv[1])
    sys.argv[1:] = ["run", *sys.argv[2:]]
    main()
