"""Driver of an arm of servos on one bus: ``drivers.api.Joints``.

The driver's thread finds the servos (``monitor``), reads them at the rate that each needs (``poll_rate``), finds lost
ones again, and sends followers to the positions of their leaders. Commands are sent at once from the caller's thread.
The EEPROM of a servo is never written.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from math import inf
from threading import Event, RLock
from typing import Literal

from drivers.api import (
    Coupling,
    DeviceStatus,
    Health,
    JointState,
    Quality,
    Reading,
    ReconnectPolicy,
    StatusCallback,
    ignore,
)
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.joints.request_checks import check_couplings, check_move, check_names
from drivers.servos.bus import ServoBus
from drivers.servos.joint import Joint, JointSpec, check_joints
from drivers.servos.models import MODELS
from drivers.servos.monitor import CONFIRMATION_TIMEOUT, JointMonitor
from drivers.servos.poll_rate import RESTING_INTERVAL, PollSchedule
from drivers.servos.round_schedule import RoundSchedule
from drivers.servos.servo_joints import JointCouplings, ServoJoints
from drivers.servos.status_report import SHUTDOWN_HINT
from drivers.servos.torque import hold_or_relax, recover_joints, release_attempts, send_setpoints, start_motion
from drivers.transport.adapter import latency_timer_path
from drivers.transport.loop import LoopFactory, ThreadLoop, guard_callback

# The arm's status: presence, faults, and statistics of its bus.

SLOW_ADAPTER_LATENCY = 0.004
"""Latency of a USB adapter, in seconds, above which health reports it."""


def arm_health(name: str, bus: ServoBus, joints: Mapping[str, Joint], watch: JointMonitor, *, runs: bool) -> Health:
    """Return the health of an arm: online if the port is open, the thread runs and at least one servo answers.

    ``watch`` is the monitor of the joints; ``runs`` is True if the driver's thread runs.
    """
    try:
        bus.require_open()
    except NotConnected as error:
        return Health(False, str(error), error.hint)
    wrong = [] if watch.connected else ["looking for the servos"]
    wrong += [f"{j.title} {j.undriven_reason}" for j in joints.values() if not j.is_driven]
    hint = watch.hint if wrong else ""
    if shut := [f"{j.title} has shut down" for j in joints.values() if j.is_driven and j.is_shut_down]:
        wrong, hint = wrong + shut, hint or SHUTDOWN_HINT
    if not wrong and bus.latency > SLOW_ADAPTER_LATENCY:
        wrong = [f"the adapter delays every reply by {bus.latency * 1000:.0f} ms"]
        hint = f"echo 1 | sudo tee {latency_timer_path(bus.port)}"
    return Health(watch.online and runs, f"{name}: {'; '.join(wrong)}" if wrong else "", hint)


def arm_counters(
    bus: ServoBus, joints: Mapping[str, Joint], pace: RoundSchedule, *, connections: int
) -> dict[str, int]:
    """Return counters of the bus, of the schedule ``pace``, of ``connections`` and of each servo, by name.

    The schedule counts the rounds, in each of which all joints that are due are read once.
    """
    counters = {"connections": connections, "rounds": pace.rounds, **bus.exchanges.counters("exchange")}
    counters |= {"achieved rate (Hz)": round(pace.achieved_rate), "utilisation (%)": round(100 * pace.utilisation)}
    tallies = {name: bus.statistics(joint.spec.id) for name, joint in joints.items()}
    for figure in ("tries", "misses", "corrupt", "late", "refused"):
        counters[figure] = sum(getattr(tally, figure) for tally in tallies.values())
    return counters | {f"misses of {name}": tally.misses for name, tally in tallies.items()}


def current_readings(joints: Mapping[str, Joint], *, since: float) -> Mapping[str, Reading[JointState]]:
    """Return the newest reading of each joint, marked as stale if it was taken before ``since``."""
    newest = {name: joint.reading for name, joint in joints.items()}
    return {
        name: replace(reading, quality=Quality.STALE) if reading.good and reading.stamp < since else reading
        for name, reading in newest.items()
    }


DEFAULT_POLL_RATE = 100.0
"""Maximum rate in Hz at which the servos of an arm are read, if the bus is fast enough."""

RETRY_INTERVAL = 0.5
"""Seconds between attempts to open the port."""

STALE_AFTER = 0.25
"""Seconds after which a reading is stale for a client that keeps polling the joint states.

