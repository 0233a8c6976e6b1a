"""A joint of a robot and its servo: configuration, conversion of angles, and current state.

Two angles are converted only here. The *servo angle* is 0 at the middle of the servo's range, and positive
anticlockwise seen facing the horn. The *joint angle* is the robot's: ``servo = zero + direction * joint``.
"""

from dataclasses import field
from math import inf, isfinite, radians

from drivers.api import JointLimits, JointState, Quality, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.errors import BadRequest
from drivers.joints.progress import JointProgress
from drivers.servos import wire, wire2
from drivers.servos.bus import ServoAddress
from drivers.servos.models import MODELS, ServoModel
from drivers.servos.register import Register, RegisterBlock
from drivers.servos.wire import LASTING_FAULTS, ServoFault

DISPLACEMENT_TOLERANCE = radians(5)
"""Largest distance in radians between the expected and the actual position of a joint that reconnects.

Beyond it, the joint counts as moved, or its servo as replaced.
"""

OVERVOLTAGE_FACTOR = 1.1
"""Supply voltage at which a servo is not driven, as a multiple of its highest allowed voltage (EEPROM).

The voltage of a charged battery stays below it.
"""


@dataclass(frozen=True, slots=True)
class JointSpec:
    """Configuration of a joint in the robot file.

    ``zero`` is the servo angle (radians from its middle) at which the joint is at 0; ``direction`` is -1 if the servo
    is mounted the other way round. ``lower`` and ``upper`` are the limits (radians), ``speed`` is the maximum (rad/s),
    ``torque_limit`` the allowed share of the stall torque, above 0 up to 1. ``offset`` is the position offset (steps)
    that an STS must have, if known.
    """

    id: int
    model: str = "AX-12A"
    zero: float = 0.0
    direction: int = 1
    lower: float = -2.6
    upper: float = 2.6
    speed: float = 2.0
    torque_limit: float = 1.0
    offset: int | None = None

    def errors(self) -> list[str]:
        """Return the errors in this configuration of a joint, as text."""
        found = []
        model = MODELS.get(self.model)
        highest = wire2.LAST_ID if model and model.protocol == 2 else wire.LAST_ID
        if not 0 <= self.id <= highest:
            found.append(f"id is 0..{highest}, not {self.id}")
        if self.direction not in (-1, 1):
            found.append(f"direction is 1 or -1, not {self.direction}")
        if not self.speed > 0 or not isfinite(self.speed):
            found.append(f"speed must be above 0 rad/s and finite, not {self.speed}")
        if not 0 < self.torque_limit <= 1:
            found.append(f"torque_limit must be above 0 and at most 1, not {self.torque_limit}")
        if not self.lower <= self.upper:
            found.append(f"lower limit {self.lower} is not below the upper one, {self.upper}")
        elif model is None:
            found.append(f"model {self.model!r} is not one of {', '.join(MODELS)}")
        else:
            low, high = (self.zero + self.direction * bound for bound in (self.lower, self.upper))
            least, most = model.angle(-0.5), model.angle(model.last_tick + 0.5)
            if not (least <= low <= most and least <= high <= most):
                found.append(
                    f"limits {self.lower}..{self.upper} rad reach beyond the servo's {least:.3f}..{most:.3f} rad "
                    f"(zero {self.zero}, direction {self.direction})"
                )
        return found


