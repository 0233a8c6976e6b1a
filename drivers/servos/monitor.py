"""Monitor of an arm's servos: find them, read them, detect faults, and find lost ones again."""

from collections.abc import Callable, Mapping, Sequence
from math import ceil, inf
from threading import RLock

from drivers.api import Quality, Reading
from drivers.clock import Clock
from drivers.errors import BadRequest, NoReply, NotConnected
from drivers.servos.bus import ServoBus
from drivers.servos.joint import Joint
from drivers.servos.joint_setup import diagnose_no_reply, find_mismatch, read_table_block, restore_settings
from drivers.servos.poll_rate import RESTING_INTERVAL
from drivers.servos.status_report import ServoReporter
from drivers.servos.sync_read import GroupReader
from drivers.servos.torque import hold_or_relax, set_torque
from drivers.servos.wire import LASTING_FAULTS, ServoFault
from drivers.transport.reconnect import ReconnectTracker

MAX_MISSED_READS = 3
"""Consecutive readings without a reply after which a servo counts as missing."""

CHECK_INTERVAL = 1.0
"""Seconds between reads of slow registers, and between attempts to find a missing servo."""

CONFIRMATION_RETRY_INTERVAL = 0.05
"""Seconds after which a hold or relax that the servo has not confirmed is repeated."""

MISSED_READ_PAUSE = 0.2
"""Seconds for which a servo is not read after two missed readings, so that it does not delay the others."""


CONFIRMATION_TIMEOUT = 1.0
"""Seconds that a servo has to confirm a hold or relax before it is reported: replies may be late on a busy machine."""


