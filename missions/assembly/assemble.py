"""Assembly of a robot in real time: real drivers on the robot's own ports or on virtual devices."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from config.robot import RobotConfig, Section
from drivers.api import Device, Voice
from drivers.api.driver import DriverContext, resolve_name
from drivers.api.sections import SerialKeys
from drivers.clock import Clock
from drivers.transport.ports import require_serial_ports
from missions.assembly.assembled_robot import AssembledRobot, RunEyes
from missions.assembly.learnt_delays import LearntDelays
from missions.assembly.part_factory import Hooks, Overrides, make_parts, resolve_maker, with_carriers
from missions.library.folders import state_folder

if TYPE_CHECKING:
    from missions.assembly.simulation import Simulation


def real_voice(factory: "RealPartFactory", section: Section, devices: Mapping[str, Any]) -> tuple[Voice, Voice]:
    """Return the robot's voice twice: as the device to open, and as the part that leaves use.

    In a simulation the voice prints its text, and people in the world hear it.
    """
    simulation = factory.simulation
    if simulation is None:
        voice: Voice = factory.device(section, devices)
    else:
        from drivers.voice.speech import printed  # noqa: PLC0415 - a robot on the metal without a voice needs none of it

        out = partial(_say_aloud, factory.hooks.print_line, simulation.hear)
        voice = printed(section.keys, factory.site(section, devices, out))
    return voice, voice


def _say_aloud(out: Callable[[str], None], hear: Callable[[str], None], text: str) -> None:
    out(text)
    hear(text)


PART_MAKERS: Mapping[str, str] = {
    "voice": "missions.assembly.assemble:real_voice",
    "microphone": "missions.assembly.hearing:real_ears",
    "screen": "missions.assembly.face:real_face",
    "camera": "missions.assembly.eyes:real_eyes",
}
"""Functions, by kind of part, that make a part from more than its driver: a camera with its detectors, for example.

They are called with the factory, the section of the robot file, and the devices made so far.
"""


class RealPartFactory:
    """Factory of parts in real time: on the hardware, or on virtual devices in a world."""

    def __init__(self, config: RobotConfig, clock: Clock, overrides: Overrides, hooks: Hooks) -> None:
        self.config = config
        self.clock = clock
        self.overrides = overrides
        self.hooks = hooks
        self.simulation: Simulation | None = None
        self.eyes: RunEyes | None = None
        self.lags = LearntDelays(
            config, simulated=overrides.world is not None, other_camera=overrides.camera is not None
        )
        self._ports: dict[str, str] = dict(overrides.ports)

    def simulate(self, chosen: frozenset[str]) -> None:
        """If the run has a world, create virtual devices for the ``chosen`` parts (names).

        Raises BadRequest for a driver without a virtual device: its real device must not move in a simulation.
        """
        overrides = self.overrides
        if overrides.world is not None:
            for part in sorted((chosen & self.config.sections.keys()).difference(PART_MAKERS, overrides.ports)):
                resolve_maker(self.config.sections[part].driver.virtual, self.config.sections[part], "virtual device")
            wired = chosen.difference(PART_MAKERS)
            self.simulation = simulation = resolve_name("missions.assembly.simulation:Simulation")(
                self.config,
                wired,
                self.clock,
                world=overrides.world,
                on_answer=self.hooks.on_answer,
                seed=overrides.seed,
            )
            self._ports = {**simulation.ports, **overrides.ports}

    def refuse_other_ports(self, chosen: frozenset[str]) -> None:
        """Raise NotConnected if one of the ``chosen`` parts has a port that exists but is not a serial port."""
        sections = {kind: section for kind, section in self.config.sections.items() if kind in chosen}
        ports = {kind: self._port(section) for kind, section in sections.items()}
        require_serial_ports({kind: port for kind, port in ports.items() if port})

    def make(self, kind: str, section: Section, devices: Mapping[str, Any]) -> tuple[Device, object]:
        """Return the device of a part, and the object that leaves use, which is usually the device itself.

        ``section`` is its section of the robot file; ``devices`` are those that were made before, by name.
        """
        if kind in PART_MAKERS:
            maker_result: tuple[Device, object] = resolve_name(PART_MAKERS[kind])(self, section, devices)
            return maker_result
        device = self.device(section, devices)
        return device, device

    def device(self, section: Section, devices: Mapping[str, Any] | None = None, keys: object = None) -> Any:
        """Return the device that the driver of ``section`` makes from the section's keys, or from ``keys`` if given."""
        make = resolve_maker(section.driver.make, section, "make")
        return make(section.keys if keys is None else keys, self.site(section, devices or {}))

    def site(
        self, section: Section, devices: Mapping[str, Any], out: Callable[[str], None] | None = None
    ) -> DriverContext:
        """Return the context for the driver of a section: clock, port, callbacks, and the devices that it needs.

        ``out`` replaces the function that prints text for people.
        """
        hooks = self.hooks
        return DriverContext(
            self.clock,
            self._port(section),
            hooks.report,
            hooks.on_change,
            hooks.on_steering,
            hooks.print_line if out is None else out,
            {need: devices[need] for need in section.driver.needs if need in devices},
            state_folder() if self.simulation is None else None,
            section.part,
        )

    def _port(self, section: Section) -> str:
        return self._ports.get(section.part, section.keys.port if isinstance(section.keys, SerialKeys) else "")


def assemble(
    config: RobotConfig, chosen: frozenset[str], clock: Clock, overrides: Overrides, hooks: Hooks
) -> AssembledRobot:
    """Assemble the ``chosen`` parts of a robot and the parts that they need, such as the head of a camera.

    Opens nothing. Raises BadRequest for a part that cannot be simulated, NotConnected for a port that is not a serial
    port.
    """
    chosen = with_carriers(config, chosen)
    place = RealPartFactory(config, clock, overrides, hooks)
    place.simulate(chosen)
    place.refuse_other_ports(chosen)
    robot, devices = make_parts(config, chosen, place)
    robot = replace(robot, lag=place.lags.lag)
    return AssembledRobot(config.name, robot, devices, place.eyes, place.simulation, place.lags)