@dataclass(slots=True, eq=False)
class Joint:
    """A joint with its servo, and the driver's current knowledge of both.

    ``undriven_reason`` is empty while the servo is driven; ``hint`` says how to remove that reason. ``torque_request``
    is True if the torque is to be on (hold or move), False if it is to be off (relax), and None before any request.
    ``is_shut_down`` is True after the servo has shut itself down. ``table`` is a copy of the servo's control table, as
    far as it was read. ``may_have_torque`` is True once this driver may have switched the torque on: then the joint
    must be brought to rest. ``is_unconfirmed`` is True after a hold or relax that the servo has not confirmed.
    """

    name: str
    spec: JointSpec
    model: ServoModel
    undriven_reason: str = "not checked yet"
    hint: str = ""
    shares_id: bool = False  # a second servo with its ID was found
    is_answering: bool = False
    missed_reads: int = 0  # reads without a reply, in a row
    next_read_at: float = 0.0  # when it is read next
    checked_at: float = 0.0  # when its slow registers were read
    reading: Reading[JointState] = field(default_factory=lambda: Reading(None, 0.0, Quality.NONE))
    faults: ServoFault = field(default=ServoFault(0))
    reply_faults: ServoFault = field(default=ServoFault(0))  # faults in its newest reply
    torque: bool = False
    torque_request: bool | None = None
    is_shut_down: bool = False
    goal: float | None = None
    speed: float = 0.0  # rad/s, given with the goal
    setpoint: int | None = None  # ticks, last intermediate goal sent; None: send it again
    setpoint_sent_at: float = 0.0
    may_have_torque: bool = False
    is_unconfirmed: bool = False
    unconfirmed_since: float = -inf  # since when
    lacks_confirmation: bool = False  # the port is open, but it did not confirm its torque
    approaches_slowly: bool = False  # it returned displaced or after long, and is on its way
    excluded_from_move: bool = False  # left out of the last move
    progress: JointProgress = field(init=False)
    address: ServoAddress = field(init=False)
    table: bytearray = field(init=False, repr=False)
    _state_registers: tuple[Register, ...] = field(init=False, repr=False)  # the registers of its state
    limits: JointLimits = field(init=False)

    def __post_init__(self) -> None:
        spec, model = self.spec, self.model
        self.address = ServoAddress(spec.id, model.protocol)
        self.table = bytearray(model.table.size)
        senses = ("present_position", model.table.velocity, model.table.effort)
        others = ("present_voltage", "present_temperature", "moving")
        self._state_registers = tuple(model.table[name] for name in (*senses, *others))
        self.limits = self.configured_limits
        self.progress = JointProgress(f"joint {self.name}")

    @property
    def configured_limits(self) -> JointLimits:
        """Angle and speed limits from the robot file; the limits in force, ``limits``, may be narrower for a time."""
        return JointLimits(self.spec.lower, self.spec.upper, min(self.spec.speed, self.model.top_speed))

    @property
    def title(self) -> str:
        """Name of the joint in messages: ``elbow (servo 3)``."""
        return f"{self.name} (servo {self.spec.id})"

    @property
    def is_driven(self) -> bool:
        """True while the servo answers and matches its configuration."""
        return not self.undriven_reason

    # --- the servo's control table ------------------------------------------------------------------------------------

    def store(self, block: RegisterBlock, data: bytes) -> None:
        """Store a block that was read into ``table``."""
        self.table[block.address : block.address + block.size] = data

    def value(self, register: str) -> int:
        """Return the value of a register at the last read."""
        return self.model.table[register].decode(self.table)

    def state(self) -> JointState:
        """Return the state of the joint from the registers that were read last."""
        position, speed, effort, voltage, temperature, moving = [
            each.decode(self.table) for each in self._state_registers
        ]
        model, direction = self.model, self.spec.direction
        return JointState(
            position=self.angle(position),
            velocity=model.speed(speed) * direction,
            goal=self.goal,
            load=model.load(effort) * direction,
            voltage=voltage / 10,
            temperature=float(temperature),
            moving=bool(moving),
            torque=self.torque,
            blocked=self.progress.blocked,
        )

    @property
    def nominal_voltage(self) -> float:
        """Nominal supply voltage: STS servos for 7.4 V and for 12 V share one model number."""
        if self.address.protocol == "STS" and self.value("highest_voltage") >= 120:
            return 12.0
        return self.model.nominal_voltage

    @property
    def active_faults(self) -> ServoFault:
        """Current faults of the servo, from its newest reply; with protocol 2.0 read about once a second."""
        return (
            self.reply_faults & LASTING_FAULTS
            if self.address.protocol != 2
            else wire2.decode_hardware_error(self.value("hardware_error"))
        )

    @property
    def reports_shutdown(self) -> bool:
        """True if the servo was shut down when its slow registers were last read, which is about once a second.

        In protocol 1.0 a shutdown sets the torque limit to 0. In 2.0 it switches the torque off until a reboot. An STS
        reports it in its status register, and loses most of its torque.
        """
        if self.address.protocol == 1:
            return self.value("torque_limit") == 0
        if self.address.protocol == "STS":
            return bool(self.value("status") & self.value("shutdown"))
        return bool(self.value("hardware_error") & self.value("shutdown")) and not self.value("torque_enable")

    @property
    def has_lost_setpoint(self) -> bool:
        """True if the servo has torque, and the goal in its last read slow registers is not the setpoint sent to it."""
        if self.setpoint is None or self.is_shut_down or not self.torque:
            return False
        return self.value(self.model.table.goal) != self.setpoint

    # --- angles, and what they are to the servo -----------------------------------------------------------------------

    def clamp(self, angle: float) -> float:
        """Return ``angle`` clamped to the limits of the joint."""
        return self.limits.clamp(angle)

    def estimated_position(self, now: float) -> float | None:
        """Return the position at ``now``: the last reading, extrapolated at its speed up to the goal.

        A fast joint covers several degrees between two readings. If it turned away from its goal, the last reading
        counts. None without any reading.
        """
        state = self.reading.value
        if state is None or self.goal is None:
            return None if state is None else state.position
        way = self.goal - state.position
        covered = state.velocity * (now - self.reading.stamp)
        if covered * way <= 0:
            return state.position
        return state.position + min(covered, way, key=abs)

    def expected_position(self, position: float) -> float | None:
        """Return the position in radians at which a reconnected joint was expected to be; None if it is there.

        ``position`` is its measured position. While it was disconnected, a joint with torque may have moved on to its
        last setpoint, so any position on the way is expected. A joint without torque may be anywhere: None.
        """
        state = self.reading.value
        if state is None or not self.torque:
            return None
        ends = sorted((state.position, state.position if self.setpoint is None else self.angle(self.setpoint)))
        place = min(max(position, ends[0]), ends[1])
        return None if abs(position - place) <= DISPLACEMENT_TOLERANCE else place

    def ticks(self, angle: float) -> int:
        """Return the servo position for an angle of the joint."""
        return self.model.ticks(self.spec.zero + self.spec.direction * angle)

    def angle(self, ticks: int) -> float:
        """Return the angle of the joint for a servo position."""
        return (self.model.angle(ticks) - self.spec.zero) * self.spec.direction

    @property
    def tick_limits(self) -> tuple[int, int]:
        """Lowest and highest servo position (ticks) within the configured limits."""
        low, high = sorted((self.ticks(self.spec.lower), self.ticks(self.spec.upper)))
        return low, high

    def clamp_ticks(self, ticks: int) -> int:
        """Return position ``ticks`` clamped to the joint's limits: a servo refuses goals beyond its own limits."""
        low, high = self.tick_limits
        return min(max(ticks, low), high)

    def goal_write(self, goal: int, speed: float) -> tuple[int, bytes]:
        """Return address and bytes of the write that moves to ``goal`` (ticks) at ``speed`` (rad/s, limited)."""
        return self.model.goal_write(goal, self.speed_ticks(speed))

    def speed_ticks(self, speed: float) -> int:
        """Return a limited speed (rad/s) in steps: at least 1, at most the servo's own limit."""
        limited = min(max(speed, 0.0), self.limits.speed)
        return self._cap(self.model.speed_ticks(limited), "velocity_limit")

    @property
    def torque_ticks(self) -> int:
        """The configured torque limit in steps, at most the servo's own limit."""
        return self._cap(self.model.torque_ticks(self.spec.torque_limit), self.model.table.torque_ceiling)

    def _cap(self, steps: int, ceiling: str) -> int:
        """Return ``steps``, limited to the value of register ``ceiling`` if the servo has one and it was read."""
        most = self.value(ceiling) if ceiling in self.model.table else 0
        return min(steps, most) if most else steps


def check_joints(who: str, specs: dict[str, JointSpec]) -> None:
    """Raise BadRequest that lists all errors in the joints ``specs``; ``who`` is the name of their part."""
    found = [f"{name}: {fault}" for name, spec in specs.items() for fault in spec.errors()]
    owners: dict[int, str] = {}
    for name, spec in specs.items():
        if (first := owners.setdefault(spec.id, name)) != name:
            found.append(f"{name}: servo {spec.id} is {first} already")
    protocols = {MODELS[spec.model].protocol for spec in specs.values() if spec.model in MODELS}
    if 2 in protocols and (taken := wire2.HEADER[2]) in owners:
        found.append(f"{owners[taken]}: servo {taken} takes packets of protocol 2.0 for its own: give it another ID")
    if found:
        raise BadRequest(f"{who}: {'; '.join(found)}", hint="correct the joints in the robot file")
