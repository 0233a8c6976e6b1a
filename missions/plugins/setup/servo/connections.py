"""Opens a servo bus or an arm for the commands of ``mission servo``."""

import re
import sys
import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from math import inf

import click

from behaviours.joint_motion import REPORT_TIMEOUT
from behaviours.joint_ranges import JointRanges
from config.diagnostics import suggest_from
from config.library import find_file
from config.world import load_world
from drivers.api import DeviceStatus, Joints, ignore
from drivers.clock import Clock, SystemClock
from drivers.errors import BadRequest, DeviceFault, DriverError, NoReply, NotConnected
from drivers.servos import wire
from drivers.servos.bus import ServoAddress, ServoBus, ServoIdentity
from drivers.servos.declared import DynamixelKeys
from drivers.servos.identification import ping_only_error, require_unique_id
from drivers.servos.joint import Joint
from drivers.servos.make import VIRTUAL_REPLY_TIMEOUT
from drivers.servos.make import joint_specs as specs
from drivers.servos.models import MODELS, ServoModel, find_model
from drivers.servos.units import Framing, Protocol, protocol_name
from drivers.virtual.patient_clock import PatientClock
from missions.assembly.assemble import assemble
from missions.assembly.assembled_robot import CONNECT_TIMEOUT, REMARK_DELAY
from missions.assembly.part_factory import Hooks, Overrides
from missions.assembly.simulation import Simulation
from missions.cli.keys import KeyReader, interruptible
from missions.cli.printable import overwrite_line
from missions.control.holders import hold_robot
from missions.plugins.setup.servo.target import DEFAULT_ARM, ServoTarget

REPLY_TIMEOUT = 0.004
"""Maximum seconds by which a servo's reply may be later than expected."""

DEFAULT_BAUD = 1_000_000
"""Baud rate of a servo bus if no robot file is named."""

POLL_INTERVAL = 0.02
"""Seconds between two checks of the state of a driver that works on its own thread."""


_ID = re.compile("[0-9]{1,3}")
"""Pattern of a servo ID as text: one to three digits."""


