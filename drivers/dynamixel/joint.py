"""A joint of a robot and the servo behind it: where it sits, how it may move, and what is known of it.

Two scales of angle meet here and nowhere else. The *servo's* has its zero at the middle of the servo's range, positive
anticlockwise seen facing the horn. The *joint's* is the robot's: ``servo = zero + direction * joint``.
"""

from dataclasses import dataclass, field
from math import isfinite

from drivers.api import JointLimits, JointState, Quality, Reading
from drivers.dynamixel.models import FULL, GOAL_POSITION, MODELS, MOVING_SPEED, Model
from drivers.dynamixel.wire import Fault
from drivers.errors import BadRequest


@dataclass(frozen=True, slots=True)
class JointSpec:
    """A joint as the robot file describes it.

    ``zero`` is the servo's angle (radians from its middle) at which the joint is at 0, ``direction`` is -1 where the
    servo is mounted the other way round. ``lower`` and ``upper`` bound the joint (radians), ``speed`` is its highest
    (rad/s), ``torque_limit`` the share of the stall torque that it may use, above 0 up to 1.
    """

    id: int
    model: str = "AX-12A"
    zero: float = 0.0
    direction: int = 1
    lower: float = -2.6
    upper: float = 2.6
    speed: float = 2.0
    torque_limit: float = 1.0

    def faults(self) -> list[str]:
        """Return what is wrong with this description, in words."""
        found = []
        model = MODELS.get(self.model)
        if not 0 <= self.id <= 253:
            found.append(f"id is 0..253, not {self.id}")
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
            least, most = model.angle(-0.5), model.angle(model.last + 0.5)
            if not (least <= low <= most and least <= high <= most):
                found.append(
                    f"limits {self.lower}..{self.upper} rad reach beyond the servo's {least:.3f}..{most:.3f} rad "
                    f"(zero {self.zero}, direction {self.direction})"
                )
        return found


@dataclass(slots=True, eq=False)
class Joint:
    """One joint with its servo, and what the driver knows of it at present.

    ``complaint`` says why the servo is not driven, and is empty when it is. ``wanted`` is the torque that was asked
    for: None as long as nobody did. ``shut`` is true after the servo has shut itself down.
    """

    name: str
    spec: JointSpec
    model: Model
    complaint: str = "not looked for yet"
    answers: bool = False
    failures: int = 0  # reads without a reply, in a row
    due: float = 0.0  # when it is read next
    checked: float = 0.0  # when its slow registers were read
    reading: Reading[JointState] = field(default_factory=lambda: Reading(None, 0.0, Quality.NONE))
    faults: Fault = field(default=Fault(0))
    torque: bool = False
    wanted: bool | None = None
    shut: bool = False
    goal: float | None = None
    left_out: bool = False  # the last move of it went without it

    @property
    def title(self) -> str:
        """The joint for a message: ``elbow (servo 3)``."""
        return f"{self.name} (servo {self.spec.id})"

    @property
    def driven(self) -> bool:
        """True while the servo answers and is what it should be."""
        return not self.complaint

    @property
    def limits(self) -> JointLimits:
        """How far and how fast it may go."""
        top = FULL * self.model.speed_unit
        return JointLimits(self.spec.lower, self.spec.upper, min(self.spec.speed, top))

    def clamp(self, angle: float) -> float:
        """Return the nearest angle of the joint within its limits."""
        return min(max(angle, self.spec.lower), self.spec.upper)

    def position_at(self, now: float) -> float | None:
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

    def ticks(self, angle: float) -> int:
        """Return the servo's position for an angle of the joint."""
        return self.model.ticks(self.spec.zero + self.spec.direction * angle)

    def angle(self, ticks: int) -> float:
        """Return the angle of the joint for a position of the servo."""
        return (self.model.angle(ticks) - self.spec.zero) * self.spec.direction

    @property
    def bounds(self) -> tuple[int, int]:
        """The lowest and the highest position (ticks) within its limits."""
        low, high = sorted((self.ticks(self.spec.lower), self.ticks(self.spec.upper)))
        return low, high

    def nearest(self, ticks: int) -> int:
        """Return the position within its limits nearest to ``ticks``: a servo refuses a goal outside its own."""
        low, high = self.bounds
        return min(max(ticks, low), high)

    def order(self, goal: int, speed: float) -> bytes:
        """Return the four bytes at ``GOAL_POSITION``: a goal in ticks, and a speed in rad/s within its limits."""
        limited = min(max(speed, 0.0), self.limits.speed)
        return GOAL_POSITION.encode(goal) + MOVING_SPEED.encode(self.model.speed_ticks(limited))


def check(who: str, specs: dict[str, JointSpec]) -> None:
    """Raise BadRequest with everything that is wrong with a set of joints."""
    found = [f"{name}: {fault}" for name, spec in specs.items() for fault in spec.faults()]
    owners: dict[int, str] = {}
    for name, spec in specs.items():
        if (first := owners.setdefault(spec.id, name)) != name:
            found.append(f"{name}: servo {spec.id} is {first} already")
    if found:
        raise BadRequest(f"{who}: {'; '.join(found)}", hint="correct the joints in the robot file")
