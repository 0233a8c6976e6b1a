"""Request to run a mission: mission, robot, world and options by name."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, Literal, get_args

from config.library import DEFAULT_WORLD, find_file
from drivers.api.fast_dataclass import dataclass
from drivers.api.kinds import PORT_KINDS
from drivers.api.secrets import without_secrets
from drivers.camera.source import SourceKind, source_kind
from missions.options import ROS2, faults, option, options_of

if TYPE_CHECKING:
    from config.world import WorldConfig

Simulate = Literal["wire", "fast"]
"""Level of simulation: real drivers on virtual devices in real time, or twins in simulated time."""


WHERE, CLOCK, MISSION = "Where it runs", "In simulated time", "The mission"
"""Headings of the options of a run."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """Mission to run and robot to run it on, by the names that the user gives.

    Without a ``robot`` the default robot is simulated.
    """

    mission: str
    params: Mapping[str, str] = option(
        'A parameter of the mission, such as patience="5 s". Repeat it for more.',
        "params",
        default=MappingProxyType({}),
        flag="--param",
        metavar="NAME=VALUE",
        group=MISSION,
        newcomer=True,
    )
    robot: str | None = option(
        "The robot, a name or a file. It moves, unless --simulate. `mine` is this computer's own "
        "(`mission robot use NAME`).",
        "robot",
        group=WHERE,
        newcomer=True,
    )
    simulate: Simulate | None = option(
        "Simulate the robot. wire: in real time, with virtual devices (the default without --robot). fast: in "
        "simulated time, as fast as possible.",
        among=get_args(Simulate),
        alone="wire",
        metavar="[LEVEL]",
        group=WHERE,
        newcomer=True,
    )
    world: "str | WorldConfig | None" = option(
        "The world around a simulated robot, a name or a file.", "world", group=WHERE, newcomer=True
    )
    camera: str | None = option(
        "A video, folder, URL, device or index instead of the robot's camera.",
        metavar="SOURCE",
        group=WHERE,
        newcomer=True,
    )
    ports: Mapping[str, str] = option(
        "The port of a part, instead of the one in the robot file. Repeat it for more.",
        "ports",
        default=MappingProxyType({}),
        flag="--port",
        metavar="PART=PORT",
        group=WHERE,
        newcomer=True,
    )
    seed: int = option("Random seed.", "integer", default=0, low=0, metavar="N", group=MISSION, newcomer=True)
    behaviours: Sequence[Path] = option(
        "A Python file with more behaviours. Repeat it for more.",
        "path",
        default=(),
        several=True,
        metavar="FILE.py",
        group=MISSION,
        newcomer=True,
    )
    eyes: Literal["pixels", "truth"] = option(
        "Draw pictures and search them, or know from the world who is in view, which is faster.",
        default="pixels",
        among=("pixels", "truth"),
        group=CLOCK,
    )
    speed: float = option(
        "The speed, as a multiple of real time: 5 to watch it, 0.2 to see every step.",
        "number",
        default=inf,
        low=0.001,
        high=10_000.0,
        metavar="TIMES",
        group=CLOCK,
        newcomer=True,
    )
    physics: bool = option(
        "Let a robot with a body (a humanoid) stand, walk and fall by MuJoCo. Needs the extra `physics`.",
        default=False,
        group=CLOCK,
    )
    ros2_domain: int | None = option(
        "The ROS 2 domain, instead of the one in the robot file.", "integer", low=0, high=232, metavar="N", group=ROS2
    )
    without_stop: bool = option(
        "Move the robot even if `mission stop` cannot reach the run.", default=False, group=WHERE
    )
    until: float | None = option(
        "End the run at this time, if it still goes on; after 1 h by default, unless there is a --speed.",
        "duration",
        metavar="TIME",
        group=CLOCK,
    )

    @property
    def simulation(self) -> Simulate | None:
        """Level of simulation, None if the real robot moves."""
        return "wire" if self.simulate is None and self.robot is None else self.simulate

    @property
    def is_batch(self) -> bool:
        """True for a simulated run at full speed that takes faces from the world: it cannot be watched or stopped.

        Such a run starts no thread, socket or process, unless leaves or listeners from outside MissionTree take part.
        """
        return self.simulation == "fast" and self.eyes == "truth" and self.speed == inf

    @property
    def world_name(self) -> str:
        """Name of the world of a simulated robot; empty for a real robot."""
        if self.simulation is None:
            return ""
        return (self.world if self.world is None or isinstance(self.world, str) else self.world.name) or DEFAULT_WORLD

    @property
    def with_default_simulation(self) -> "RunRequest":
        """The same request, in simulated time if it has an option that needs it (such as ``until``).

        The request is unchanged if it names a robot or a level of simulation.
        """
        timed = self.speed != inf or self.eyes == "truth" or self.until is not None or self.physics
        return replace(self, simulate="fast") if timed and self.simulate is None and self.robot is None else self

    def world_file(self) -> "WorldConfig":
        """Return the world of the request; a name, or the default world, is read from its file.

        Raises InvalidFileError or UnknownNameError.
        """
        from config.world import load_world  # noqa: PLC0415 - the metal has no other world than this one

        if self.world is None or isinstance(self.world, str):
            return load_world(find_file("worlds", self.world or DEFAULT_WORLD))
        return self.world


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Base of the options that a plug-in adds to `mission run`; subclasses declare them as fields."""

    needs_control: ClassVar[bool] = False
    """True if the plug-in needs the run's control socket, which a batch (``RunRequest.is_batch``) otherwise lacks."""

    def is_wanted(self, request: RunRequest) -> bool:
        """Return True if the plug-in takes part in a run; by default, if any of its options is given."""
        del request
        return any(getattr(self, each.name) != each.default for each in options_of(type(self)))

    def adapt(self, request: RunRequest) -> RunRequest:
        """Return ``request``, changed as these options need it; by default, unchanged."""
        return request

    def check(self, request: RunRequest) -> None:
        """Raise ValueError for options that contradict each other or the request. Opens and writes nothing."""