@dataclass(frozen=True, slots=True)
class OpenBus:
    """An open servo bus, with the joints and joint groups of the robot file; without a file it has none.

    ``options`` are the command-line options that select the bus, such as " --port /dev/ttyUSB0". They are appended to
    suggested commands. ``simulated`` means that no real arm can fall.
    """

    bus: ServoBus
    joints: Mapping[str, Joint]
    groups: Mapping[str, tuple[str, ...]]
    clock: Clock
    options: str
    simulated: bool = False

    def joint(self, name: str) -> Joint:
        """Return a joint by name. Raises click.UsageError with similar names."""
        if name not in self.joints:
            known = suggest_from(name, [*self.joints, *self.groups]) or "name a robot file with --robot"
            raise click.UsageError(f"no joint '{name}'; {known}")
        return self.joints[name]

    def select_joints(self, names: Collection[str]) -> list[Joint]:
        """Return the joints whose names or groups are in ``names``; without names, all.

        Raises click.UsageError for an unknown name, or without joints.
        """
        if not names and not self.joints:
            raise click.UsageError("no joints known: name a robot file with --robot")
        members = (joint for name in names or self.joints for joint in self.groups.get(name, (name,)))
        return [self.joint(name) for name in dict.fromkeys(members)]

    def servos(self, selector: str) -> list[tuple[ServoAddress, ServoModel]]:
        """Return the servos that ``selector`` names: an ID, a joint, a group, or ``all`` for all joints of the file.

        The model is read from each servo, since it may differ from the file. Raises NoReply, NotConnected, DeviceFault
        for an unknown model, click.UsageError for an unknown name.
        """
        if _ID.fullmatch(selector):
            return [self.servo(selector)]
        return [self.identify(joint.spec.id) for joint in self.select_joints(() if selector == "all" else (selector,))]

    def servo(self, selector: str) -> tuple[ServoAddress, ServoModel]:
        """Return the single servo of an ID or a joint. Raises the same exceptions as ``servos``."""
        return self.identify(int(selector) if _ID.fullmatch(selector) else self.joint(selector).spec.id)

    def identify(self, servo: int) -> tuple[ServoAddress, ServoModel]:
        """Return address and model of the servo with an ID. Raises the same exceptions as ``servos``.

        If servos of protocols 1.0 and 2.0 both have this ID, an error is raised, unless a joint of the robot file has
        it.
        """
        identities: list[ServoIdentity] = []
        trouble: DriverError | None = None
        for protocol in self._candidate_protocols(servo):
            damaged = self.bus.statistics(servo).corrupt
            try:
                identities.append(self.bus.identify(ServoAddress(servo, protocol), tries=2))
            except NoReply as error:
                if self.bus.statistics(servo).corrupt > damaged:
                    trouble = error
                elif self.bus.answers_ping(ServoAddress(servo, protocol), tries=1):
                    trouble = ping_only_error(ServoAddress(servo, protocol), self.options)
        if len(identities) == 1 and trouble is None:
            identity = identities[0]
            if (model := find_model(identity.number)) is None:
                hint = f"mission servo scan{self.options}"
                raise DeviceFault(f"servo {servo}: unknown model number {identity.number}", hint=hint)
            return identity.address, model
        if trouble is not None:
            raise trouble
        if identities:
            numbers = " and ".join(
                f"model {identity.number} ({protocol_name(identity.address.protocol)})" for identity in identities
            )
            raise DeviceFault(f"two servos have ID {servo}: {numbers}", hint="unplug one of them, then try again")
        raise NoReply(
            f"no reply from servo {servo} on {self.bus.port} at {self.bus.baud} baud, in any protocol",
            hint=f"mission servo scan --all-bauds{self.options}  (and check power and cable)",
        )

    def find_ping_only(self, selector: str) -> list[ServoAddress]:
        """Return those servos that reply to a ping but not to a read; ``selector`` selects servos as in ``servos``."""
        if _ID.fullmatch(selector):
            meant = [ServoAddress(int(selector), protocol) for protocol in self._candidate_protocols(int(selector))]
        else:
            meant = [joint.address for joint in self.select_joints(() if selector == "all" else (selector,))]
        return [at for at in meant if not self._answers_reads(at) and self.bus.answers_ping(at)]

    def _candidate_protocols(self, servo: int) -> list[Protocol]:
        """Return the protocols with which to address a servo ID: those of the joints with this ID, else both."""
        own = dict.fromkeys(joint.model.protocol for joint in self.joints.values() if joint.spec.id == servo)
        return [each for each in own or (1, 2) if not (each == 2 and servo == wire.LAST_ID)]  # protocol 2.0 reserves it

    def _answers_reads(self, at: ServoAddress) -> bool:
        """Return whether the servo replies to a read, intact or damaged."""
        corrupt, noise = self.bus.statistics(at.id).corrupt, self.bus.noise_bytes()
        try:
            self.bus.read_block(at, 0, 3, tries=2)
        except (NoReply, BadRequest):
            return self.bus.statistics(at.id).corrupt > corrupt or self.bus.noise_bytes() > noise
        return True

    def require_sole(self, joint: Joint) -> None:
        """Raise DeviceFault unless exactly one servo has the ID of a joint, and its model is that of the robot file.

        Raises NoReply, NotConnected.
        """
        try:
            require_unique_id(self.bus, joint.address, joint.model.number)
        except DeviceFault as error:
            raise DeviceFault(f"{joint.title}: {error}", hint=error.hint) from error
        except NoReply as error:
            if self.bus.answers_ping(joint.address, tries=1):
                raise ping_only_error(joint.address, self.options) from error
            raise


