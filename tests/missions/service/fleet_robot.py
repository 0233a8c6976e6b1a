"""A robot of a fleet as a process to be killed: what it does for a task is a line in a journal, and takes no time.

``python -m tests.missions.service.fleet_robot FOLDER NAME PORT`` serves until it is ended. The journal is a file that
is only ever appended to: what stands in it was done, whatever became of the process then.
"""

import os
import sys
from contextlib import ExitStack, closing
from pathlib import Path
from threading import Event

from config.fleet import FleetKeys
from drivers.clock import SystemClock
from missions.plugins.fleet.fleet_robot import Telemetry
from missions.plugins.fleet.member import FleetMember, RobotInfo
from missions.plugins.fleet.membership import add_task_services, robot_number
from missions.plugins.fleet.messages import Address, FleetTimeouts
from missions.plugins.fleet.task_allocator import TaskStore
from missions.plugins.fleet.task_executor import AssignmentQueue
from missions.plugins.fleet.zenoh_session import open_session
from missions.plugins.fleet.zenoh_transport import Roster, ZenohTransport
from missions.plugins.tasks.fleet_latch import FleetLatch
from missions.plugins.tasks.queue import wall_clock
from missions.plugins.tasks.queue_database import open_db, queue_file
from missions.plugins.tasks.run_process import Say, Stopping
from missions.plugins.tasks.task import AttemptOutcome, Claim
from missions.plugins.tasks.task_server import TaskServer

WORK = 0.15
"""Seconds that a task takes."""

TIMES = FleetTimeouts(heartbeat=0.5, retry_interval=0.5, lease=3.0, reassign_after=6.0, refusal_pause=0.3)


class Body:
    """A robot that has nothing to move: a stop is noted, and ends nothing but the beginning of tasks."""

    def __init__(self) -> None:
        self.runs = False

    def read_telemetry(self) -> Telemetry:
        return Telemetry(runs=self.runs, mission="note" if self.runs else "", battery=0.5)

    def stop(self, by: str) -> tuple[bool, str]:
        return True, f"stopped by {by}"

    def release(self, by: str, *, resume: bool) -> tuple[bool, str]:
        del resume
        return True, f"released by {by}"


def main(folder: Path, name: str, port: int) -> None:
    """Serve."""
    folder.mkdir(parents=True, exist_ok=True)
    done = os.open(folder / "done", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    body, clock, pause = Body(), SystemClock(), Event()

    def work(claim: Claim, stopping: Stopping, say: Say) -> AttemptOutcome:
        del say
        body.runs = True
        try:
            pause.wait(WORK)
            if stopping():
                return AttemptOutcome("interrupted", "stopped")
            os.write(done, f"{claim.task.params['id']}\n".encode())
            return AttemptOutcome("success")
        finally:
            body.runs = False

    path = queue_file(folder)
    with ExitStack() as closed:
        queue = AssignmentQueue(closed.enter_context(closing(open_db(path))), lambda _: ())
        queue.recover(wall_clock())
        own = RobotInfo(Address(name, robot_number(folder)), "note", ("voice",), simulated=True)
        roster, latch = Roster(clock), FleetLatch(folder)
        fleet = FleetKeys(fleet="campaign", mode="client", connect=(f"tcp/127.0.0.1:{port}",))
        line = ZenohTransport(open_session(fleet), fleet.fleet, roster)
        member = FleetMember(own, line, roster, body, latch, clock=clock)
        theirs = closed.enter_context(closing(open_db(path, any_thread=True)))
        journal = AssignmentQueue(theirs, lambda _: ())
        add_task_services(member, journal, TaskStore(theirs), timeouts=TIMES)
        line.subscribe()
        closed.enter_context(member)
        TaskServer(queue, work, wall_clock, lambda _: None, is_held=lambda: latch.is_latched).run()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
