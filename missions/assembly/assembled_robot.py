"""Assembled robot: its parts, its eyes, and its virtual devices if it is simulated."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from behaviours.robot import Robot, hold_still
from behaviours.run import RunState
from drivers.api import Device, DeviceStatus, Health, StatusCallback
from drivers.api.fast_dataclass import dataclass
from drivers.api.kinds import SOUND_KINDS, STOPPABLE_KINDS
from drivers.errors import NotConnected
from missions.assembly.learnt_delays import LearntDelays

if TYPE_CHECKING:
    from missions.assembly.simulation import Simulation

CONNECT_TIMEOUT = 6.0
"""Seconds within which all parts must be connected: a board needs two to boot, a servo bus one."""

POLL_INTERVAL = 0.05
"""Seconds between two polls of the parts while a run waits for them; a new picture ends the wait early."""

REMARK_DELAY = 1.0
"""Seconds after which a missing part is reported."""


class RunEyes(Protocol):
    """The methods of a robot's eyes that a run calls: of ``perception.eyes.Eyes``, or of the eyes in simulated time."""

    may_rest: bool
    """True if the eyes may pause while no percepts are requested; always False in simulated time."""

    @property
    def looked(self) -> Callable[[], float | None]:
        """Function that returns the time stamp of the newest picture that was searched, None before the first."""
        ...

    def open(self) -> None:
        """Start the eyes."""
        ...

    def close(self) -> None:
        """Stop the eyes. Idempotent."""
        ...


@dataclass(slots=True)
class AssembledRobot:
    """Robot with all devices and eyes that a run opens and must close.

    ``devices`` are the parts by name, in the order in which they open; more can be added before ``open``. If a part
    raises an exception in ``safe_stop`` or ``close``, the other parts are still stopped and closed. ``lags`` are the
    learnt delays of camera and base.
    """

    name: str
    robot: Robot
    devices: dict[str, Device]
    eyes: RunEyes | None = None
    simulation: "Simulation | None" = None
    lags: LearntDelays | None = None

    @property
    def stoppable_parts(self) -> tuple[str, ...]:
        """Parts that a stop reaches: moving parts, and a voice, which is silenced."""
        others = (name for name, other in self.robot.extra_parts.items() if other.kind in STOPPABLE_KINDS)
        return tuple(part for part in (*STOPPABLE_KINDS, *others) if part in self.devices)

    @property
    def moving_parts(self) -> tuple[str, ...]:
        """Names of the parts with actuators: those that a stop reaches, except the voice."""
        return tuple(part for part in self.stoppable_parts if part not in SOUND_KINDS)

    def open(self) -> None:
        """Open all devices and the eyes; returns at once, even if hardware is missing."""
        if self.simulation is not None:
            self.simulation.open()
        for device in self.devices.values():
            device.open()
        if self.eyes is not None:
            self.eyes.open()

    def health(self) -> dict[str, Health]:
        """Return the health of each part, with the statistics of its connection. Thread-safe."""
        return {name: device.health() for name, device in self.devices.items()}

    def missing(self) -> dict[str, tuple[str, str]]:
        """Return the parts that are not connected, by name, each with the problem and a hint for the user."""
        missing = {name: (each.detail, each.hint) for name, each in self.health().items() if not each.online}
        if self.eyes is not None and self.eyes.looked() is None:
            missing.setdefault("camera", ("camera: no picture has been searched yet", ""))
        return missing

    def wait_until_complete(self, run: RunState, report: StatusCallback, stopping: Callable[[], bool]) -> None:
        """Wait until every part is connected, or ``stopping()`` is true. Raises NotConnected after ``CONNECT_TIMEOUT``.

        ``report`` is called for each part that is missing after ``REMARK_DELAY``; the error lists all of them.
        """
        begun = run.now()
        mentioned: set[str] = set()
        while (missing := self.missing()) and not stopping():
            waited = run.now() - begun
            for part, (detail, hint) in missing.items():
                if waited > REMARK_DELAY and part not in mentioned:
                    mentioned.add(part)
                    text = f"waiting for it: {detail.removeprefix(f'{part}: ')}"
                    report(DeviceStatus(part, "offline", text, hint))
            if waited > CONNECT_TIMEOUT:
                details = "\n".join(f"  {detail}" for detail, _ in missing.values())
                hints = dict.fromkeys(hint for _, hint in missing.values() if hint)
                raise NotConnected(f"{self.name} is not complete:\n{details}", hint="\n       ".join(hints))
            run.wait(POLL_INTERVAL)
            run.wake_event.clear()
            run.record_heartbeat()

    def safe_stop(self, claims: frozenset[str]) -> None:
        """Make the named actuators hold still: base and head stop, the arm keeps its position, the voice is silent.

        An exception of one part is logged and does not prevent the others from stopping.
        """
        hold_still(self.robot, claims)

    def close(self) -> list[str]:
        """Stop every actuator, then release every port. Returns the errors. Idempotent."""
        problems: list[str] = []
        steps: list[tuple[str, Callable[[], None]]] = [
            *((name, device.rest) for name, device in self.devices.items()),
            *((name, device.close) for name, device in self.devices.items() if name != "camera"),
        ]
        if self.eyes is not None:
            steps.append(("eyes", self.eyes.close))
        steps += [(name, device.close) for name, device in self.devices.items() if name == "camera"]
        if self.simulation is not None:
            steps.append(("simulation", self.simulation.close))
        if self.lags is not None:
            steps.append(("learnt delays", self.lags.save))
        for name, step in steps:
            try:
                step()
            except Exception as error:
                problems.append(f"{name}: {error}")
        return problems