@contextmanager
def open_bus(
    target: ServoTarget, *, reply_timeout: float = VIRTUAL_REPLY_TIMEOUT, framing: Framing | None = None
) -> Iterator[OpenBus]:
    """Yield the open servo bus that ``target`` selects, and close it at the end; nothing is written to a servo.

    ``reply_timeout`` (s) is that of virtual servos. ``framing`` replaces the packet format in the robot file. Raises
    NotConnected.
    """
    clock = PatientClock() if target.is_virtual else SystemClock()
    with ExitStack() as closings:
        closings.enter_context(interruptible())
        joints: Mapping[str, Joint] = {}
        groups: Mapping[str, tuple[str, ...]] = {}
        if target.robot is None and not target.is_virtual:
            baud = target.baud or DEFAULT_BAUD
            bus = ServoBus(str(target.port), clock, baud=baud, reply_timeout=REPLY_TIMEOUT, framing=framing or "own")
        else:
            config = target.config()
            arm: DynamixelKeys = config.sections[target.arm].keys
            groups = arm.groups
            joints = {name: Joint(name, spec, MODELS[spec.model]) for name, spec in specs(arm).items()}
            port = arm.port
            if target.is_virtual:
                simulation = closings.enter_context(closing(Simulation(config, frozenset({target.arm}), clock)))
                simulation.open()
                port = simulation.ports[target.arm]
            timeout = reply_timeout if target.is_virtual else REPLY_TIMEOUT
            bus = ServoBus(port, clock, baud=arm.baud, reply_timeout=timeout, framing=framing or arm.framing)
        closings.enter_context(closing(bus))
        bus.open()
        target.report_if_simulated()
        yield OpenBus(bus, joints, groups, clock, target.options, target.is_virtual)


@dataclass(frozen=True, slots=True)
class OpenArm:
    """A connected arm with its driver."""

    joints: Joints
    reach: JointRanges
    config: DynamixelKeys
    clock: Clock
    simulated: bool = False

    def wait_for_reports(self, names: Collection[str]) -> None:
        """Wait until the joints ``names`` have reported.

        Raises DeviceFault with the reason after ``REPORT_TIMEOUT`` s.
        """
        begun = self.clock.now()
        while silent := [name for name, it in self.joints.states().items() if name in names and not it.good]:
            health = self.joints.health()
            if self.clock.now() - begun > REPORT_TIMEOUT:
                raise DeviceFault(f"{', '.join(silent)} cannot be moved: {health.detail}", hint=health.hint)
            pause()

    def confirm_limp(self, names: Collection[str], *, yes: bool) -> None:
        """Wait until a person holds the arm, whose torque is about to go off; see ``confirm_limp``."""
        states = self.joints.states()
        limp = [name for name in names if (it := states[name].value) is not None and not it.torque]
        confirm_limp(names, stiff=len(limp) < len(names), simulated=self.simulated, yes=yes)


@contextmanager
def open_arm(target: ServoTarget) -> Iterator[OpenArm]:
    """Open the arm's driver and wait for its servos; bring it to rest and close it at the end.

    Notices of the servos are printed to stderr. Raises NotConnected with the reason after ``CONNECT_TIME``.
    """
    with open_arms(target) as (arm,):
        yield arm


@contextmanager
def open_arms(*targets: ServoTarget) -> Iterator[list[OpenArm]]:
    """Open several arms, each as ``open_arm`` does; at the end, close them in the reverse order."""
    for target in targets:
        target.require_joints()
    configs, virtual = [target.config() for target in targets], targets[-1].is_virtual
    clock = PatientClock() if virtual else SystemClock()
    arms = [config.sections[target.arm].keys for config, target in zip(configs, targets, strict=True)]
    audience = Hooks(print_status, ignore, click.echo, ignore, ignore)
    robots = []
    for config, target in zip(configs, targets, strict=True):
        wishes = Overrides(world=load_world(find_file("worlds", "empty")) if virtual else None)
        robots.append(assemble(config, frozenset({target.arm}), clock, wishes, audience))
    names = " and ".join(dict.fromkeys(config.name for config in configs))
    with interruptible(), hold_robot(names, simulated=virtual), ExitStack() as closings:
        for robot in robots:
            closings.enter_context(closing(robot))
            robot.open()
        seen = [
            robot.robot.with_named_parts({DEFAULT_ARM: target.arm})
            for robot, target in zip(robots, targets, strict=True)
        ]
        for each in seen:
            _wait_for_arm(each.arm, clock)
        targets[-1].report_if_simulated()
        yield [OpenArm(each.arm, each.joint_ranges, arm, clock, virtual) for each, arm in zip(seen, arms, strict=True)]