class JointMonitor:
    """Finds the servos of an arm, reads them, and keeps the state of its joints up to date. Not thread-safe.

    ``connected`` is True once every servo was looked for on an open port. ``lock`` is the lock of the driver; it is
    held while torque or goal of a servo changes. ``absence`` tracks how long the arm was disconnected; a single servo
    that is gone counts as well.
    """

    def __init__(
        self,
        bus: ServoBus,
        joints: Mapping[str, Joint],
        lock: RLock,
        clock: Clock,
        reporter: ServoReporter,
        absence: ReconnectTracker,
    ) -> None:
        self.connected = False
        self._bus = bus
        self._joints = tuple(joints.values())
        self._lock = lock
        self._clock = clock
        self._reporter = reporter
        self._absence = absence
        self._group_reader = GroupReader(bus, clock)

    @property
    def online(self) -> bool:
        """True if all servos were looked for on an open port, and at least one answers."""
        return self.connected and self._bus.is_open and any(joint.is_answering for joint in self._joints)

    @property
    def hint(self) -> str:
        """Remedy for servos that are not driven: the hint of each of these servos, and general advice."""
        wrong = [joint for joint in self._joints if not joint.is_driven]
        cures = list(dict.fromkeys(joint.hint for joint in wrong if joint.hint))
        if any(not joint.hint for joint in wrong) or not wrong:
            cures.append(
                f"check power and cable, then ID, model and baud rate ({self._bus.baud}) of the servos named: "
                "`mission servo scan --robot FILE` lists the servos"
            )
        return "; ".join(cures)

    def connect(self) -> None:
        """Open the port and look for every servo; report all that are missing or not as configured in one notice.

        Raises NotConnected.
        """
        self._bus.open()
        self._group_reader.reset()
        for joint in self._joints:
            joint.is_answering, joint.missed_reads = False, 0
            self.identify(joint)
        self.connected = True  # only now: a joint that is searched for is stopped at its position
        self._report_presence()
        self._reporter.report_mismatches(self.hint)

    def on_port_lost(self, error: NotConnected) -> None:
        """Record that the port is gone."""
        self.connected = False
        self._reporter.report_offline(str(error), error.hint)

    def reset(self) -> None:
        """Forget the connection to the servos without a report: it was closed on purpose."""
        self.connected = False
        self._reporter.reset()

    def read(self, joints: Sequence[Joint], after_each: Callable[[], None]) -> None:
        """Read each of ``joints`` once; call ``after_each`` after each joint. Raises NotConnected."""
        self._bus.require_open()
        for joint, answered in self._group_reader.read(joints):
            if answered:
                self._update_reading(joint)
            else:
                self._on_missed_read(joint)
            after_each()

    def run_checks(self) -> bool:
        """Look for one missing servo, and check the slow registers of those servos whose check is due.

        Returns True if a servo is back after so long an absence that older commands must be dropped. Raises
        NotConnected.
        """
        now, returned = self._clock.now(), False
        if missing := [joint for joint in self._joints if not joint.is_driven and now >= joint.next_read_at]:
            returned = self._find_missing(min(missing, key=lambda joint: joint.next_read_at))
        waiting = [
            joint for joint in self._joints if joint.is_driven and now - joint.checked_at >= _check_interval(joint)
        ]
        for joint in sorted(waiting, key=lambda joint: joint.checked_at)[
            : ceil(len(self._joints) * RESTING_INTERVAL / CHECK_INTERVAL)
        ]:
            self._check(joint)
        self._report_presence()
        self._reporter.report_excluded()
        with self._lock:
            self._reporter.report_unconfirmed(since=now - CONFIRMATION_TIMEOUT)
        return returned

    def _find_missing(self, joint: Joint) -> bool:
        """Look for a servo that is not driven; report it if the reason has changed, or if the servo is driven now.

        Returns True if it is back after a long absence, as ``run_checks`` does.
        """
        before, seen = joint.undriven_reason, joint.reading
        with self._lock:  # no moves before the length of the absence is known
            self.identify(joint)
            now = self._clock.now()
            back = joint.is_driven and seen.value is not None
            returned = back and self._absence.on_return(now, now - seen.stamp, name=joint.title)
            joint.approaches_slowly = joint.approaches_slowly or returned
        if joint.is_unconfirmed and joint.is_answering:
            with self._lock:
                self._repeat_hold_or_relax(joint)
        if joint.undriven_reason != before:
            self._reporter.report_driven(joint, joint.hint or self.hint)
        return returned

    def identify(self, joint: Joint) -> None:
        """Identify a servo and restore its settings; on failure set its ``undriven_reason``."""
        corrupt = self._bus.statistics(joint.spec.id).corrupt
        with self._lock:
            try:
                complaint = find_mismatch(self._bus, joint)
                joint.is_answering = True
                if not complaint:
                    self._check_displacement(joint)
                    restore_settings(self._bus, joint, now=self._clock.now())
            except NoReply:
                complaint, joint.is_answering = diagnose_no_reply(self._bus, joint, corrupt), False
            except BadRequest as error:
                complaint = f"refuses its settings ({error})"
                joint.hint = f"mission servo info {joint.spec.id} --robot FILE"
            joint.undriven_reason = complaint
        joint.checked_at = self._clock.now()
        joint.next_read_at = 0.0 if joint.is_driven else joint.checked_at + CHECK_INTERVAL
        joint.missed_reads = 0 if joint.is_driven else MAX_MISSED_READS
        if joint.is_driven:
            for each, answered in self._group_reader.read([joint]):
                if answered:
                    self._update_reading(each)
            if joint.is_shut_down:
                self._reporter.report_shutdown(joint)

    def _check_displacement(self, joint: Joint) -> None:
        """Report a reconnected joint that was moved while it was offline. Raises NoReply, NotConnected, BadRequest."""
        found = joint.angle(self._bus.read(joint.address, joint.model.table["present_position"]))
        if (stood := joint.expected_position(found)) is not None:
            joint.approaches_slowly = True
            self._reporter.report_displacement(joint, stood, found)

    def _update_reading(self, joint: Joint) -> None:
        """Store a new reading and its faults."""
        joint.missed_reads, joint.next_read_at = 0, 0.0
        joint.reading = Reading(joint.state(), self._clock.now(), Quality.GOOD)
        told = self._bus.faults(joint.spec.id)
        if told != joint.reply_faults:
            if told & ~joint.reply_faults & (LASTING_FAULTS if joint.address.protocol == "STS" else ServoFault.ALERT):
                joint.checked_at = -CHECK_INTERVAL  # check it next, to find the cause
            joint.reply_faults = told
            self._report_new_faults(joint)

    def _report_new_faults(self, joint: Joint) -> None:
        ailing = joint.active_faults
        risen, joint.faults = ailing & ~joint.faults, ailing
        if risen:
            self._reporter.report_faults(joint, risen)

    def _on_missed_read(self, joint: Joint) -> None:
        """Schedule the next read of a joint whose servo has not replied.

        The first retry is at once, the second after ``MISSED_READ_PAUSE``. After ``MAX_MISSED_READS`` the servo counts
        as missing.
        """
        joint.missed_reads += 1
        now = self._clock.now()
        joint.next_read_at = now + MISSED_READ_PAUSE if joint.missed_reads > 1 else now
        if joint.missed_reads >= MAX_MISSED_READS:
            joint.undriven_reason, joint.is_answering, joint.next_read_at = (
                "does not answer",
                False,
                now + CHECK_INTERVAL,
            )
            self._reporter.report_lost(joint, self.hint)

    def _check(self, joint: Joint) -> None:
        """Check the slow registers for a shutdown, settings lost in a voltage dip, or a lost command."""
        joint.checked_at = self._clock.now()
        lost = False
        try:
            with self._lock:
                for block in joint.model.table.slow_blocks:
                    read_table_block(self._bus, joint, block, tries=1)
                joint.torque = bool(joint.value("torque_enable"))
                stays = joint.is_shut_down and joint.address.protocol == "STS"  # without torque it reports no overload
                newly_shut, joint.is_shut_down = (
                    joint.reports_shutdown and not joint.is_shut_down,
                    joint.reports_shutdown or stays,
                )
                if joint.is_shut_down and joint.torque and joint.address.protocol == "STS":
                    set_torque(self._bus, joint, on=False)  # else its torque would return by itself, to an old goal
                    joint.torque = False
                elif joint.is_unconfirmed:
                    self._repeat_hold_or_relax(joint)
                elif lost := self._has_lost_settings(joint):
                    restore_settings(self._bus, joint, now=self._clock.now())
                elif joint.has_lost_setpoint:
                    joint.setpoint = None  # the servo missed it: send it again
        except (NoReply, BadRequest):
            self._on_missed_read(joint)
            return
        self._report_new_faults(joint)
        if newly_shut:
            self._reporter.report_shutdown(joint)
        if lost:
            self._reporter.report_voltage_dip(joint)

    def _repeat_hold_or_relax(self, joint: Joint) -> None:
        hold_or_relax(self._bus, [joint], stiff=bool(joint.torque_request), now=self._clock.now())

    def _has_lost_settings(self, joint: Joint) -> bool:
        """True if a servo has not shut down, but lacks the requested torque or has another torque limit."""
        limp = bool(joint.torque_request) and not joint.torque
        return not joint.is_shut_down and (limp or joint.value(joint.model.table.torque_limit) != joint.torque_ticks)

    def next_confirmation_at(self) -> float:
        """Return the time at which the next unconfirmed hold or relax is repeated; infinity if all are confirmed."""
        return min(
            (
                joint.checked_at + CONFIRMATION_RETRY_INTERVAL
                for joint in self._joints
                if joint.is_unconfirmed and joint.is_driven
            ),
            default=inf,
        )

    def _report_presence(self) -> None:
        if self.online:
            self._reporter.report_online(self._bus.port)
        else:
            self._reporter.report_offline("no servo answers", self.hint)


def _check_interval(joint: Joint) -> float:
    """Return the seconds between two checks of a joint."""
    # Earlier by a resting interval, so that the check is due in the next round.
    return CONFIRMATION_RETRY_INTERVAL if joint.is_unconfirmed else CHECK_INTERVAL - RESTING_INTERVAL
