"""A robot, put together: its parts, its eyes, and, where simulated, the virtual devices behind them."""

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
"""Seconds that the parts of a robot have to appear: a board that boots needs two, a servo bus a second."""

POLL_INTERVAL = 0.05
"""Seconds from one look at the parts to the next while a run waits for them; a picture ends it early."""

REMARK_DELAY = 1.0
"""Seconds after which a part that is still missing is mentioned."""


class RunEyes(Protocol):
    """Eyes, as far as a run opens and closes them: ``perception.eyes.Eyes``, or those of simulated time."""

    may_rest: bool
    """Whether they look at nothing while nobody asks; those of simulated time never do."""

    @property
    def looked(self) -> Callable[[], float | None]:
        """Tells the stamp of the newest frame that was searched, None before the first."""
        ...

    def open(self) -> None:
        """Begin to look."""
        ...

    def close(self) -> None:
        """Look no more. Safe more than once."""
        ...


@dataclass(slots=True)
class AssembledRobot:
    """Everything that a run opens and must close.

    ``devices`` are the parts by name, in the order in which they open; more can be added before that. ``safe_stop`` and
    ``close`` do their work on every part, whatever goes wrong with another. ``lags`` are its delays, as far as learnt.
    """

    name: str
    robot: Robot
    devices: dict[str, Device]
    eyes: RunEyes | None = None
    simulation: "Simulation | None" = None
    lags: LearntDelays | None = None

    @property
    def stoppable_parts(self) -> tuple[str, ...]:
        """The parts that a stop reaches: those that move, and a voice, which is silenced."""
        others = (name for name, other in self.robot.extra_parts.items() if other.kind in STOPPABLE_KINDS)
        return tuple(part for part in (*STOPPABLE_KINDS, *others) if part in self.devices)

    @property
    def moving_parts(self) -> tuple[str, ...]:
        """The parts with actuators."""
        return tuple(part for part in self.stoppable_parts if part not in SOUND_KINDS)

    def open(self) -> None:
        """Start everything; returns at once, hardware or not."""
        if self.simulation is not None:
            self.simulation.open()
        for device in self.devices.values():
            device.open()
        if self.eyes is not None:
            self.eyes.open()

    def health(self) -> dict[str, Health]:
        """Say of each part whether it is there, with the figures of its wire. From any thread."""
        return {name: device.health() for name, device in self.devices.items()}

    def missing(self) -> dict[str, tuple[str, str]]:
        """Return the parts that are not there yet: what is the matter with each, and what to try."""
        missing = {name: (each.detail, each.hint) for name, each in self.health().items() if not each.online}
        if self.eyes is not None and self.eyes.looked() is None:
            missing.setdefault("camera", ("camera: no picture has been searched yet", ""))
        return missing

    def wait_until_complete(self, run: RunState, report: StatusCallback, stopping: Callable[[], bool]) -> None:
        """Wait until every part is there; those that let wait for them are told.

        Raises NotConnected with all that are not there after ``CONNECT_TIMEOUT``.
        """
        begun = run.now()
        mentioned: set[str] = set()
        while (missing := self.missing()) and not stopping():
            waited = run.now() - begun
            for part, (detail, hint) in missing.items():
                if waited > REMARK_DELAY and part not in mentioned:
                    mentioned.add(part)
                    what = f"waiting for it: {detail.removeprefix(f'{part}: ')}"
                    report(DeviceStatus(part, "offline", what, hint))
            if waited > CONNECT_TIMEOUT:
                details = "\n".join(f"  {detail}" for detail, _ in missing.values())
                hints = dict.fromkeys(hint for _, hint in missing.values() if hint)
                raise NotConnected(f"{self.name} is not complete:\n{details}", hint="\n       ".join(hints))
            run.wait(POLL_INTERVAL)
            run.wake_event.clear()
            run.record_heartbeat()

    def safe_stop(self, claims: frozenset[str]) -> None:
        """Make the named actuators hold still: base and head stopped, arm stiff where it is, voice silent.

        Each for itself, whatever goes wrong with another; that is told in the log.
        """
        hold_still(self.robot, claims)

    def close(self) -> list[str]:
        """Bring every actuator to rest, then release every port. Returns what went wrong; safe more than once."""
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
            steps.append(("what was learnt of the delays", self.lags.save))
        for name, step in steps:
            try:
                step()
            except Exception as error:
                problems.append(f"{name}: {error}")
        return problems
