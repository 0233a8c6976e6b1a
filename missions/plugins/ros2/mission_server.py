"""``mission ros2 serve``: action server by which ROS 2 nodes start, monitor and cancel missions."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from threading import Lock, Thread
from typing import TYPE_CHECKING

from drivers.ros2.action_server import ABORTED, CANCELLED, CANCELLING, SUCCEEDED, ActionGoal, ActionServer
from missions.library.shipped import is_known_mission

if TYPE_CHECKING:
    from drivers.ros2.node import Ros2Node

RUN_MISSION = "missiontree_msgs/action/RunMission"

ACTION_NAME = "/run_mission"


class MissionServer:
    """Server of the ROS 2 action ``/run_mission``: each goal is a `mission run` of its own, one at a time.

    ``options`` are further options of these runs. Feedback is the output of the run, line by line; a cancelled goal is
    stopped as by Ctrl-C. ``is_known`` returns True for accepted missions: names in the library, not paths. A run stops
    when this process ends for any reason, since a pipe between the two then closes.
    """

    def __init__(
        self, node: "Ros2Node", options: Sequence[str], *, is_known: Callable[[str], bool] = is_known_mission
    ) -> None:
        self._options, self._is_known = list(options), is_known
        self._lock = Lock()
        self._running: subprocess.Popen[str] | None = None
        self._goal: ActionGoal | None = None  # the goal of that run
        self._threads: list[Thread] = []
        self._closing = False
        ActionServer(node, ACTION_NAME, RUN_MISSION, self._begin, self._cancel)

    def close(self) -> None:
        """Stop the current mission, and wait until its run has ended."""
        with self._lock:
            self._closing, running = True, self._running
        _stop(running)
        for thread in self._threads:
            thread.join()

    def _begin(self, goal: ActionGoal) -> bool:
        """Start a mission; reject the goal during another run, and for an unknown name or invalid params."""
        name, words = str(goal.values.mission), _parse_params(str(goal.values.parameters))
        if words is None or not self._is_known(name):
            return False
        with self._lock:
            if self._running is not None or self._closing:
                return False
            try:
                (self._running, leash), self._goal = self._start(name, words), goal
            except (OSError, ValueError):
                return False
            self._threads = [each for each in self._threads if each.is_alive()]
            thread = Thread(target=self._watch, args=(goal, self._running, leash), name="mission of ROS 2", daemon=True)
            self._threads.append(thread)
        thread.start()
        return True

    def _start(self, name: str, words: Sequence[str]) -> tuple["subprocess.Popen[str]", int]:
        """Start a run of a mission; return its process, and the end of a pipe that stops the run when it is closed.

        Raises OSError, ValueError.
        """
        reading, writing = os.pipe()
        params = [f"--param={word}" for word in words]
        run = [sys.executable, "-m", "missions", "run", "--json", f"--leash={reading}", *params, *self._options]
        try:
            running = subprocess.Popen(  # noqa: S603 - our own command; its words are no options
                [*run, "--", name],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                pass_fds=(reading,),
                start_new_session=True,  # Ctrl-C goes to the server, which stops the run
            )
        except (OSError, ValueError):
            os.close(writing)
            raise
        finally:
            os.close(reading)
        return running, writing

    def _cancel(self, goal: ActionGoal) -> None:
        with self._lock:
            running = self._running if self._goal is goal else None  # another run may have begun since
        _stop(running)

    def _watch(self, goal: ActionGoal, running: "subprocess.Popen[str]", leash: int) -> None:
        try:
            with running:
                try:
                    out, last = _relay_output(goal, running)
                finally:
                    os.close(leash)  # after any error, end the run
        finally:
            with self._lock:
                self._running = self._goal = None
        status, reason = _parse_result(out, last)
        cancelled = goal.status == CANCELLING
        ended = SUCCEEDED if running.returncode == 0 else CANCELLED if cancelled else ABORTED
        goal.end(ended, {"status": "cancelled" if cancelled and running.returncode else status, "reason": reason})


def _parse_params(given: str) -> list[str] | None:
    """Return the params in a JSON object as texts NAME=VALUE; None if the JSON is invalid or not printable."""
    try:
        told = json.loads(given or "{}").items()
        words = [f"{key}={value if isinstance(value, str) else json.dumps(value)}" for key, value in told]
    except (ValueError, AttributeError, RecursionError):
        return None
    return words if all(word.isprintable() for word in words) else None


def _relay_output(goal: ActionGoal, running: "subprocess.Popen[str]") -> tuple[str, str]:
    """Send the output of a run as feedback, until its end; return its stdout, and its last line of stderr."""
    last = ""
    for line in running.stderr or ():
        if line.strip():
            last = line.strip()
            goal.send_feedback({"running": last})
    return (running.stdout.read() if running.stdout is not None else ""), last


def _stop(running: "subprocess.Popen[str] | None") -> None:
    if running is not None and running.poll() is None:
        running.send_signal(signal.SIGINT)


def _parse_result(out: str, last: str) -> tuple[str, str]:
    """Return the result of a run and its reason, from the last line of ``out``, which is JSON.

    Without such a line, the result is failure, and the reason is ``last``.
    """
    try:
        told = json.loads(out.strip().splitlines()[-1])
        return str(told.get("result", "failure")), str(told.get("reason", "") or "")
    except (ValueError, IndexError, AttributeError):
        return "failure", last