def contradictions(
    request: RunRequest, named: Callable[..., str], ports_of: Callable[[RunRequest], Sequence[str]]
) -> Iterator[str]:
    """Yield errors for options of a request that contradict each other or would have no effect.

    ``named(name, value)`` returns an option as the user writes it: ``--simulate fast``, or ``simulate="fast"``.
    ``ports_of(request)`` returns the names of the robot's additional parts (such as a second arm) that have ports.
    """
    for each, fault in faults(request):
        yield f"{named(each.flag.removeprefix('--'))}: {fault}"
    yield from _clock_contradictions(request, named)
    if request.ports and request.simulation is not None:
        yield f"{named('port')} names real ports: it goes with {named('robot', 'NAME')}, and not with a simulation"
    for part in request.ports:
        if part not in PORT_KINDS and part not in (others := ports_of(request)):
            known = ", ".join((*PORT_KINDS, *others))
            yield f"{named('port')}: '{part}' is not a part with a port; parts with ports: {known}"
    if request.world is not None and request.simulation is None:
        simulate = named("simulate") if named("simulate").startswith("-") else named("simulate", "wire")
        yield f"{named('world')} is for a simulated robot: add {simulate}"
    if request.camera is not None and not _may_be_camera(request.camera):
        source = without_secrets(request.camera)
        yield f"{named('camera')}: '{source}': not a file, index, device or address of a camera"


def _clock_contradictions(request: RunRequest, named: Callable[..., str]) -> Iterator[str]:
    """Yield an error for each option that does not fit the run, since it needs simulated time, or real time."""
    if request.simulation != "fast":
        if request.eyes == "truth" or request.speed != inf or request.physics or request.until is not None:
            which = f"{named('eyes', 'truth')}, {named('speed')}, {named('physics')} and {named('until')}"
            yield f"{which} are for simulated time: add {named('simulate', 'fast')}"
        return
    if request.camera is not None:
        yield f"{named('camera')} gives pictures in real time: it goes with {named('simulate', 'wire')}, not with fast"


def _may_be_camera(source: str) -> bool:
    """Return True if ``source`` can name a camera: an existing file, or any device, as it may be plugged in later."""
    kind = source_kind(source) if source.strip() else None
    return kind is not None and (kind not in (SourceKind.VIDEO, SourceKind.PICTURE) or Path(source).is_file())
