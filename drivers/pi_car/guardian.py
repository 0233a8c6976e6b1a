"""The guardian: a process that holds the pins for a driver, and lets all rest when that falls silent or dies.

Neither pins nor a PCA9685 have a watchdog: they go on with what they were told last. So who tells them is a process of
its own, which hears the driver on its standard input. After ``wire.WATCHDOG`` seconds of silence, and at once when that
ends, motors stand and servos stay. It is in a session of its own and obeys no signals of a terminal. What remains:
where this process is killed, too (``kill -9`` of both at once, a kernel that stands still), the motors go on.
"""

import json
import os
import select
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from drivers.clock import SystemClock
from drivers.keeper.keeper import Keeper
from drivers.pi_car.hands import hands

BEAT = 0.02
"""Seconds between two looks at the time."""

REST_TRIES = 3
"""How often all is let rest at the end."""

FORSAKEN = 5.0
"""Seconds of silence after which nobody will come back: somebody else may want the pins."""


def main(told: str) -> int:
    """Hold what ``told`` (JSON) is about, until the standard input ends; return the exit code."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
        signal.signal(number, signal.SIG_IGN)
    clock = SystemClock()
    try:
        with notification_folder():
            held = hands(json.loads(told))
        keeper = Keeper(held, 1 + int.from_bytes(os.urandom(2)) % 32000, clock.now())
    except Exception as error:
        return complain(error)
    why: Exception | None = None
    try:
        serve(keeper, clock)
    except Exception as error:
        why = error
    unrested = _unrested(keeper, clock)
    if unrested is not None:
        return complain(RuntimeError(f"the actuators perhaps do not rest: {type(unrested).__name__}: {unrested}"))
    return 0 if why is None else complain(why)


@contextmanager
def notification_folder() -> Iterator[None]:
    """Have lgpio write its notification files into a private folder while it is imported.

    Else it takes the current folder, and has no pins where that is read-only. The folder is removed at once: lgpio has
    its file open by then, and a guardian that is killed leaves nothing.
    """
    chosen = os.environ.get("LG_WD")
    try:
        before = Path.cwd()
    except OSError:  # it was removed
        before = Path("/")
    with TemporaryDirectory(prefix="missiontree-lgpio-", ignore_cleanup_errors=True) as own:
        os.environ["LG_WD"] = chosen or own
        os.chdir(chosen or own)
        try:
            yield
        finally:
            os.chdir(before)
            if chosen is None:
                del os.environ["LG_WD"]


def _unrested(keeper: Keeper, clock: SystemClock) -> Exception | None:
    """Let all rest, thrice, for one may be lost on the bus; return why it was not possible even once."""
    errors = list[Exception]()
    for _ in range(REST_TRIES):
        try:
            keeper.rest(clock.now())
        except Exception as error:
            errors.append(error)
    return errors[-1] if len(errors) == REST_TRIES else None


def serve(keeper: Keeper, clock: SystemClock) -> None:
    """Obey and answer until there is nobody any more. Raises what the hardware raises."""
    os.set_blocking(0, False)
    os.set_blocking(1, False)
    while True:
        ready, _, _ = select.select([0], [], [], BEAT)
        data = b""
        if ready:
            with suppress(BlockingIOError):
                data = os.read(0, 4096)
                if not data:
                    return
        now = clock.now()
        said = keeper.feed(data, now)
        if said:
            with suppress(BlockingIOError):  # nobody reads: it is lost, as on a wire
                os.write(1, said)
        if now - keeper.heard_at > FORSAKEN:
            return


def complain(error: Exception) -> int:
    """Say in a line what is the matter."""
    words = " ".join(f"{type(error).__name__}: {error}".split())
    with suppress(OSError):
        os.write(1, f"! {words[:400]}\n".encode())
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
