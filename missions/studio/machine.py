"""The robot of this machine, for its fleet: what its runs tell of it, and all of them stopped or released."""

from collections.abc import Mapping
from contextlib import suppress
from math import isfinite
from pathlib import Path
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Any, Self

from drivers.clock import Clock, SystemClock
from missions.service.fleet.body import Telemetry
from missions.studio import sockets
from missions.studio.sockets import RunLink
from missions.studio.stopping import Said, ask_all

PERIOD = 0.5
"""Seconds from one look at the runs to the next; while a stop is latched, ``GLANCE``."""

GLANCE = 0.05

FLEET = "fleet: "
"""How the name of who stops for a fleet begins: a stop of somebody else at the robot is theirs to release."""

TOLD = 0.8
"""Seconds for which a stop waits for what it tells; what hangs is ended by a signal, and named."""


class Machine:
    """A Body: the runs of this user, as ``mission stop`` reaches them. Follows them while it is entered."""

    def __init__(self, *, clock: Clock | None = None) -> None:
        self._clock = clock or SystemClock()
        self._links: dict[Path, RunLink] = {}
        self._state: dict[str, Any] = {}
        self._at: float | None = None
        self._mission, self._runs = "", False
        self._stopped_by = ""
        self._seen: set[Path] = set()
        self._lock, self._over = Lock(), Event()
        self._thread = Thread(target=self._follow, name="runs", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join()
        for link in self._links.values():
            link.close()

    def look(self) -> Telemetry:
        """See Body."""
        with self._lock:
            state, at = self._state, self._at
            pose = state.get("pose") or (None, None, None)
            age = None if at is None else round(max(0.0, self._clock.now() - at), 1)
            there = self._runs and bool(self._links)
            return Telemetry(
                runs=self._runs,
                mission=self._mission if self._runs else "",
                paused=there and bool(state.get("paused")),
                stopped=str(state.get("stopped", "")) if there else "",
                battery=_battery(state),
                x=pose[0],
                y=pose[1],
                heading=pose[2],
                age=age,
            )

    def stop(self, by: str) -> tuple[bool, str]:
        """See Body."""
        by = f"{FLEET}{by}"
        self._seen = set(sockets.sockets())
        self._stopped_by = by
        said: list[Said] = []
        work = Thread(target=lambda: said.append(ask_all([{"do": "stop"}], by)), name="stop", daemon=True)
        work.start()
        work.join(TOLD)
        if not said:
            return False, "what runs has not answered yet; it is being ended"
        return _summed(said[0]) if said[0] else (True, "stopped; nothing runs")

    def release(self, by: str, *, resume: bool) -> tuple[bool, str]:
        """See Body."""
        self._stopped_by = ""
        stopped = [path for path in sockets.sockets() if _stopped_by_fleet(path)]
        said = ask_all([{"do": "release"}, *([{"do": "resume"}] if resume else [])], f"{FLEET}{by}", only=stopped)
        return _summed(said) if said else (True, "released; nothing runs")

    # --- the thread -------------------------------------------------------------------------------------------------

    def _follow(self) -> None:
        while not self._over.wait(GLANCE if self._stopped_by else PERIOD):
            found = sockets.sockets()
            if self._stopped_by and (new := [path for path in found if path not in self._seen]):
                self._seen.update(new)
                ask_all([{"do": "stop"}], self._stopped_by, only=new)  # what begins meanwhile stands still too
            for path in found:
                if path not in self._links:
                    self._connect(path)
            for path in list(self._links):
                self._read(path)
            with self._lock:
                self._runs = bool(self._links)

    def _connect(self, path: Path) -> None:
        with suppress(OSError, ValueError):
            link = RunLink.open(path)
            if not link.told:
                link.close()
                return
            link.connection.sendall(b'{"do": "watch"}\n')
            link.connection.setblocking(False)
            self._links[path] = link
            with self._lock:
                self._mission, self._state = str(link.told.get("mission", ""))[:100], {}

    def _read(self, path: Path) -> None:
        """Take in what a run has told since."""
        try:
            while True:
                told = self._links[path].hear()
                if told.get("say") in ("state", "scene"):
                    self._take(told.get("state", told))
        except BlockingIOError:
            return
        except (OSError, ValueError):
            self._links.pop(path).close()

    def _take(self, state: Mapping[str, Any]) -> None:
        kept = {name: state[name] for name in ("parts", "pose", "paused", "stopped") if name in state}
        with self._lock:
            self._state, self._at = self._state | kept, self._clock.now()


def _stopped_by_fleet(path: Path) -> bool:
    with suppress(OSError, ValueError), sockets.linked(path) as link:
        return str(link.told.get("stopped", "")).startswith(f"stopped by {FLEET}")
    return False


def _battery(state: Mapping[str, Any]) -> float | None:
    """Return the share of the battery that a run tells, if its base measures that."""
    for part in state.get("parts") or ():
        percent = part.get("values", {}).get("battery")
        if isinstance(percent, int | float) and isfinite(percent):
            return round(min(1.0, max(0.0, percent / 100.0)), 3)
    return None


def _summed(said: Said) -> tuple[bool, str]:
    words = "; ".join(words.partition("\n")[0] for _, words in said.values())
    return all(good for good, _ in said.values()), "".join(each for each in words if each.isprintable())[:900]
