"""What the driver of an arm does unasked: find the servos, read them, notice what is wrong, find them again."""

from collections.abc import Callable, Mapping, Sequence
from math import ceil, inf
from threading import RLock

from drivers.api import Quality, Reading
from drivers.clock import Clock
from drivers.errors import BadRequest, NoReply, NotConnected
from drivers.servos.attention import RESTING
from drivers.servos.bus import Bus
from drivers.servos.gathering import Gathering
from drivers.servos.joining import absence, difference, read, restore
from drivers.servos.joint import Joint
from drivers.servos.telling import Telling
from drivers.servos.torque import enable, settle
from drivers.servos.wire import LASTING, Fault
from drivers.transport.reconnect import Absence

MISSING_AFTER = 3
"""Readings without a reply, in a row, after which a servo counts as missing."""

SLOWLY = 1.0
"""Seconds between readings of what changes seldom, and between attempts to find a missing servo."""

SOON = 0.05
"""Seconds after which a servo is told again that has not confirmed that it is held or limp."""

REST_AFTER_MISSES = 0.2
"""Seconds for which a servo that has missed two readings in a row is left alone, lest it slow the others down."""


GRACE = 1.0
"""Seconds that a servo has to confirm that it is held or limp: on a busy machine its reply may be late."""


class Watch:
    """Keeps the driver's picture of its joints up to date. For one thread.

    ``connected`` is True once every servo was looked for on a port that is open. ``lock`` is the driver's own, held
    wherever a servo's torque or goal is changed. ``absence`` is that of the arm, which one servo of it may cause.
    """

    def __init__(
        self,
        bus: Bus,
        joints: Mapping[str, Joint],
        lock: RLock,
        clock: Clock,
        telling: Telling,
        absence: Absence,
    ) -> None:
        self.connected = False
        self._bus = bus
        self._joints = tuple(joints.values())
        self._lock = lock
        self._clock = clock
        self._telling = telling
        self._absence = absence
        self._gathering = Gathering(bus, clock)

    @property
    def online(self) -> bool:
        """True while the servos were looked for on a port that is open, and at least one answers."""
        return self.connected and self._bus.is_open and any(joint.answers for joint in self._joints)

    @property
    def hint(self) -> str:
        """What helps against what keeps servos from being driven: the cures that are known, else where to look."""
        wrong = [joint for joint in self._joints if not joint.driven]
        cures = list(dict.fromkeys(joint.cure for joint in wrong if joint.cure))
        if any(not joint.cure for joint in wrong) or not wrong:
            cures.append(
                f"check power and cable, then ID, model and baud rate ({self._bus.baud}) of the servos named: "
                "`mission servo scan --robot FILE` shows what answers"
            )
        return "; ".join(cures)

    def connect(self) -> None:
        """Open the port and look for every servo; tell in one notice all that are missing or not what they should be.

        Raises NotConnected.
        """
        self._bus.open()
        self._gathering.reset()
        for joint in self._joints:
            joint.answers, joint.failures = False, 0
            self.look_for(joint)
        self.connected = True  # only now: a joint that is looked for is stopped where it stands
        self._tell_presence()
        self._telling.differences(self.hint)

    def lost(self, error: NotConnected) -> None:
        """Take note that the port is gone."""
        self.connected = False
        self._telling.away(str(error), error.hint)

    def end(self) -> None:
        """Forget the connection without a word: it was closed on purpose."""
        self.connected = False
        self._telling.end()

    def read(self, joints: Sequence[Joint], meanwhile: Callable[[], None]) -> None:
        """Read each of ``joints`` once; do something ``meanwhile``, after each. Raises NotConnected."""
        self._bus.require()
        for joint, answered in self._gathering.read(joints):
            if answered:
                self._take(joint)
            else:
                self._miss(joint)
            meanwhile()

    def tend(self) -> bool:
        """Do what is due but seldom: look for one servo that is missing, and check a few that are not.

        Say if one is back after which nothing of before goes on. Raises NotConnected.
        """
        now, returned = self._clock.now(), False
        if missing := [joint for joint in self._joints if not joint.driven and now >= joint.due]:
            returned = self._find(min(missing, key=lambda joint: joint.due))
        waiting = [joint for joint in self._joints if joint.driven and now - joint.checked >= _interval(joint)]
        for joint in sorted(waiting, key=lambda joint: joint.checked)[: ceil(len(self._joints) * RESTING / SLOWLY)]:
            self._check(joint)
        self._tell_presence()
        self._telling.left_out()
        with self._lock:
            self._telling.unsettled(since=now - GRACE)
        return returned

    def _find(self, joint: Joint) -> bool:
        """Look for a servo that is not driven, and tell if something about it has changed; say as ``tend``."""
        before, seen = joint.complaint, joint.reading
        with self._lock:  # nobody moves it before it is known how long it was away
            self.look_for(joint)
            now = self._clock.now()
            back = joint.driven and seen.value is not None
            returned = back and self._absence.back(now, now - seen.stamp, who=joint.title)
            joint.strayed = joint.strayed or returned
        if joint.unsettled and joint.answers:
            with self._lock:
                self._settle(joint)
        if joint.complaint != before:
            self._telling.found(joint, joint.cure or self.hint)
        return returned

    def look_for(self, joint: Joint) -> None:
        """Identify one servo and restore its settings; leave the reason in its ``complaint`` if that fails."""
        corrupt = self._bus.tally(joint.spec.id).corrupt
        with self._lock:
            try:
                complaint = difference(self._bus, joint)
                joint.answers = True
                if not complaint:
                    self._compare(joint)
                    restore(self._bus, joint, now=self._clock.now())
            except NoReply:
                complaint, joint.answers = absence(self._bus, joint, corrupt), False
            except BadRequest as error:
                complaint = f"refuses its settings ({error})"
                joint.cure = f"mission servo info {joint.spec.id} --robot FILE"
            joint.complaint = complaint
        joint.checked = self._clock.now()
        joint.due = 0.0 if joint.driven else joint.checked + SLOWLY
        joint.failures = 0 if joint.driven else MISSING_AFTER
        if joint.driven:
            for each, answered in self._gathering.read([joint]):
                if answered:
                    self._take(each)
            if joint.shut:
                self._telling.shut(joint)

    def _compare(self, joint: Joint) -> None:
        """Tell if a joint that was away stands elsewhere than it stood. Raises NoReply, NotConnected, BadRequest."""
        found = joint.angle(self._bus.read(joint.at, joint.model.table["present_position"]))
        if (stood := joint.stood(found)) is not None:
            joint.strayed = True
            self._telling.elsewhere(joint, stood, found)

    def _take(self, joint: Joint) -> None:
        """Take in what a servo felt."""
        joint.failures, joint.due = 0, 0.0
        joint.reading = Reading(joint.state(), self._clock.now(), Quality.GOOD)
        told = self._bus.faults(joint.spec.id)
        if told != joint.told:
            if told & ~joint.told & (LASTING if joint.at.protocol == "STS" else Fault.ALERT):
                joint.checked = -SLOWLY  # it is checked next, and says what is the matter
            joint.told = told
            self._feel(joint)

    def _feel(self, joint: Joint) -> None:
        """Tell what newly ails a servo."""
        ailing = joint.ailing
        risen, joint.faults = ailing & ~joint.faults, ailing
        if risen:
            self._telling.faults(joint, risen)

    def _miss(self, joint: Joint) -> None:
        """Ask again in the next round, then once more after a while; then count the servo as missing."""
        joint.failures += 1
        now = self._clock.now()
        joint.due = now + REST_AFTER_MISSES if joint.failures > 1 else now
        if joint.failures >= MISSING_AFTER:
            joint.complaint, joint.answers, joint.due = "does not answer", False, now + SLOWLY
            self._telling.gone(joint, self.hint)

    def _check(self, joint: Joint) -> None:
        """Look whether the servo has shut down, has lost its settings in a dip of the supply, or has missed a word."""
        joint.checked = self._clock.now()
        lost = False
        try:
            with self._lock:
                for block in joint.model.table.slow:
                    read(self._bus, joint, block, tries=1)
                joint.torque = bool(joint.value("torque_enable"))
                stays = joint.shut and joint.at.protocol == "STS"  # let go, it tells of no overload any more
                newly_shut, joint.shut = joint.down and not joint.shut, joint.down or stays
                if joint.shut and joint.torque and joint.at.protocol == "STS":
                    enable(self._bus, joint, on=False)  # its force would return by itself, to an old goal
                    joint.torque = False
                elif joint.unsettled:
                    self._settle(joint)
                elif lost := self._forgot(joint):
                    restore(self._bus, joint, now=self._clock.now())
                elif joint.astray:
                    joint.sent = None  # it did not hear it: it is sent there anew
        except (NoReply, BadRequest):
            self._miss(joint)
            return
        self._feel(joint)
        if newly_shut:
            self._telling.shut(joint)
        if lost:
            self._telling.dipped(joint)

    def _settle(self, joint: Joint) -> None:
        """Hold or relax a servo once more that has not confirmed it."""
        settle(self._bus, [joint], stiff=bool(joint.wanted), now=self._clock.now())

    def _forgot(self, joint: Joint) -> bool:
        """Whether a servo that has not shut down is without its torque or its torque limit."""
        limp = bool(joint.wanted) and not joint.torque
        return not joint.shut and (limp or joint.value(joint.model.table.torque_limit) != joint.torque_ticks)

    def due_at(self) -> float:
        """Return when the next servo is to be told again that has not confirmed its rest; infinity for none."""
        return min((joint.checked + SOON for joint in self._joints if joint.unsettled and joint.driven), default=inf)

    def _tell_presence(self) -> None:
        if self.online:
            self._telling.here(self._bus.port)
        else:
            self._telling.away("no servo answers", self.hint)


def _interval(joint: Joint) -> float:
    """Return the seconds between two checks of a joint."""
    return SOON if joint.unsettled else SLOWLY - RESTING  # it comes in the next round
