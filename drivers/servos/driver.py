"""An arm of Dynamixel servos as named joints: ``drivers.api.Joints`` over one bus.

A thread of the driver finds the servos, reads them as often as they need it (``attention``), finds them again
(``watch``), and leads joints that follow others (``leading``); commands go out at once from the caller's thread.
Nothing is ever written to a servo's EEPROM.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from math import inf
from threading import Event, RLock
from typing import Literal

from drivers.api import Away, Coupling, DeviceStatus, Health, JointState, Quality, Reading, Report, ignore
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.joints.refusals import check_couplings, check_move, check_names
from drivers.servos.attention import RESTING, Attention
from drivers.servos.bus import Bus
from drivers.servos.commanded import CommandedJoints, Leading
from drivers.servos.joint import Joint, JointSpec, check
from drivers.servos.models import MODELS
from drivers.servos.pace import Pace
from drivers.servos.telling import REMEDY
from drivers.servos.torque import go, go_on, insisting, recover, settle
from drivers.servos.watch import GRACE, Watch
from drivers.transport.adapter import timer_of
from drivers.transport.loop import MakeLoop, ThreadLoop, guarded

# What an arm says of itself: whether it is there, what is wrong with it, and the figures of its wire.

SLOW_ADAPTER = 0.004
"""Seconds for which an adapter may hold a reply back before it is worth a word."""


def health_of(name: str, bus: Bus, joints: Mapping[str, Joint], watch: Watch, *, runs: bool) -> Health:
    """Say whether the arm is there: the port open, its driver's thread runs, and at least one servo answers."""
    try:
        bus.require()
    except NotConnected as error:
        return Health(False, str(error), error.hint)
    wrong = [] if watch.connected else ["looking for the servos"]
    wrong += [f"{j.title} {j.complaint}" for j in joints.values() if not j.driven]
    hint = watch.hint if wrong else ""
    if shut := [f"{j.title} has shut down" for j in joints.values() if j.driven and j.shut]:
        wrong, hint = wrong + shut, hint or REMEDY
    if not wrong and bus.latency > SLOW_ADAPTER:
        wrong = [f"the adapter holds every reply back for {bus.latency * 1000:.0f} ms"]
        hint = f"echo 1 | sudo tee {timer_of(bus.port)}"
    return Health(watch.online and runs, f"{name}: {'; '.join(wrong)}" if wrong else "", hint)


def counted(bus: Bus, joints: Mapping[str, Joint], pace: Pace, *, connections: int) -> dict[str, int]:
    """Return the figures of the wire and of each servo."""
    counters = {"connections": connections, "rounds": pace.rounds, **bus.exchanges.counters("exchange")}
    counters |= {"achieved rate (Hz)": round(pace.achieved), "utilisation (%)": round(100 * pace.share)}
    tallies = {name: bus.tally(joint.spec.id) for name, joint in joints.items()}
    for figure in ("tries", "misses", "corrupt", "late", "refused"):
        counters[figure] = sum(getattr(tally, figure) for tally in tallies.values())
    return counters | {f"misses of {name}": tally.misses for name, tally in tallies.items()}


def readings(joints: Mapping[str, Joint], *, since: float) -> Mapping[str, Reading[JointState]]:
    """Return the newest reading of each joint; those are stale that were taken before ``since``."""
    newest = {name: joint.reading for name, joint in joints.items()}
    return {
        name: replace(reading, quality=Quality.STALE) if reading.good and reading.stamp < since else reading
        for name, reading in newest.items()
    }


RATE = 100.0
"""Rounds of readings a second at most, as far as the wire can carry them."""

RETRY = 0.5
"""Seconds between attempts to open the port."""

FRESH = 0.25
"""Seconds after which a reading is stale; to who does not keep asking, ``RESTING`` later."""

GO_ON = 0.01
"""Seconds between two looks at how far the joints are on their way, as often as the wire allows."""

GIVEN_WAY = 0.2
"""Seconds for which readings wait at most while somebody holds or relaxes joints, of which each is to confirm it."""


