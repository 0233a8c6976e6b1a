"""A joint of a robot and the servo behind it: where it sits, how it may move, and what is known of it.

Two scales of angle meet here and nowhere else. The *servo's* has its zero at the middle of the servo's range, positive
anticlockwise seen facing the horn. The *joint's* is the robot's: ``servo = zero + direction * joint``.
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
"""A joint that is found farther than this from where it stood is elsewhere: it was turned, or is another."""

OVERVOLTAGE_FACTOR = 1.1
"""A servo is not driven at this many times the highest voltage that its EEPROM allows: a charged battery has less."""


@dataclass(frozen=True, slots=True)
class JointSpec:
    """A joint as the robot file describes it.

    ``zero`` is the servo's angle (radians from its middle) at which the joint is at 0, ``direction`` is -1 where the
    servo is mounted the other way round. ``lower`` and ``upper`` bound the joint (radians), ``speed`` is its highest
    (rad/s), ``torque_limit`` the share of the stall torque that it may use, above 0 up to 1.
    ``offset`` is the position offset (steps) that an STS must have, if that is known.
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
        """Return what is wrong with this description, in words."""
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
    """One joint with its servo, and what the driver knows of it at present.

    ``undriven_reason`` says why the servo is not driven, and is empty when it is; ``hint`` is what helps. ``torque_request`` is the
    torque that was asked for: None as long as nobody did. ``is_shut_down`` is true after the servo has shut itself down.
    ``table`` is a copy of the servo's control table, as far as it was read. ``may_have_torque`` is true once this driver may
    have given the servo torque: then it has to be brought to rest. ``is_unconfirmed`` is true after it was held or relaxed
    without confirming it.
    """

    name: str
    spec: JointSpec
    model: ServoModel
    undriven_reason: str = "not looked for yet"
    hint: str = ""
    shares_id: bool = False  # another servo with its ID was noticed
    is_answering: bool = False
    missed_reads: int = 0  # reads without a reply, in a row
    next_read_at: float = 0.0  # when it is read next
    checked_at: float = 0.0  # when its slow registers were read
    reading: Reading[JointState] = field(default_factory=lambda: Reading(None, 0.0, Quality.NONE))
    faults: ServoFault = field(default=ServoFault(0))
    reply_faults: ServoFault = field(default=ServoFault(0))  # what its newest reply complained of
    torque: bool = False
    torque_request: bool | None = None
    is_shut_down: bool = False
    goal: float | None = None
    speed: float = 0.0  # rad/s, told with the goal
    setpoint: int | None = None  # ticks: how far on its way it was sent last; None where it is to be sent anew
    setpoint_sent_at: float = 0.0
    may_have_torque: bool = False
    is_unconfirmed: bool = False
    unconfirmed_since: float = -inf  # since when
    lacks_confirmation: bool = False  # on a port that is open, it did not say whether it is
    approaches_slowly: bool = (
        False  # it was found elsewhere than it stood, or was away for long, and has not come over yet
    )
    excluded_from_move: bool = False  # the last move of it went without it
    progress: JointProgress = field(init=False)
    address: ServoAddress = field(init=False)
    table: bytearray = field(init=False, repr=False)
    _state_registers: tuple[Register, ...] = field(init=False, repr=False)  # what its state is made of
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
        """How far and fast it may go by its robot file; ``limits`` may be narrower for a while."""
        return JointLimits(self.spec.lower, self.spec.upper, min(self.spec.speed, self.model.top_speed))

    @property
    def title(self) -> str:
        """The joint for a message: ``elbow (servo 3)``."""
        return f"{self.name} (servo {self.spec.id})"

    @property
    def is_driven(self) -> bool:
        """True while the servo answers and is what it should be."""
        return not self.undriven_reason

    # --- the servo's control table ------------------------------------------------------------------------------------

    def store(self, block: RegisterBlock, data: bytes) -> None:
        """Copy what was read."""
        self.table[block.address : block.address + block.size] = data

    def value(self, register: str) -> int:
        """Return what a register held when it was read last."""
        return self.model.table[register].decode(self.table)

    def state(self) -> JointState:
        """Return what the servo felt when it was read last, as the joint feels it."""
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
        """The voltage that the servo is made for: of one model number there are STS for 7.4 V and for 12 V."""
        if self.address.protocol == "STS" and self.value("highest_voltage") >= 120:
            return 12.0
        return self.model.nominal_voltage

    @property
    def active_faults(self) -> ServoFault:
        """What ails the servo: protocol 1.0 and STS tell it in every reply, 2.0 in one of the slow registers."""
        return (
            self.reply_faults & LASTING_FAULTS
            if self.address.protocol != 2
            else wire2.decode_hardware_error(self.value("hardware_error"))
        )

    @property
    def reports_shutdown(self) -> bool:
        """Whether it had shut itself down when its slow registers were read last.

        In protocol 1.0 a shutdown sets the torque limit to 0, in 2.0 it switches the torque off until a reboot; an STS
        tells in its status, and loses most of its force.
        """
        if self.address.protocol == 1:
            return self.value("torque_limit") == 0
        if self.address.protocol == "STS":
            return bool(self.value("status") & self.value("shutdown"))
        return bool(self.value("hardware_error") & self.value("shutdown")) and not self.value("torque_enable")

    @property
    def has_lost_setpoint(self) -> bool:
        """Whether a stiff servo had another goal than it was sent when its slow registers were read last."""
        if self.setpoint is None or self.is_shut_down or not self.torque:
            return False
        return self.value(self.model.table.goal) != self.setpoint

    # --- angles, and what they are to the servo -----------------------------------------------------------------------

    def clamp(self, angle: float) -> float:
        """Return the nearest angle of the joint within its limits."""
        return self.limits.clamp(angle)

    def estimated_position(self, now: float) -> float | None:
        """Return where the joint is by ``now``: seen last, and carried on at its speed as far as its goal.

        A fast joint covers several degrees from one reading to the next. One that was seen to turn any other way than
        towards its goal is taken to be where it was seen. None when it never was.
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
        """Return where it should stand that is ``found`` (radians) after it was away; None where that is so.

        It was seen stiff, and may have ended the leg of its way that it was sent. A limp one may be anywhere.
        """
        state = self.reading.value
        if state is None or not self.torque:
            return None
        ends = sorted((state.position, state.position if self.setpoint is None else self.angle(self.setpoint)))
        place = min(max(position, ends[0]), ends[1])
        return None if abs(position - place) <= DISPLACEMENT_TOLERANCE else place

    def ticks(self, angle: float) -> int:
        """Return the servo's position for an angle of the joint."""
        return self.model.ticks(self.spec.zero + self.spec.direction * angle)

    def angle(self, ticks: int) -> float:
        """Return the angle of the joint for a position of the servo."""
        return (self.model.angle(ticks) - self.spec.zero) * self.spec.direction

    @property
    def tick_limits(self) -> tuple[int, int]:
        """The lowest and the highest position (ticks) within its limits."""
        low, high = sorted((self.ticks(self.spec.lower), self.ticks(self.spec.upper)))
        return low, high

    def clamp_ticks(self, ticks: int) -> int:
        """Return the position within its limits nearest to ``ticks``: a servo refuses a goal outside its own."""
        low, high = self.tick_limits
        return min(max(ticks, low), high)

    def goal_write(self, goal: int, speed: float) -> tuple[int, bytes]:
        """Return the write that sends it to ``goal`` (ticks) at ``speed`` (rad/s) within its limits; see ``Model``."""
        return self.model.goal_write(goal, self.speed_ticks(speed))

    def speed_ticks(self, speed: float) -> int:
        """Return a speed (rad/s) within the limits as a step: at least 1, and no more than the servo takes."""
        limited = min(max(speed, 0.0), self.limits.speed)
        return self._cap(self.model.speed_ticks(limited), "velocity_limit")

    @property
    def torque_ticks(self) -> int:
        """The torque limit that it is to have, and no more than the servo takes."""
        return self._cap(self.model.torque_ticks(self.spec.torque_limit), self.model.table.torque_ceiling)

    def _cap(self, steps: int, ceiling: str) -> int:
        """Return ``steps``, or what the register ``ceiling`` allows; it holds 0 as long as it was not read."""
        most = self.value(ceiling) if ceiling in self.model.table else 0
        return min(steps, most) if most else steps


def check_joints(who: str, specs: dict[str, JointSpec]) -> None:
    """Raise BadRequest with everything that is wrong with a set of joints."""
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
