"""Status reports of an arm driver on its servos. Each event is reported once, with a hint."""

from collections.abc import Iterable, Mapping
from math import degrees, inf

from drivers.api import DeviceStatus, StatusCallback
from drivers.servos.joint import Joint
from drivers.servos.sync_read import round_duration
from drivers.servos.units import Protocol
from drivers.servos.wire import ServoFault

FAULT_HINTS = {
    ServoFault.VOLTAGE: "measure the supply at the last servo while the arm moves",
    ServoFault.OVERHEATING: "relax the arm and let it cool",
    ServoFault.OVERLOAD: "free the joint, or take the load off it",
    ServoFault.ENCODER: "switch its power off and on; if it comes back, the servo is broken",
    ServoFault.SHOCK: "check its cable and its supply",
    ServoFault.CURRENT: "free the joint, or take the load off it",
}
SHUTDOWN_SIGNS: Mapping[Protocol, str] = {
    1: "its torque limit is 0",
    2: "its torque is off until it reboots",
    "STS": "its torque was switched off",
}
COULD_NOT_BE = "could not be"
UNCONFIRMED_HINT = "a joint without new setpoints stops by itself; if one moves on, switch its power off by hand"
SHUTDOWN_HINT = "free the joint, then `mission servo torque recover --robot FILE`, or switch the arm's power off and on"


