"""What the driver of an arm does unasked: find the servos, read them, notice what is wrong, find them again."""

from collections.abc import Mapping
from threading import RLock

from drivers.api import JointState, Notice, Quality, Reading, Report
from drivers.clock import Clock
from drivers.dynamixel import models as m
from drivers.dynamixel.bus import Bus
from drivers.dynamixel.joining import difference, restore
from drivers.dynamixel.joint import Joint
from drivers.dynamixel.wire import LASTING, Fault
from drivers.errors import BadRequest, NoReply, NotConnected

MISSING_AFTER = 3
"""Readings without a reply, in a row, after which a servo counts as missing."""

SLOWLY = 1.0
"""Seconds between readings of what changes seldom, and between attempts to find a missing servo."""

STATE = (m.PRESENT_POSITION.address, m.MOVING.end - m.PRESENT_POSITION.address)
"""Address and size of the block that is read in every round: position to moving."""

SETTINGS = (m.TORQUE_ENABLE.address, m.TORQUE_LIMIT.end - m.TORQUE_ENABLE.address)
"""Address and size of the block that is read slowly: torque enable to torque limit."""


class Watch:
    """Keeps the driver's picture of its joints up to date. All but what it tells is for one thread.

    ``connected`` is True once every servo was looked for on a port that is open. ``lock`` is the driver's own, held
    wherever a servo's torque or goal is changed.
    """

    def __init__(
        self, name: str, bus: Bus, joints: Mapping[str, Joint], lock: RLock, clock: Clock, report: Report
    ) -> None:
        self.connected = False
        self._name = name
        self._bus = bus
        self._joints = joints
        self._lock = lock
        self._clock = clock
        self._report = report
        self._was_online = False
        self._left_out: frozenset[str] = frozenset()

    @property
    def online(self) -> bool:
        """True while the servos were looked for on a port that is open, and at least one answers."""
        return self.connected and self._bus.is_open and any(joint.answers for joint in self._joints.values())

    @property
    def hint(self) -> str:
        """What to look at when servos are missing or differ."""
        return f"check power and cable, then ID, model and baud rate ({self._bus.baud}) of the servos named"

    def connect(self) -> None:
        """Open the port and look for every servo; tell in one notice all that are missing or not what they should be.

        Raises NotConnected.
        """
        self._bus.open()
        for joint in self._joints.values():
            joint.answers, joint.failures = False, 0
            self._join(joint)
        self.connected = True  # only now: a joint that is looked for is stopped where it stands
        wrong = [f"{joint.title} {joint.complaint}" for joint in self._joints.values() if not joint.driven]
        self._tell_presence()
        if wrong:
            self._tell("fault", f"{len(wrong)} of {len(self._joints)} servos: {'; '.join(wrong)}", self.hint)

    def lost(self, error: NotConnected) -> None:
        """Take note that the port is gone."""
        self.connected = False
        self._tell_presence(str(error), error.hint)

    def end(self) -> None:
        """Forget the connection without a word: it was closed on purpose."""
        self.connected = self._was_online = False

    def look(self) -> None:
        """Read every servo that is due, once. Raises NotConnected."""
        self._bus.require()
        for joint in self._joints.values():
            if self._clock.now() >= joint.due:
                if joint.driven:
                    self._read(joint)
                else:
                    self._find(joint)
        self._tell_presence()
        self._tell_left_out()

    def _find(self, joint: Joint) -> None:
        """Look for a servo that is not driven, and tell if something about it has changed."""
        before = joint.complaint
        self._join(joint)
        if joint.driven:
            self._tell("online", f"{joint.title} is back")
        elif joint.complaint != before:
            self._tell("fault", f"{joint.title} {joint.complaint}", self.hint)

    def _join(self, joint: Joint) -> None:
        """Identify one servo and restore its settings; leave the reason in its ``complaint`` if that fails."""
        with self._lock:
            try:
                joint.complaint = difference(self._bus, joint)
                joint.answers = True
                if joint.driven:
                    restore(self._bus, joint)
            except NoReply:
                joint.complaint, joint.answers = "does not answer", False
            except BadRequest as error:
                joint.complaint = f"refuses its settings ({error})"
        joint.checked = self._clock.now()
        joint.due = joint.checked + SLOWLY
        joint.failures = 0 if joint.driven else MISSING_AFTER
        if joint.driven:
            self._read(joint)
            if joint.shut:
                self._tell_shut(joint)

    def _read(self, joint: Joint) -> None:
        """Take one reading; after a miss wait longer before the next, lest one servo slow the others down."""
        try:
            self._take_state(joint)
            if self._clock.now() - joint.checked >= SLOWLY:
                self._check(joint)
        except (NoReply, BadRequest):
            joint.failures += 1
            joint.due = self._clock.now() + min(SLOWLY, 0.05 * 2**joint.failures)
            if joint.failures >= MISSING_AFTER:
                joint.complaint, joint.answers = "does not answer", False
                self._tell("fault", f"{joint.title} does not answer any more", self.hint)
        else:
            joint.failures, joint.due = 0, 0.0

    def _take_state(self, joint: Joint) -> None:
        start, size = STATE
        data = self._bus.read_block(joint.spec.id, start, size)
        state = JointState(
            position=joint.angle(m.PRESENT_POSITION.decode(data, start)),
            velocity=joint.model.speed(m.PRESENT_SPEED.decode(data, start)) * joint.spec.direction,
            goal=joint.goal,
            load=m.signed(m.PRESENT_LOAD.decode(data, start)) / m.FULL * joint.spec.direction,
            voltage=m.PRESENT_VOLTAGE.decode(data, start) / 10,
            temperature=float(m.PRESENT_TEMPERATURE.decode(data, start)),
            moving=bool(m.MOVING.decode(data, start)),
            torque=joint.torque,
        )
        joint.reading = Reading(state, self._clock.now(), Quality.GOOD)
        faults = self._bus.faults(joint.spec.id) & LASTING
        risen, joint.faults = faults & ~joint.faults, faults
        if risen:
            self._tell_faults(joint, state, risen)

    def _check(self, joint: Joint) -> None:
        """Look whether the servo has shut down, or has lost its settings in a dip of the supply."""
        start, size = SETTINGS
        with self._lock:
            data = self._bus.read_block(joint.spec.id, start, size)
            joint.checked = self._clock.now()
            joint.torque = bool(m.TORQUE_ENABLE.decode(data, start))
            shut = m.TORQUE_LIMIT.decode(data, start) == 0
            newly_shut, joint.shut = shut and not joint.shut, shut
            lost = bool(joint.wanted) and not joint.torque and not shut
            if lost:
                restore(self._bus, joint)
        if newly_shut:
            self._tell_shut(joint)
        if lost:
            what = f"{joint.title} had lost its settings and was made stiff again where it stood"
            self._tell("fault", what, "its supply dips: measure it at the last servo while the arm moves")

    def _tell(self, kind: str, what: str, hint: str = "") -> None:
        self._report(Notice(self._name, kind, what, hint))

    def _tell_presence(self, why: str = "no servo answers", hint: str = "") -> None:
        """Tell when the arm as a whole has come or gone."""
        online = self.online
        if online and not self._was_online:
            answering = sum(joint.answers for joint in self._joints.values())
            self._tell("online", f"{answering} of {len(self._joints)} servos answer on {self._bus.port}")
        elif self._was_online and not online:
            self._tell("offline", why, hint or self.hint)
        self._was_online = online

    def _tell_left_out(self) -> None:
        """Tell of joints that moves have begun to leave out."""
        left_out = frozenset(joint.name for joint in self._joints.values() if joint.left_out)
        for name in sorted(left_out - self._left_out):
            joint = self._joints[name]
            why = joint.complaint or ("has shut down" if joint.shut else "did not say where it stands")
            self._tell("fault", f"a move left {joint.title} out: it {why}")
        self._left_out = left_out

    def _tell_faults(self, joint: Joint, state: JointState, risen: Fault) -> None:
        figures = f"{state.voltage:.1f} V, {state.temperature:.0f} °C, load {state.load:+.0%}"
        cures = {
            Fault.VOLTAGE: "measure the supply at the last servo while the arm moves",
            Fault.OVERHEATING: "relax the arm and let it cool",
            Fault.OVERLOAD: "free the joint, or take the load off it",
        }
        hint = "; ".join(cure for fault, cure in cures.items() if fault & risen)
        self._tell("fault", f"{joint.title} reports {risen.words} ({figures})", hint)

    def _tell_shut(self, joint: Joint) -> None:
        self._tell(
            "fault",
            f"{joint.title} has shut down: its torque limit is 0",
            "free the joint, then switch the arm's power off and on",
        )
