"""Listeners that cannot hurt a driver: what a report or a callback raises ends no thread that moves a robot."""

import logging
from collections.abc import Callable
from contextlib import suppress
from typing import ParamSpec

P = ParamSpec("P")


def guarded(listener: Callable[P, object]) -> Callable[P, None]:
    """Return ``listener`` as one that never raises; the first error of it is logged, those that follow are not.

    SystemExit too is kept away from the driver: a terminal whose pipe has broken raises it in whatever thread prints.
    KeyboardInterrupt alone passes, for it is not the listener's: it comes to the main thread wherever that is.
    """
    failed = False

    def guard(*args: P.args, **kwargs: P.kwargs) -> None:
        nonlocal failed
        try:
            listener(*args, **kwargs)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            if not failed:
                failed = True
                with suppress(Exception, SystemExit):  # the log may end at the very terminal that has gone
                    what = f"{type(error).__name__}: {error}"
                    logging.getLogger(__name__).error("a listener failed and is not logged again: %s", what)

    return guard
