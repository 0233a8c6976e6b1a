"""The request to run a mission, on a robot, in a world, by their names."""

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
"""How a robot is simulated: real drivers over virtual devices in real time, or twins in simulated time."""


WHERE, CLOCK, MISSION = "Where it runs", "In simulated time", "The mission"
"""Headings of the options of a run."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """A mission to run, and a robot to run it on: names as the user gives them.

    Without a ``robot`` the default one is simulated.
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
        "Simulate the robot: in real time, down to the bytes on its wires (wire; the default without --robot), or in "
        "simulated time, without waiting (fast).",
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
        """How the robot is simulated, None when the real one moves."""
        return "wire" if self.simulate is None and self.robot is None else self.simulate

    @property
    def is_batch(self) -> bool:
        """True for simulated time at full speed with known truth: nothing moves, and nobody can watch or stop it.

        Such a run starts no thread, socket or process, unless code that is not ours takes part.
        """
        return self.simulation == "fast" and self.eyes == "truth" and self.speed == inf

    @property
    def world_name(self) -> str:
        """The name of what a simulated robot stands in; empty for a robot that moves."""
        if self.simulation is None:
            return ""
        return (self.world if self.world is None or isinstance(self.world, str) else self.world.name) or DEFAULT_WORLD

    @property
    def with_default_simulation(self) -> "RunRequest":
        """The request in simulated time, if an option needs that and neither robot nor simulation is named."""
        timed = self.speed != inf or self.eyes == "truth" or self.until is not None or self.physics
        return replace(self, simulate="fast") if timed and self.simulate is None and self.robot is None else self

    def world_file(self) -> "WorldConfig":
        """Read the world's file, unless it was handed over as it is. Raises InvalidFileError or UnknownNameError."""
        from config.world import load_world  # noqa: PLC0415 - the metal has no other world than this one

        if self.world is None or isinstance(self.world, str):
            return load_world(find_file("worlds", self.world or DEFAULT_WORLD))
        return self.world


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Options that a feature adds to `mission run`; a subclass declares them as its fields."""

    needs_control: ClassVar[bool] = False
    """Whether the feature uses the control socket of the run, which a batch lacks otherwise."""

    def is_wanted(self, request: RunRequest) -> bool:
        """Whether the feature takes part in a run: if any of its options was given, unless a subclass says more."""
        del request
        return any(getattr(self, each.name) != each.default for each in options_of(type(self)))

    def adapt(self, request: RunRequest) -> RunRequest:
        """Return the request as these options change it."""
        return request

    def check(self, request: RunRequest) -> None:
        """Raise ValueError for options that contradict each other or the request. Opens and writes nothing."""


def contradictions(
    request: RunRequest, named: Callable[..., str], ports_of: Callable[[RunRequest], Sequence[str]]
) -> Iterator[str]:
    """Yield what of a request contradicts the rest of it, or could only be ignored.

    ``named(name, value)`` returns how the user writes a wish: ``--simulate fast``, or ``simulate="fast"``.
    ``ports_of(order)`` returns the parts with ports that its robot has under names of their own.
    """
    for each, fault in faults(request):
        yield f"{named(each.flag.removeprefix('--'))}: {fault}"
    yield from _clock_contradictions(request, named)
    wire = named("simulate", "wire")
    if request.ports and request.simulation is not None:
        yield f"{named('port')} names real ports: it goes with {named('robot', 'NAME')}, and not with a simulation"
    for part in request.ports:
        if part not in PORT_KINDS and part not in (others := ports_of(request)):
            yield f"{named('port')}: '{part}' is no part with a port; these are: {', '.join((*PORT_KINDS, *others))}"
    if request.world is not None and request.simulation is None:
        yield f"{named('world')} is for a simulated robot: add {wire}, or leave it out"
    if request.camera is not None and not _may_be_camera(request.camera):
        source = without_secrets(request.camera)
        yield f"{named('camera')}: '{source}': no such file, and no index, device or address of a camera"


def _clock_contradictions(request: RunRequest, named: Callable[..., str]) -> Iterator[str]:
    """Yield the wishes for simulated time in real time, and the other way round."""
    if request.simulation != "fast":
        if request.eyes == "truth" or request.speed != inf or request.physics or request.until is not None:
            which = f"{named('eyes', 'truth')}, {named('speed')}, {named('physics')} and {named('until')}"
            yield f"{which} are for simulated time: add {named('simulate', 'fast')}"
        return
    if request.camera is not None:
        yield f"{named('camera')} gives pictures in real time: it goes with {named('simulate', 'wire')}, not with fast"


def _may_be_camera(source: str) -> bool:
    """Whether there can be a camera: a file that is not there will not be plugged in, as a device may be."""
    kind = source_kind(source) if source.strip() else None
    return kind is not None and (kind not in (SourceKind.VIDEO, SourceKind.PICTURE) or Path(source).is_file())
