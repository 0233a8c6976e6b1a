"""What the driver of an arm tells of its servos: each thing once, with what may help."""

from collections.abc import Iterable, Mapping
from math import degrees, inf

from drivers.api import DeviceStatus, Report
from drivers.servos.gathering import duration
from drivers.servos.joint import Joint
from drivers.servos.units import Protocol
from drivers.servos.wire import Fault

CURES = {
    Fault.VOLTAGE: "measure the supply at the last servo while the arm moves",
    Fault.OVERHEATING: "relax the arm and let it cool",
    Fault.OVERLOAD: "free the joint, or take the load off it",
    Fault.ENCODER: "switch its power off and on; if it comes back, the servo is broken",
    Fault.SHOCK: "look at its cable and its supply",
    Fault.CURRENT: "free the joint, or take the load off it",
}
SIGNS: Mapping[Protocol, str] = {
    1: "its torque limit is 0",
    2: "its torque is off until it starts again",
    "STS": "its torque was switched off",
}
NOT_BE = "could not be"
MOVES_ON = "a joint that nobody sends on comes to rest by itself; if one moves on, switch its power off by hand"
REMEDY = "free the joint, then `mission servo torque recover --robot FILE`, or switch the arm's power off and on"


class Telling:
    """The words for what happens to ``joints``. It remembers what has been told, so that nothing is told twice."""

    def __init__(self, name: str, joints: Mapping[str, Joint], report: Report) -> None:
        self._name = name
        self._joints = joints
        self._report = report
        self._online = False
        self._left_out: frozenset[str] = frozenset()
        self._unsettled: frozenset[str] = frozenset()
        self._unrested: list[str] = []

    def here(self, port: str) -> None:
        """Tell, if it is new, that servos answer on ``port``."""
        if not self._online:
            self._online = True
            answering = sum(joint.answers for joint in self._joints.values())
            self._tell("online", f"{answering} of {len(self._joints)} servos answer on {port}")

    def away(self, why: str, hint: str) -> None:
        """Tell, if it is new, that the arm as a whole is gone."""
        if self._online:
            self._online = False
            self._tell("offline", why, hint)

    def end(self) -> None:
        """Forget that it was there, without a word."""
        self._online = False
        self._unrested = []
        self._unsettled = frozenset()

    def differences(self, hint: str) -> None:
        """Tell in one notice of all servos that are missing or not what the robot file says."""
        wrong = [f"{joint.title} {joint.complaint}" for joint in self._joints.values() if not joint.driven]
        if wrong:
            self._tell("fault", f"{len(wrong)} of {len(self._joints)} servos: {'; '.join(wrong)}", hint)

    def found(self, joint: Joint, hint: str) -> None:
        """Tell of a servo that was not driven: it is now, or there is another reason."""
        if joint.driven:
            self._tell("online", f"{joint.title} is back")
        else:
            self._tell("fault", f"{joint.title} {joint.complaint}", hint)

    def gone(self, joint: Joint, hint: str) -> None:
        """Tell of a servo that has fallen silent."""
        self._tell("fault", f"{joint.title} does not answer any more", hint)

    def shut(self, joint: Joint) -> None:
        """Tell of a servo that has shut itself down."""
        self._tell("fault", f"{joint.title} has shut down: {SIGNS[joint.at.protocol]}", REMEDY)

    def faults(self, joint: Joint, risen: Fault) -> None:
        """Tell what newly ails a servo, with what it measured."""
        state = joint.reading.value
        felt = "" if state is None else f"{state.voltage:.1f} V, {state.temperature:.0f} °C, load {state.load:+.0%}"
        hint = "; ".join(cure for fault, cure in CURES.items() if fault & risen)
        self._tell("fault", f"{joint.title} reports {risen.words} ({felt})", hint)

    def dipped(self, joint: Joint) -> None:
        """Tell of a servo that had lost its settings."""
        how = "made stiff again where it stood" if joint.torque else "given them again"
        what = f"{joint.title} had lost its settings and was {how}"
        self._tell("fault", what, "its supply dips: measure it at the last servo while the arm moves")

    def elsewhere(self, joint: Joint, stood: float, found: float) -> None:
        """Tell of a joint that was away and is ``found`` elsewhere than it ``stood`` (radians)."""
        what = (
            f"{joint.title} stands at {degrees(found):.1f} deg, not at {degrees(stood):.1f} deg, where it stood before"
        )
        hint = (
            "it goes on from there, slowly; if its servo is another, or its horn has slipped, its zero may have changed"
        )
        self._tell("fault", what, f"{hint}: mission servo calibrate --zero --robot FILE")

    def unled(self, follower: Joint, leader: Joint) -> None:
        """Tell of a follower that stands still because nothing is heard of its leader."""
        self._tell("fault", f"{follower.title} stays where it is: nothing is heard of {leader.title}, which leads it")

    def slow(self, rate: float, baud: int) -> None:
        """Tell if the wire cannot carry ``rate`` rounds of readings a second, and what keeps it busy."""
        joints = [joint for joint in self._joints.values() if joint.driven]
        wire, waiting = duration(joints, baud)
        if wire + waiting <= 1 / rate:
            return
        cure = (
            "`mission servo set all return_delay 0 --robot FILE`"
            if waiting > wire / 4
            else "raise the baud rate of the servos"
        )
        what = f"a round of {len(joints)} servos takes {(wire + waiting) * 1000:.0f} ms"
        detail = f"{waiting * 1000:.0f} ms of it return delay: {1 / (wire + waiting):.0f} Hz instead of {rate:g} Hz"
        self._tell("fault", f"{what}, {detail}", f"{cure}, or set a lower rate in the robot file")

    def left_out(self) -> None:
        """Tell of joints that moves have begun to leave out."""
        left_out = frozenset(joint.name for joint in self._joints.values() if joint.left_out)
        for name in sorted(left_out - self._left_out):
            joint = self._joints[name]
            why = joint.complaint or ("has shut down" if joint.shut else "did not say where it stands")
            self._tell("fault", f"a move left {joint.title} out: it {why}")
        self._left_out = left_out

    def unsettled(self, since: float = inf) -> None:
        """Tell of joints that have left it open, ``since`` then or longer, whether they were held or relaxed."""
        open_ = [joint for joint in self._joints.values() if joint.unsettled and joint.unsettled_at <= since]
        new = [joint for joint in open_ if joint.name not in self._unsettled]
        for stiff in (True, False):
            hint = "they are told again as soon as they answer; if one moves on, switch its power off by hand"
            for what in _wanting([joint for joint in new if bool(joint.wanted) is stiff], stiff=stiff):
                self._tell("fault", what, hint)
        self._unsettled = (self._unsettled & self._unconfirmed()) | {joint.name for joint in open_}

    def unrested(self, joints: Iterable[Joint], *, stiff: bool, why: str = "") -> None:
        """Tell, if it is new, of joints that could not be brought to rest, or did not say whether they are.

        A run rests its robot, then closes it, which rests it once more.
        """
        wanting = _wanting(joints, stiff=stiff)
        if wanting and [*wanting, why] != self._unrested:
            for what in wanting:
                known = what.startswith(NOT_BE)
                self._tell("fault", what + why, "switch their power off by hand" if known else MOVES_ON)
        self._unrested = [*wanting, why]
        self._unsettled = self._unconfirmed()

    def _unconfirmed(self) -> frozenset[str]:
        return frozenset(name for name, joint in self._joints.items() if joint.unsettled)

    def _tell(self, kind: str, what: str, hint: str = "") -> None:
        self._report(DeviceStatus(self._name, kind, what, hint))


def _wanting(joints: Iterable[Joint], *, stiff: bool) -> list[str]:
    """Say of joints that are not at rest, as far as that is known; one that is not sent on comes to rest by itself."""
    silent = [joint.title for joint in joints if stiff and joint.mute]
    others = [joint.title for joint in joints if not (stiff and joint.mute)]
    found = [f"{NOT_BE} {'held' if stiff else 'relaxed'}: {', '.join(others)}"] if others else []
    return found + ([f"did not say whether they are held: {', '.join(silent)}"] if silent else [])