def _wait_for_arm(joints: Joints, clock: Clock) -> None:
    """Wait until an arm is connected. Raises NotConnected with the reason after ``CONNECT_TIME``."""
    remark = clock.now() + REMARK_DELAY
    while not (joints.health().online and any(reading.good for reading in joints.states().values())):
        if clock.now() > CONNECT_TIMEOUT:
            health = joints.health()
            raise NotConnected(health.detail, hint=health.hint)
        if clock.now() > remark:
            remark = inf
            click.echo(f"waiting for the arm: {joints.health().detail}", err=True)
        pause()


def print_status(notice: DeviceStatus) -> None:
    """Print a notice of a device to stderr, except that it is online."""
    if notice.kind != "online":
        click.echo(notice.message + (f"\n  try: {notice.hint}" if notice.hint else ""), err=True)


def pause(seconds: float = POLL_INTERVAL) -> None:
    """Wait ``seconds`` of real time, in which the driver's thread can work."""
    threading.Event().wait(seconds)


# Waiting for Enter, or for a time.
#
# ``confirm_limp`` and ``confirm_weak`` ask the user to hold the arm before it loses torque.


def require_terminal(seconds: float | None) -> None:
    """Raise click.UsageError if there is neither a terminal for Enter nor a duration."""
    if seconds is None and not sys.stdin.isatty():
        raise click.UsageError("no terminal for the Enter key; add --seconds N")


hold_option = click.option(
    "--yes", is_flag=True, help="Do not wait for Enter before the torque goes off: a person holds the arm already."
)
"""Decorator that adds ``--yes`` to a command that switches torque off."""


def confirm_limp(names: Collection[str], *, stiff: bool, simulated: bool, yes: bool) -> None:
    """Print which joints lose torque, and wait until the user holds the arm and presses Enter.

    It does not wait if ``yes`` is set, or the arm is ``simulated``. ``stiff`` means that at least one of the joints may
    have torque. Raises click.UsageError for stiff joints without a terminal, and click.Abort at the end of the input.
    """
    if yes or simulated or not names:
        return
    _confirm_held(f"the torque of {', '.join(names)} goes off: hold the arm, it falls", stiff=stiff)


def confirm_weak(names: Collection[str], *, simulated: bool, yes: bool) -> None:
    """Wait until the user holds the arm, whose joints will hold with less force.

    ``simulated`` and ``yes`` have the same meaning as in ``confirm_limp``.
    """
    if yes or simulated or not names:
        return
    _confirm_held(f"{', '.join(names)} will hold with less force: hold the arm, it may fall", stiff=True)


def _confirm_held(warning: str, *, stiff: bool) -> None:
    """Print a warning, and wait until the user, who then holds the arm, presses Enter.

    Without a terminal, raise click.UsageError if joints may have torque (``stiff``), else return at once. Raises
    click.Abort at the end of the input.
    """
    if not sys.stdin.isatty():
        if stiff:
            raise click.UsageError(f"{warning}; confirm with Enter at a terminal, without one with --yes")
        return
    click.echo(f"{warning}\npress Enter when you hold it; Ctrl-C changes nothing", err=True)
    with KeyReader(sys.stdin.fileno()) as keys:
        while (key := keys.read(POLL_INTERVAL)) != "enter":
            if key == "end":
                raise click.Abort


@contextmanager
def wait_for_end(
    clock: Clock, seconds: float | None, wait: Callable[[], object] | None = None
) -> Iterator[Callable[[], bool]]:
    """Yield a function that waits ``POLL_INTERVAL``, and returns True once the work is to end.

    It is to end when Enter is pressed or, with ``seconds``, when this time is over. If ``wait`` is given, it is called
    instead of waiting for ``POLL_INTERVAL``.
    """
    if seconds is not None:
        end = clock.now() + seconds

        def timed() -> bool:
            (wait or pause)()
            return clock.now() >= end

        yield timed
        return
    with KeyReader(sys.stdin.fileno()) as keys:

        def pressed() -> bool:
            if wait is not None:
                wait()
            return keys.read(POLL_INTERVAL if wait is None else 0.0) in ("enter", "end")

        yield pressed


def show_line(line: str) -> None:
    """Replace the last line of the terminal with ``line``; prints nothing without a terminal."""
    if sys.stderr.isatty():
        overwrite_line(line, err=True)