class ServoReporter:
    """Reports events of ``joints``. It stores the reported ones, so that none is reported twice."""

    def __init__(self, name: str, joints: Mapping[str, Joint], report: StatusCallback) -> None:
        self._name = name
        self._joints = joints
        self._report = report
        self._online = False
        self._reported_excluded: frozenset[str] = frozenset()
        self._reported_unconfirmed: frozenset[str] = frozenset()
        self._reported_not_at_rest: list[str] = []

    def report_online(self, port: str) -> None:
        """Report, once, that servos answer on ``port``."""
        if not self._online:
            self._online = True
            answering = sum(joint.is_answering for joint in self._joints.values())
            self._send_status("online", f"{answering} of {len(self._joints)} servos answer on {port}")

    def report_offline(self, reason: str, hint: str) -> None:
        """Report, once, that the whole arm has disconnected, for ``reason``."""
        if self._online:
            self._online = False
            self._send_status("offline", reason, hint)

    def reset(self) -> None:
        """Forget the reported events, without a report."""
        self._online = False
        self._reported_not_at_rest = []
        self._reported_unconfirmed = frozenset()

    def report_mismatches(self, hint: str) -> None:
        """Report, in one notice, all servos that are missing or differ from the robot file."""
        wrong = [f"{joint.title} {joint.undriven_reason}" for joint in self._joints.values() if not joint.is_driven]
        if wrong:
            self._send_status("fault", f"{len(wrong)} of {len(self._joints)} servos: {'; '.join(wrong)}", hint)

    def report_driven(self, joint: Joint, hint: str) -> None:
        """Report that a servo is driven again or, if it is not, the new reason."""
        if joint.is_driven:
            self._send_status("online", f"{joint.title} is back")
        else:
            self._send_status("fault", f"{joint.title} {joint.undriven_reason}", hint)

    def report_lost(self, joint: Joint, hint: str) -> None:
        """Report that a servo no longer answers."""
        self._send_status("fault", f"{joint.title} no longer answers", hint)

    def report_shutdown(self, joint: Joint) -> None:
        """Report that a servo has shut itself down."""
        self._send_status(
            "fault", f"{joint.title} has shut down: {SHUTDOWN_SIGNS[joint.address.protocol]}", SHUTDOWN_HINT
        )

    def report_faults(self, joint: Joint, new_faults: ServoFault) -> None:
        """Report new faults of a servo, with its readings."""
        state = joint.reading.value
        felt = "" if state is None else f"{state.voltage:.1f} V, {state.temperature:.0f} °C, load {state.load:+.0%}"
        hint = "; ".join(cure for fault, cure in FAULT_HINTS.items() if fault & new_faults)
        self._send_status("fault", f"{joint.title} reports {new_faults.description} ({felt})", hint)

    def report_voltage_dip(self, joint: Joint) -> None:
        """Report that a servo has lost its settings in a voltage dip, and that they were restored."""
        how = "held again at its position" if joint.torque else "given them back"
        what = f"{joint.title} had lost its settings and was {how}"
        self._send_status("fault", what, "its supply dips: measure it at the last servo while the arm moves")

    def report_displacement(self, joint: Joint, expected: float, actual: float) -> None:
        """Report a joint that reconnected at position ``actual`` instead of ``expected`` (radians)."""
        what = f"{joint.title} stands at {degrees(actual):.1f} deg, not at {degrees(expected):.1f} deg as before"
        hint = "it continues slowly from there; with a new servo or a slipped horn, its zero may have changed"
        self._send_status("fault", what, f"{hint}: mission servo calibrate --zero --robot FILE")

    def report_silent_leader(self, follower: Joint, leader: Joint) -> None:
        """Report a follower that stands still because its leader sends no readings."""
        self._send_status("fault", f"{follower.title} holds its position: no readings of its leader {leader.title}")

    def report_slow_bus(self, rate: float, baud: int) -> None:
        """Report, with the cause, if the bus is too slow to read the servos ``rate`` times a second."""
        joints = [joint for joint in self._joints.values() if joint.is_driven]
        wire, waiting = round_duration(joints, baud)
        if wire + waiting <= 1 / rate:
            return
        cure = (
            "`mission servo set all return_delay 0 --robot FILE`"
            if waiting > wire / 4
            else "raise the baud rate of the servos"
        )
        what = f"a round of {len(joints)} servos takes {(wire + waiting) * 1000:.0f} ms"
        detail = f"{waiting * 1000:.0f} ms of it return delay: {1 / (wire + waiting):.0f} Hz instead of {rate:g} Hz"
        self._send_status("fault", f"{what}, {detail}", f"{cure}, or set a lower rate in the robot file")

    def report_excluded(self) -> None:
        """Report the joints that the newest move has left out, except those that the move before left out as well."""
        left_out = frozenset(joint.name for joint in self._joints.values() if joint.excluded_from_move)
        for name in sorted(left_out - self._reported_excluded):
            joint = self._joints[name]
            why = joint.undriven_reason or ("has shut down" if joint.is_shut_down else "did not report its position")
            self._send_status("fault", f"a move left {joint.title} out: it {why}")
        self._reported_excluded = left_out

    def report_unconfirmed(self, since: float = inf) -> None:
        """Report, once, joints with a hold or relax that has been unconfirmed since time ``since`` or earlier."""
        open_ = [joint for joint in self._joints.values() if joint.is_unconfirmed and joint.unconfirmed_since <= since]
        new = [joint for joint in open_ if joint.name not in self._reported_unconfirmed]
        for stiff in (True, False):
            hint = "the command is repeated as soon as they answer; if one moves on, switch its power off by hand"
            for what in _describe_not_at_rest(
                [joint for joint in new if bool(joint.torque_request) is stiff], stiff=stiff
            ):
                self._send_status("fault", what, hint)
        self._reported_unconfirmed = (self._reported_unconfirmed & self._unconfirmed_joints()) | {
            joint.name for joint in open_
        }

    def report_not_at_rest(self, joints: Iterable[Joint], *, stiff: bool, reason: str = "") -> None:
        """Report joints that are not at rest, or did not confirm it; ``stiff`` is True if they are to hold.

        A report equal to the one before is omitted, because a run brings the robot to rest twice at its end.
        """
        wanting = _describe_not_at_rest(joints, stiff=stiff)
        if wanting and [*wanting, reason] != self._reported_not_at_rest:
            for what in wanting:
                known = what.startswith(COULD_NOT_BE)
                self._send_status(
                    "fault", what + reason, "switch their power off by hand" if known else UNCONFIRMED_HINT
                )
        self._reported_not_at_rest = [*wanting, reason]
        self._reported_unconfirmed = self._unconfirmed_joints()

    def _unconfirmed_joints(self) -> frozenset[str]:
        return frozenset(name for name, joint in self._joints.items() if joint.is_unconfirmed)

    def _send_status(self, kind: str, message: str, hint: str = "") -> None:
        self._report(DeviceStatus(self._name, kind, message, hint))


def _describe_not_at_rest(joints: Iterable[Joint], *, stiff: bool) -> list[str]:
    """Return messages on joints that are not confirmed to be at rest.

    A silent joint stops by itself at its last setpoint.
    """
    silent = [joint.title for joint in joints if stiff and joint.lacks_confirmation]
    others = [joint.title for joint in joints if not (stiff and joint.lacks_confirmation)]
    found = [f"{COULD_NOT_BE} {'held' if stiff else 'relaxed'}: {', '.join(others)}"] if others else []
    return found + ([f"did not confirm that they are held: {', '.join(silent)}"] if silent else [])
