"""``mission ros2 serve``: an action server by which nodes of ROS 2 start missions, watch them and cancel them."""

import json
import signal
import subprocess
import sys
from collections.abc import Sequence
from threading import Lock, Thread
from typing import TYPE_CHECKING

from drivers.ros2.actions import ABORTED, CANCELLED, CANCELLING, SUCCEEDED, ActionServer, Goal

if TYPE_CHECKING:
    from drivers.ros2.node import Node

RUN_MISSION = "missiontree_msgs/action/RunMission"

ACTION = "/run_mission"


class MissionServer:
    """Offers ``/run_mission``: each goal is a `mission run` of its own, with ``options``, one at a time.

    Feedback is what the run says, line by line; a goal that is cancelled is stopped as by Ctrl-C.
    """

    def __init__(self, node: "Node", options: Sequence[str]) -> None:
        self._options = list(options)
        self._lock = Lock()
        self._running: subprocess.Popen[str] | None = None
        self._threads: list[Thread] = []
        self._closing = False
        ActionServer(node, ACTION, RUN_MISSION, self._begin, self._cancel)

    def close(self) -> None:
        """Stop what runs, and wait for its end."""
        with self._lock:
            self._closing, running = True, self._running
        _stop(running)
        for thread in self._threads:
            thread.join()

    def _begin(self, goal: Goal) -> bool:
        """Start a mission; refuse it while another runs, and where its params are no JSON object."""
        name, given = str(goal.values.mission), str(goal.values.parameters)
        try:
            params = json.loads(given or "{}")
            words = [f"{key}={value}" for key, value in params.items()]
        except (ValueError, AttributeError):
            return False
        if not name or name.startswith("-") or any(word.startswith("-") for word in words):
            return False
        options = [option for word in words for option in ("--param", word)]
        command = [sys.executable, "-m", "missions", "run", name, *options, *self._options, "--json"]
        with self._lock:
            if self._running is not None or self._closing:
                return False
            self._running = subprocess.Popen(  # noqa: S603 - our own command; its words are no options
                command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
            self._threads = [each for each in self._threads if each.is_alive()]
            thread = Thread(target=self._watch, args=(goal, self._running), name="mission of ROS 2", daemon=True)
            self._threads.append(thread)
        thread.start()
        return True

    def _cancel(self, goal: Goal) -> None:
        del goal  # one at a time
        with self._lock:
            running = self._running
        _stop(running)

    def _watch(self, goal: Goal, running: "subprocess.Popen[str]") -> None:
        last = ""
        for line in running.stderr or ():
            if line.strip():
                last = line.strip()
                goal.tell({"running": last})
        out = running.stdout.read() if running.stdout is not None else ""
        code = running.wait()
        for pipe in (running.stdout, running.stderr):
            if pipe is not None:
                pipe.close()
        with self._lock:
            self._running = None
        status, reason = _said(out, last)
        cancelled = goal.status == CANCELLING
        ended = SUCCEEDED if code == 0 else CANCELLED if cancelled else ABORTED
        goal.end(ended, {"status": "cancelled" if cancelled and code else status, "reason": reason})


def _stop(running: "subprocess.Popen[str] | None") -> None:
    if running is not None and running.poll() is None:
        running.send_signal(signal.SIGINT)


def _said(out: str, last: str) -> tuple[str, str]:
    """Return how a run ended, and why, by its line of JSON."""
    try:
        told = json.loads(out.strip().splitlines()[-1])
        return str(told.get("result", "failure")), str(told.get("reason", "") or "")
    except (ValueError, IndexError, AttributeError):
        return "failure", last