For any other client it is ``RESTING_INTERVAL`` more, because resting joints are then read less often.
"""

SETPOINT_INTERVAL = 0.01
"""Minimum seconds between two updates of the setpoints of moving joints."""

COMMAND_PRIORITY_TIMEOUT = 0.2
"""Maximum seconds for which the reading thread waits while another thread holds or relaxes joints."""


class DynamixelJoints(ServoJoints):
    """Joints of an arm with servos on ``bus``, which this driver opens and closes.

    ``rate`` (Hz) is the poll rate of joints that lead or follow, as far as the bus allows; ``drivers.servos.poll_rate``
    sets the rate of all other joints. Callbacks run mostly on the driver's thread, which ``loop`` creates. Raises
    BadRequest that lists all invalid joints.
    """

    def __init__(
        self,
        bus: ServoBus,
        joints: Mapping[str, JointSpec],
        clock: Clock,
        *,
        rate: float = DEFAULT_POLL_RATE,
        at_rest: Literal["hold", "relax"] = "hold",
        away: ReconnectPolicy | None = None,
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
        loop: LoopFactory = ThreadLoop,
        name: str = "arm",
    ) -> None:
        check_joints(name, dict(joints))
        if not 0 < rate <= 1000:
            raise BadRequest(f"{name}: the poll rate must be above 0 and at most 1000 Hz, not {rate}")
        described = {joint: Joint(joint, spec, MODELS[spec.model]) for joint, spec in joints.items()}
        super().__init__(described, clock, at_rest=at_rest, away=away, report=report, changed=changed, name=name)
        self._bus = bus
        self._rate = rate
        self._lock = RLock()
        self._couplings = JointCouplings(bus, self._joints, self._goal_limiter, self._reporter)
        self._monitor = JointMonitor(bus, self._joints, self._lock, clock, self._reporter, self._reconnect)
        self._round_schedule = RoundSchedule(rate)
        self._poll_schedule = PollSchedule(rate, min(RESTING_INTERVAL, self._reconnect.min_absence / 3))
        self._loop = loop(f"joints {self.name}", self._run_round, ignore)
        self._is_open = False
        self._connections = 0
        self._setpoints_sent_at = 0.0
        self._no_command_pending = Event()  # cleared while joints are held or relaxed, which precedes the next reading
        self._no_command_pending.set()
        self._fast_joints: frozenset[str] = frozenset()  # read as often as leaders
        self._on_round: Callable[[], object] = ignore
        self._reported_fault = ""  # the driver's own fault that was reported last

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start the thread that finds and reads the servos. Does nothing if it runs."""
        if not self._is_open:
            self._is_open = True
            self._connections = 0
            self._reconnect.restart()
            self._loop.start()

    def close(self) -> None:
        """End the thread, bring the arm to rest and release the port. Safe from any state, more than once."""
        if not self._is_open:
            return
        with ExitStack() as whatever_happens:
            whatever_happens.callback(self._release)
            whatever_happens.callback(self.rest)
            self._loop.end()

    def _release(self) -> None:
        self._is_open = False
        self._bus.close()
        self._monitor.reset()
        self._connections = 0
        for joint in self._joints.values():
            joint.may_have_torque = joint.is_unconfirmed = False  # no longer ours to report

    def rest(self) -> None:
        """Hold or relax all joints, as ``at_rest`` says; report the servos that did not confirm it. Never raises."""
        why = ""
        with self._lock:
            try:
                failed = self._hold_or_relax(self._joints, stiff=self._stiff_at_rest)
                for _ in release_attempts(self._bus, failed, self._clock):
                    for joint in failed:
                        if not joint.is_answering:
                            self._monitor.identify(joint)
                    failed[:] = self._hold_or_relax([joint.name for joint in failed], stiff=self._stiff_at_rest)
            except Exception as error:  # in any case the port must be closed and other devices stopped
                failed = [joint for joint in self._joints.values() if joint.may_have_torque]
                why = f" ({type(error).__name__}: {error})"
            self._reporter.report_not_at_rest(failed, stiff=self._stiff_at_rest, reason=why)

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Start moving the named joints to ``goals`` (radians), all in one packet; return the clamped goals.

        Ends the following of these joints. A clamped goal is reported, unless one of the same joint was clamped within
        ``CLAMP_REPORT_INTERVAL``. Joints whose servo is silent, shut down or not as configured are left out, with a
        notice. Raises BadRequest for an unknown joint or a value that is not finite, NotConnected if the bus is gone or
        has just come back, DeviceFault while latched or if a joint is blocked.
        """
        asked, speeds = self._clock.now(), speeds or {}
        check_move(self.name, goals, speeds, self._joints)
        with self._lock:
            self._require_ready(asked)
            now = self._clock.now()
            self._refuse_blocked(goals, now)
            accepted = self._goal_limiter.clamp_goals(goals, now)
            self._couplings.release(goals)
            start_motion(self._bus, [self._joints[name] for name in goals], accepted, speeds, now)
        self._loop.wake()
        return accepted

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Let followers copy the positions of their leaders, each time that a leader is read, until the next call.

        An empty sequence ends all couplings. Joints that no longer follow hold their position. A distant follower
        approaches slowly first. After a lost connection all joints hold, and the followers approach again. Raises
        BadRequest for invalid couplings, and NotConnected, but not to end them.
        """
        asked = self._clock.now()
        check_couplings(self.name, couplings, self._joints)
        with self._lock:
            if couplings:
                self._require_ready(asked)
            if freed := self._couplings.replace(couplings):
                self._hold_or_relax_and_report(freed, stiff=True)
        self._loop.wake()

    def poll_fast(self, joints: Collection[str], on_round: Callable[[], object] = ignore) -> None:
        """Read ``joints`` as often as leaders, and call ``on_round`` after each round of readings.

        In a round, each joint that is due is read once. Raises BadRequest for an unknown joint.
        """
        check_names(self.name, set(joints), self._joints)
        self._fast_joints, self._on_round = frozenset(joints), guard_callback(on_round)
        self._loop.wake()

    def recover(self) -> tuple[str, ...]:
        """Switch the torque of servos that have shut down on again; return the names of their joints.

        The joints stay at their current positions. Servos of protocol 2.0 reboot, and have torque about half a second
        later. For a person who has removed the cause of the shutdown; it also enables the arm. Raises NotConnected.
        """
        with self._lock:
            self._reconnect.enable()
            return tuple(
                joint.name for joint in recover_joints(self._bus, self._joints.values(), now=self._clock.now())
            )

    def states(self) -> Mapping[str, Reading[JointState]]:
        """The newest state of each joint; stale after ``STALE_AFTER`` seconds without a reading.

        Joints at rest are read less often while no client keeps polling.
        """
        now = self._clock.now()
        fresh = STALE_AFTER if self._poll_schedule.note_request(now) else STALE_AFTER + RESTING_INTERVAL
        return current_readings(self._joints, since=now - fresh)

    def health(self) -> Health:
        """Return the health: online if the port is open and at least one servo answers."""
        counters = arm_counters(self._bus, self._joints, self._round_schedule, connections=self._connections)
        health = arm_health(self.name, self._bus, self._joints, self._monitor, runs=self._loop.is_alive)
        return replace(health, counters=counters, reconnected_at=self._reconnect.reconnected_at)

    def _require_ready(self, requested_at: float) -> None:
        """Raise NotConnected while servos are being found, or for a command that was requested before the reconnect.

        ``requested_at`` is the time of the request. Raises DeviceFault while the arm is latched.
        """
        self._bus.require_open()
        absent = self._reconnect.is_silent(self._clock.now()) or self._reconnect.is_from_before(requested_at)
        if absent or not self._monitor.connected:
            raise NotConnected(f"{self.name}: {self._bus.port}: looking for the servos", hint="try again")
        self._reconnect.require_unlatched(self.name)

    def _hold_or_relax_and_report(self, names: Collection[str], *, stiff: bool) -> None:
        self._no_command_pending.clear()
        try:
            with self._lock:
                for joint in self._hold_or_relax(names, stiff=stiff):
                    joint.checked_at = -inf
                self._reporter.report_unconfirmed(
                    since=self._clock.now() - CONFIRMATION_TIMEOUT if self._bus.is_open else inf
                )
        finally:
            self._no_command_pending.set()
        self._loop.wake()

    def _hold_or_relax(self, names: Collection[str], *, stiff: bool) -> list[Joint]:
        """Hold or relax joints; return those whose servo did not confirm it."""
        check_names(self.name, set(names), self._joints)
        with self._lock:
            self._couplings.release(names)
            joints = [self._joints[name] for name in names]
            for joint in joints:
                joint.torque_request = stiff
            unsettled = hold_or_relax(self._bus, joints, stiff=stiff, now=self._clock.now())
            for joint in joints:
                joint.progress.hold(joint.goal if stiff else None)
            return unsettled

    # --- the driver's thread ------------------------------------------------------------------------------------------

    def _run_round(self) -> float:
        pause = RETRY_INTERVAL
        try:
            self._poll_round()
            pause = self._round_schedule.end_round(self._clock.now(), self._bus.busy_time(), self._next_due())
        except NotConnected as error:
            self._monitor.on_port_lost(error)
        except BaseException as error:  # SystemExit too: without this thread the arm is not monitored
            self._report_driver_error(error)
        self._changed()
        self._on_round()
        return pause

    def _next_due(self) -> float:
        """Return the time at which the driver's thread must act next.

        That is when the next joint must be read, or the next unconfirmed hold or relax must be repeated.
        """
        joints, now = self._joints.values(), self._clock.now()
        return min(
            self._poll_schedule.next_due(joints, self._couplings.coupled_joints | self._fast_joints, now),
            self._monitor.next_confirmation_at(),
        )

    def _poll_round(self) -> None:
        if not self._monitor.connected:
            self._monitor.connect()
            self._connections += 1
            with self._lock:
                self._couplings.pause()
            self._reporter.report_slow_bus(self._rate, self._bus.baud)
            self._round_schedule.restart(self._clock.now(), self._bus.busy_time())
            return
        began = self._clock.now()
        if self._reconnect.on_report(began):
            for joint in self._joints.values():
                joint.approaches_slowly = True
            self._hold_all()
        wanted = self._poll_schedule.due_joints(
            self._joints.values(), self._couplings.coupled_joints | self._fast_joints, began
        )
        self._monitor.read(wanted, after_each=self._send_setpoints)
        self._stop_blocked_joints(wanted)
        with self._lock:
            self._couplings.update_followers(since=began, now=self._clock.now())
        self._send_setpoints()
        if self._monitor.run_checks():
            self._hold_all()

    def _stop_blocked_joints(self, polled: Collection[Joint]) -> None:
        """Hold joints that are blocked; relax joints that run away."""
        with self._lock:
            for joint in self._check_progress(polled):
                self._couplings.release([joint.name])
                joint.torque_request = not joint.progress.runs_away
                hold_or_relax(self._bus, [joint], stiff=joint.torque_request, now=self._clock.now())

    def _hold_all(self) -> None:
        """Hold all joints with torque at their position and end all couplings: older commands are dropped."""
        with self._lock:
            self._couplings.replace(())
            self._hold_or_relax_and_report(
                [name for name, joint in self._joints.items() if joint.torque_request], stiff=True
            )

    def _send_setpoints(self) -> None:
        """Send the next setpoints of moving joints, unless some were sent within ``SETPOINT_INTERVAL``.

        It is called several times while the joints are read, because on a slow bus a joint would otherwise reach its
        setpoint before the next one is sent. A thread that holds or relaxes joints meanwhile gets the bus first: a lock
        alone does not ensure that.
        """
        self._no_command_pending.wait(COMMAND_PRIORITY_TIMEOUT)
        now = self._clock.now()
        if now - self._setpoints_sent_at >= SETPOINT_INTERVAL:
            self._setpoints_sent_at = now
            with self._lock:
                send_setpoints(self._bus, self._joints.values(), now=now)

    def _report_driver_error(self, error: BaseException) -> None:
        """Report an error of the driver itself, unless it equals the last one."""
        if (fault := f"{type(error).__name__}: {error}") != self._reported_fault:
            self._reported_fault = fault
            self._report(DeviceStatus(self.name, "fault", fault))
