"""An arm of Dynamixel servos as named joints: ``drivers.api.Joints`` over one bus.

A thread of the driver finds the servos, reads them and finds them again (``watch``); commands go out at once from the
caller's thread. Nothing is ever written to a servo's EEPROM.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from math import isfinite
from threading import Event, RLock, Thread
from typing import Literal

from drivers.api import Health, JointLimits, JointState, Notice, Quality, Reading, Report, unheard, unreported
from drivers.clock import Clock
from drivers.dynamixel.bus import Bus
from drivers.dynamixel.joint import Joint, JointSpec, check
from drivers.dynamixel.models import GOAL_POSITION, MODELS
from drivers.dynamixel.port import timer_of
from drivers.dynamixel.torque import ready, recover, settle
from drivers.dynamixel.watch import Watch
from drivers.errors import BadRequest, NotConnected
from drivers.guard import guarded

PERIOD = 0.025
"""Seconds from one round of readings to the next."""

RETRY = 0.5
"""Seconds between attempts to open the port."""

FRESH = 0.25
"""Seconds after which a reading is stale."""


SLOW_ADAPTER = 0.004
"""Seconds for which an adapter may hold a reply back before it is worth a word."""


class DynamixelJoints:
    """The joints of an arm. It owns ``bus``: opens it, and closes it at the end.

    ``at_rest`` says what rest means for this arm: stiff where it is, or without torque. ``report`` hears what the
    servos tell, ``changed`` is called after every round of readings, both from the driver's thread.
    Raises BadRequest for joints that cannot be, all faults in one message.
    """

    def __init__(
        self,
        bus: Bus,
        joints: Mapping[str, JointSpec],
        clock: Clock,
        *,
        at_rest: Literal["hold", "relax"] = "hold",
        report: Report = unreported,
        changed: Callable[[], None] = unheard,
        name: str = "arm",
    ) -> None:
        check(name, dict(joints))
        self._name = name
        self._bus = bus
        self._joints = {joint: Joint(joint, spec, MODELS[spec.model]) for joint, spec in joints.items()}
        self._clock = clock
        self._stiff_at_rest = at_rest == "hold"
        self._report = guarded(report)
        self._changed = guarded(changed)
        self._lock = RLock()
        self._watch = Watch(name, bus, self._joints, self._lock, clock, self._report)
        self._ending = Event()
        self._thread: Thread | None = None
        self._connections = 0
        self._fault = ""  # the newest of the driver's own that was reported

    @property
    def name(self) -> str:
        """The part of the robot that it is."""
        return self._name

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """The joints by name, in the order of the robot file."""
        return {name: joint.limits for name, joint in self._joints.items()}

    def open(self) -> None:
        """Start the thread that looks for the servos; does nothing if it runs."""
        if self._thread is None:
            self._ending.clear()
            self._connections = 0
            self._thread = Thread(target=self._run, name=f"joints {self._name}", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread, bring the arm to rest and release the port. Safe from any state, more than once."""
        if self._thread is None:
            return
        self._ending.set()
        with ExitStack() as whatever_happens:
            whatever_happens.callback(self._release)
            whatever_happens.callback(self.rest)
            self._thread.join()

    def _release(self) -> None:
        self._thread = None
        self._bus.close()
        self._watch.end()
        self._connections = 0

    def rest(self) -> None:
        """Hold or relax, as the robot file asks; tell which servos could not be brought to it. Never raises."""
        if not self._connections:
            return  # it was never there: nothing was moved
        why = ""
        try:
            failed = self._settle(stiff=self._stiff_at_rest)
        except Exception as error:  # whatever it is, the port is still to be closed and other devices to be rested
            failed, why = list(self._joints.values()), f" ({type(error).__name__}: {error})"
        if failed:
            what = "held" if self._stiff_at_rest else "relaxed"
            names = ", ".join(joint.title for joint in failed)
            cure = "switch their power off by hand"
            self._report(Notice(self._name, "fault", f"could not be {what}: {names}{why}", cure))

    def hold(self) -> None:
        """Stand still and stiff where it is now. Safe from any state; does not raise when offline."""
        self._settle(stiff=True)

    def relax(self) -> None:
        """Switch the torque off. Safe from any state; does not raise when offline."""
        self._settle(stiff=False)

    def recover(self) -> tuple[str, ...]:
        """Make servos that have shut themselves down stiff again where they stand; return the names of the joints.

        For a person to ask for who has removed the cause. Raises NotConnected.
        """
        with self._lock:
            return tuple(joint.name for joint in recover(self._bus, self._joints.values()))

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Start moving the named joints to ``goals`` (radians), all in one packet; return the goals after clamping.

        Joints whose servo is silent, shut down or not what it should be are left out, with a notice. Raises BadRequest
        for an unknown joint or a value that is not finite, NotConnected when the bus is gone or has just come back.
        """
        speeds = speeds or {}
        self._reject(goals, speeds)
        accepted = {name: self._joints[name].clamp(goal) for name, goal in goals.items()}
        with self._lock:
            self._bus.require()
            if not self._watch.connected:  # what is told to a servo before its settings are restored would be undone
                raise NotConnected(f"{self._name}: {self._bus.port}: looking for the servos", hint="try again")
            named = [self._joints[name] for name in goals]
            going = ready(self._bus, named, now=self._clock.now())
            orders = {}
            for joint in named:
                joint.left_out = joint not in going
            for joint in going:
                joint.goal, joint.wanted = accepted[joint.name], True
                speed = speeds.get(joint.name, joint.limits.speed)
                orders[joint.spec.id] = joint.order(joint.ticks(joint.goal), speed)
            self._bus.sync_write_block(GOAL_POSITION.address, orders)
        return accepted

    def states(self) -> Mapping[str, Reading[JointState]]:
        """The newest state of each joint; stale after ``FRESH`` seconds without a reading."""
        readings = {name: joint.reading for name, joint in self._joints.items()}
        return {name: replace(reading, quality=self._quality(reading)) for name, reading in readings.items()}

    def health(self) -> Health:
        """Say whether the arm is there: the port open, and at least one servo answering."""
        counters = {"connections": self._connections, "tries": 0, "misses": 0, "corrupt": 0}
        for name, joint in self._joints.items():
            tally = self._bus.tally(joint.spec.id)
            counters["tries"] += tally.tries
            counters["misses"] += tally.misses
            counters["corrupt"] += tally.corrupt
            counters[f"misses of {name}"] = tally.misses
        try:
            self._bus.require()
        except NotConnected as error:
            return Health(False, str(error), error.hint, counters)
        wrong = [] if self._watch.connected else ["looking for the servos"]
        wrong += [f"{j.title} {j.complaint}" for j in self._joints.values() if not j.driven]
        wrong += [f"{j.title} has shut down" for j in self._joints.values() if j.driven and j.shut]
        hint = self._watch.hint if wrong else ""
        if not wrong and self._bus.latency > SLOW_ADAPTER:
            wrong = [f"the adapter holds every reply back for {self._bus.latency * 1000:.0f} ms"]
            hint = f"echo 1 | sudo tee {timer_of(self._bus.port)}"
        online = self._watch.online and self._thread is not None and self._thread.is_alive()
        return Health(online, f"{self._name}: {'; '.join(wrong)}" if wrong else "", hint, counters)

    def _quality(self, reading: Reading[JointState]) -> Quality:
        if reading.value is None:
            return Quality.NONE
        return Quality.GOOD if self._clock.now() - reading.stamp <= FRESH else Quality.STALE

    def _reject(self, goals: Mapping[str, float], speeds: Mapping[str, float]) -> None:
        """Raise BadRequest with all that is wrong with a move."""
        unknown = sorted((goals.keys() | speeds.keys()) - self._joints.keys())
        wrong = [f"no joint {name!r} (there are {', '.join(self._joints)})" for name in unknown]
        for what, values in (("goal", goals), ("speed", speeds)):
            wrong += [
                f"{name}: a {what} of {value} is not finite" for name, value in values.items() if not isfinite(value)
            ]
        if wrong:
            raise BadRequest(f"{self._name}: {'; '.join(wrong)}")

    def _settle(self, *, stiff: bool) -> list[Joint]:
        """Hold or relax; return the joints whose servo did not confirm it."""
        with self._lock:
            for joint in self._joints.values():
                joint.wanted = stiff
            return settle(self._bus, self._joints.values(), stiff=stiff, now=self._clock.now())

    def _run(self) -> None:
        while not self._ending.is_set():
            started = self._clock.now()
            pause = 0.0
            try:
                self._round()
            except NotConnected as error:
                self._watch.lost(error)
                pause = RETRY
            except BaseException as error:  # SystemExit too: without this thread nobody would see the arm any more
                self._complain(error)
                pause = RETRY
            self._changed()
            self._ending.wait(pause or max(PERIOD / 5, started + PERIOD - self._clock.now()))

    def _round(self) -> None:
        if self._watch.connected:
            self._watch.look()
        else:
            self._watch.connect()
            self._connections += 1

    def _complain(self, error: BaseException) -> None:
        """Report what is wrong with the driver itself, unless it is the same as before."""
        if (fault := f"{type(error).__name__}: {error}") != self._fault:
            self._fault = fault
            self._report(Notice(self._name, "fault", fault))
