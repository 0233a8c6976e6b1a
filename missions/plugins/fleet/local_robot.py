"""The robot of this computer: telemetry from its runs, and stop and release of all of them."""

from collections.abc import Mapping
from contextlib import suppress
from math import isfinite
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Any, Self

from behaviours.run import log
from drivers.clock import Clock, SystemClock
from missions.control.command_broadcast import StopOutcomes, send_to_all, stop_one
from missions.control.run_search import FoundProcess, StopWarning, may_be_alive, search_runs
from missions.control.sockets import RunConnection
from missions.plugins.fleet.fleet_robot import Telemetry

SEARCH_INTERVAL = 0.5
"""Seconds between two searches for runs of the robot; ``STOP_SEARCH_INTERVAL`` while a stop is latched."""

STOP_SEARCH_INTERVAL = 0.05

FLEET_PREFIX = "fleet: "
"""Prefix of the client name in a stop that came from the fleet.

A stop without the prefix was made at the robot, and can only be released there.
"""

STOP_TIMEOUT = 0.8
"""Seconds to wait for the confirmations of a stop; a hanging run is ended by a signal and reported."""


class LocalRobot:
    """The robot of this computer as a FleetRobot, which follows the runs of this user while its context is entered."""

    def __init__(self, *, clock: Clock | None = None) -> None:
        self._clock = clock or SystemClock()
        self._links: dict[object, RunConnection] = {}
        self._state: dict[str, Any] = {}
        self._at: float | None = None
        self._mission, self._runs = "", False
        self._stopped_by = ""
        self._stopped: set[object] = set()  # including runs that are being stopped
        self._doubts: list[StopWarning] = []
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

    def read_telemetry(self) -> Telemetry:
        with self._lock:
            state, at = self._state, self._at
            pose = state.get("pose") or (None, None, None)
            age = None if at is None else round(max(0.0, self._clock.now() - at), 1)
            there = self._runs and bool(self._links)
            return Telemetry(
                runs=self._runs,
                mission=self._mission if there else "",
                paused=there and bool(state.get("paused")),
                stopped=str(state.get("stopped", "")) if there else "",
                battery=_battery(state),
                x=pose[0],
                y=pose[1],
                heading=pose[2],
                age=age,
            )

    def stop(self, by: str) -> tuple[bool, str]:
        by = f"{FLEET_PREFIX}{by}"
        found = search_runs()
        self._stopped = {each.key for each in found.processes}
        self._stopped_by = by
        results: list[StopOutcomes] = []

        def work() -> None:
            try:
                results.append(send_to_all([{"do": "stop"}], by, search_result=found))
            except Exception:
                self._stopped.clear()  # the thread that follows the runs stops all again
                raise
            self._stopped -= {
                each.key for each, (good, _) in results[0].items() if isinstance(each, FoundProcess) and not good
            }

        thread = Thread(target=work, name="stop", daemon=True)
        thread.start()
        thread.join(STOP_TIMEOUT)
        if not results:
            return False, "the running mission has not answered yet; it is being ended"
        return _summarise(results[0]) if results[0] else (True, "stopped; nothing runs")

    def _stop_new(self, found: FoundProcess, by: str) -> None:
        """Stop a run that began after the stop, or that the stop did not reach.

        If it fails, the next search tries again.
        """
        is_good = False
        try:
            is_good = "trouble" not in stop_one(found, by)
        finally:
            if not is_good:
                self._stopped.discard(found.key)

    def release(self, by: str, *, resume: bool) -> tuple[bool, str]:
        self._stopped_by = ""
        commands = [{"do": "release"}, *([{"do": "resume"}] if resume else [])]
        results = send_to_all(commands, f"{FLEET_PREFIX}{by}", is_wanted=_is_stopped_by_fleet)
        return _summarise(results) if results else (True, "released; nothing runs")

    # --- the thread -------------------------------------------------------------------------------------------------

    def _follow(self) -> None:
        while not self._over.wait(STOP_SEARCH_INTERVAL if self._stopped_by else SEARCH_INTERVAL):
            try:
                self._update()
            except Exception:  # the next search may succeed; until then the latch stops new runs
                log.exception("the runs could not be checked")

    def _update(self) -> None:
        """Stop runs that began while a stop is latched, and read the states that all runs have sent."""
        result = search_runs(thorough=False)
        found = result.processes
        self._log_doubts(result.warnings)
        for each in found if self._stopped_by else ():
            if each.key not in self._stopped:
                # Before its thread begins, which removes it again if the stop fails. A release stays a release.
                self._stopped.add(each.key)
                thread = Thread(target=self._stop_new, args=(each, self._stopped_by), name="stop", daemon=True)
                try:
                    thread.start()
                except RuntimeError:  # thread limit reached
                    self._stop_new(each, self._stopped_by)
        for each in found:
            if each.key not in self._links and not each.is_command:
                self._connect(each)
        for key in list(self._links):
            self._read(key)
        unreached = any(each.key not in self._links and not each.is_command and may_be_alive(each) for each in found)
        with self._lock:
            self._runs = bool(self._links) or unreached or bool(result.warnings)

    def _log_doubts(self, doubts: list[StopWarning]) -> None:
        """Log the reasons why the search may have missed a run, once after each change of the reasons."""
        if doubts != self._doubts:
            self._doubts = doubts
            for each in doubts:
                log.warning("a run may have been missed: %s", each.reason)

    def _connect(self, found: FoundProcess) -> None:
        for where in found.addresses:
            with suppress(OSError, ValueError):  # only for display: a stop connects to each run itself
                link = RunConnection.open(where)
                if not link.run_info:
                    link.close()
                    continue
                link.connection.sendall(b'{"do": "watch"}\n')
                link.connection.setblocking(False)
                self._links[found.key] = link
                with self._lock:
                    self._mission, self._state = str(link.run_info.get("mission", ""))[:100], {}
                return

    def _read(self, key: object) -> None:
        """Read all messages that the run with this ``key`` has sent."""
        try:
            while True:
                message = self._links[key].receive()
                if message.get("say") in ("state", "scene"):
                    self._store_state(message.get("state", message))
        except BlockingIOError:
            return
        except (OSError, ValueError):
            self._links.pop(key).close()

    def _store_state(self, state: Mapping[str, Any]) -> None:
        kept = {name: state[name] for name in ("parts", "pose", "paused", "stopped") if name in state}
        with self._lock:
            self._state, self._at = self._state | kept, self._clock.now()


def _is_stopped_by_fleet(outcome: Mapping[str, Any]) -> bool:
    """Return whether the ``outcome`` that a run reports is a stop by its fleet."""
    return str(outcome.get("stopped", "")).startswith(f"stopped by {FLEET_PREFIX}")


def _battery(state: Mapping[str, Any]) -> float | None:
    """Return the battery level (0..1) that a run reports, or None."""
    for part in state.get("parts") or ():
        percent = part.get("values", {}).get("battery")
        if isinstance(percent, int | float) and isfinite(percent):
            return round(min(1.0, max(0.0, percent / 100.0)), 3)
    return None


def _summarise(outcomes: StopOutcomes) -> tuple[bool, str]:
    words = "; ".join(words.partition("\n")[0] for _, words in outcomes.values())
    return all(good for good, _ in outcomes.values()), "".join(each for each in words if each.isprintable())[:900]