class DynamixelJoints(CommandedJoints):
    """The joints of an arm. It owns ``bus``: opens it, and closes it at the end.

    ``rate`` (Hz) is how often those joints are read that lead or follow, as far as the wire allows; others as often as
    ``drivers.servos.attention`` says. Callbacks are called mostly from the driver's thread, which ``loop`` makes.
    Raises BadRequest for joints that cannot be, all faults in one message.
    """

    def __init__(
        self,
        bus: Bus,
        joints: Mapping[str, JointSpec],
        clock: Clock,
        *,
        rate: float = RATE,
        at_rest: Literal["hold", "relax"] = "hold",
        away: Away | None = None,
        report: Report = ignore,
        changed: Callable[[], None] = ignore,
        loop: MakeLoop = ThreadLoop,
        name: str = "arm",
    ) -> None:
        check(name, dict(joints))
        if not 0 < rate <= 1000:
            raise BadRequest(f"{name}: joints are read 1 to 1000 times a second, not {rate}")
        described = {joint: Joint(joint, spec, MODELS[spec.model]) for joint, spec in joints.items()}
        super().__init__(described, clock, at_rest=at_rest, away=away, report=report, changed=changed, name=name)
        self._bus = bus
        self._rate = rate
        self._lock = RLock()
        self._leading = Leading(bus, self._joints, self._clamping, self._telling)
        self._watch = Watch(bus, self._joints, self._lock, clock, self._telling, self._absence)
        self._pace = Pace(rate)
        self._attention = Attention(rate, min(RESTING, self._absence.shortest / 3))
        self._loop = loop(f"joints {self.name}", self._turn, ignore)
        self._opened = False
        self._connections = 0
        self._went_on_at = 0.0
        self._calm = Event()  # while nobody holds or relaxes joints, which comes before the next reading
        self._calm.set()
        self._attended: frozenset[str] = frozenset()  # read as if they led
        self._then: Callable[[], object] = ignore
        self._fault = ""  # the newest of the driver's own that was reported

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start the thread that looks for the servos; does nothing if it runs."""
        if not self._opened:
            self._opened = True
            self._connections = 0
            self._absence.begin()
            self._loop.start()

    def close(self) -> None:
        """End the thread, bring the arm to rest and release the port. Safe from any state, more than once."""
        if not self._opened:
            return
        with ExitStack() as whatever_happens:
            whatever_happens.callback(self._release)
            whatever_happens.callback(self.rest)
            self._loop.end()

    def _release(self) -> None:
        self._opened = False
        self._bus.close()
        self._watch.end()
        self._connections = 0
        for joint in self._joints.values():
            joint.touched = joint.unsettled = False  # from now on it is no concern of ours

    def rest(self) -> None:
        """Hold or relax, as the robot file asks; tell which servos could not be brought to it. Never raises."""
        why = ""
        with self._lock:
            try:
                failed = self._settle(self._joints, stiff=self._stiff_at_rest)
                for _ in insisting(self._bus, failed, self._clock):
                    for joint in failed:
                        if not joint.answers:
                            self._watch.look_for(joint)
                    failed[:] = self._settle([joint.name for joint in failed], stiff=self._stiff_at_rest)
            except Exception as error:  # whatever it is, the port is still to be closed and other devices to be rested
                failed = [joint for joint in self._joints.values() if joint.touched]
                why = f" ({type(error).__name__}: {error})"
            self._telling.unrested(failed, stiff=self._stiff_at_rest, why=why)

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Start moving the named joints to ``goals`` (radians), all in one packet; return the goals after clamping.

        Joints that followed others do so no more. Goals that had to be clamped are told, once an episode. Joints whose
        servo is silent, shut down or not what it should be are left out, with a notice. Raises BadRequest
        for an unknown joint or a value that is not finite, NotConnected when the bus is gone or has just come back,
        DeviceFault while it is latched, or a joint is blocked.
        """
        asked, speeds = self._clock.now(), speeds or {}
        check_move(self.name, goals, speeds, self._joints)
        with self._lock:
            self._require(asked)
            now = self._clock.now()
            self._permit(goals, now)
            accepted = self._clamping.accept(goals, now)
            self._leading.end(goals)
            go(self._bus, [self._joints[name] for name in goals], accepted, speeds, now)
        self._loop.wake()
        return accepted

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Let joints follow others in every round from now on, until told otherwise; () ends it.

        Joints that follow no more stand where they are. A follower that is far from where it is led is brought over
        slowly before it goes as fast as it may. A lost bus ends nothing: when it is back, all stand where they are, and
        the followers are brought over anew. Raises BadRequest for couplings that cannot be, and NotConnected, but not
        in order to end them.
        """
        asked = self._clock.now()
        check_couplings(self.name, couplings, self._joints)
        with self._lock:
            if couplings:
                self._require(asked)
            if freed := self._leading.begin(couplings):
                self._command(freed, stiff=True)
        self._loop.wake()

    def attend(self, joints: Collection[str], then: Callable[[], object] = ignore) -> None:
        """Read ``joints`` as often as those that lead, and call ``then`` in each round. BadRequest: unknown joint."""
        check_names(self.name, set(joints), self._joints)
        self._attended, self._then = frozenset(joints), guarded(then)
        self._loop.wake()

    def recover(self) -> tuple[str, ...]:
        """Make servos that have shut themselves down stiff again where they stand; return the names of the joints.

        Those of protocol 2.0 start again for it, and are stiff about half a second later. For a person to ask for who
        has removed the cause; so it enables the arm as well. Raises NotConnected.
        """
        with self._lock:
            self._absence.enable()
            return tuple(joint.name for joint in recover(self._bus, self._joints.values(), now=self._clock.now()))

    def states(self) -> Mapping[str, Reading[JointState]]:
        """The newest state of each joint; stale after ``FRESH`` seconds without a reading.

        Joints at rest are read more seldom while nobody keeps asking.
        """
        now = self._clock.now()
        fresh = FRESH if self._attention.asked(now) else FRESH + RESTING
        return readings(self._joints, since=now - fresh)

    def health(self) -> Health:
        """Say whether the arm is there: the port open, and at least one servo answering."""
        counters = counted(self._bus, self._joints, self._pace, connections=self._connections)
        health = health_of(self.name, self._bus, self._joints, self._watch, runs=self._loop.alive)
        return replace(health, counters=counters, returned=self._absence.returned)

    def _require(self, asked: float) -> None:
        """Raise NotConnected unless what is told to a servo now lasts, and was ``asked`` since the arm was back."""
        self._bus.require()
        absent = self._absence.unheard(self._clock.now()) or self._absence.before_return(asked)
        if absent or not self._watch.connected:
            raise NotConnected(f"{self.name}: {self._bus.port}: looking for the servos", hint="try again")
        self._absence.require(self.name)

    def _command(self, names: Collection[str], *, stiff: bool) -> None:
        """Hold or relax; tell of the joints whose servo did not confirm it, and let the watch look after them."""
        self._calm.clear()
        try:
            with self._lock:
                for joint in self._settle(names, stiff=stiff):
                    joint.checked = -inf
                self._telling.unsettled(since=self._clock.now() - GRACE if self._bus.is_open else inf)
        finally:
            self._calm.set()
        self._loop.wake()

    def _settle(self, names: Collection[str], *, stiff: bool) -> list[Joint]:
        """Hold or relax; return the joints whose servo did not confirm it."""
        check_names(self.name, set(names), self._joints)
        with self._lock:
            self._leading.end(names)
            joints = [self._joints[name] for name in names]
            for joint in joints:
                joint.wanted = stiff
            unsettled = settle(self._bus, joints, stiff=stiff, now=self._clock.now())
            for joint in joints:
                joint.progress.hold(joint.goal if stiff else None)
            return unsettled

    # --- the driver's thread ------------------------------------------------------------------------------------------

    def _turn(self) -> float:
        pause = RETRY
        try:
            self._round()
            pause = self._pace.rest(self._clock.now(), self._bus.busy(), self._due_at())
        except NotConnected as error:
            self._watch.lost(error)
        except BaseException as error:  # SystemExit too: without this thread nobody would see the arm any more
            self._complain(error)
        self._changed()
        self._then()
        return pause

    def _due_at(self) -> float:
        """Return when there is something to be done next."""
        joints, now = self._joints.values(), self._clock.now()
        return min(self._attention.next_at(joints, self._leading.joints | self._attended, now), self._watch.due_at())

    def _round(self) -> None:
        if not self._watch.connected:
            self._watch.connect()
            self._connections += 1
            with self._lock:
                self._leading.pause()
            self._telling.slow(self._rate, self._bus.baud)
            self._pace.begin(self._clock.now(), self._bus.busy())
            return
        began = self._clock.now()
        if self._absence.heard(began):
            for joint in self._joints.values():
                joint.strayed = True
            self._stand()
        wanted = self._attention.wanted(self._joints.values(), self._leading.joints | self._attended, began)
        self._watch.read(wanted, meanwhile=self._go_on)
        self._give_up(wanted)
        with self._lock:
            self._leading.lead(since=began, now=self._clock.now())
        self._go_on()
        if self._watch.tend():
            self._stand()

    def _give_up(self, read: Collection[Joint]) -> None:
        """Hold the joints where they stand that do not get where they are sent; let go of those that run away."""
        with self._lock:
            for joint in self._look(read):
                self._leading.end([joint.name])
                joint.wanted = not joint.progress.runs_away
                settle(self._bus, [joint], stiff=joint.wanted, now=self._clock.now())

    def _stand(self) -> None:
        """Let what is stiff stand where it is, and nothing follow: what was decided before goes on no more."""
        with self._lock:
            self._leading.begin(())
            self._command([name for name, joint in self._joints.items() if joint.wanted], stiff=True)

    def _go_on(self) -> None:
        """Send the joints farther on their way that need it: on a slow wire a round takes longer than they wait.

        Who holds or relaxes joints meanwhile has the wire first: a lock is not given to who has waited for longest.
        """
        self._calm.wait(GIVEN_WAY)
        now = self._clock.now()
        if now - self._went_on_at >= GO_ON:
            self._went_on_at = now
            with self._lock:
                go_on(self._bus, self._joints.values(), now=now)

    def _complain(self, error: BaseException) -> None:
        """Report what is wrong with the driver itself, unless it is the same as before."""
        if (fault := f"{type(error).__name__}: {error}") != self._fault:
            self._fault = fault
            self._report(DeviceStatus(self.name, "fault", fault))
