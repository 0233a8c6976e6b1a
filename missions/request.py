"""The request to run a mission, on a robot, in a world, by their names."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from config.library import DEFAULT_WORLD, find
from drivers.api.kinds import WIRED
from drivers.api.quick import dataclass
from drivers.api.renamed import renamed
from drivers.api.secrets import without_secrets
from drivers.camera.source import Kind, kind_of

if TYPE_CHECKING:
    from config.world import WorldConfig

Simulate = Literal["wire", "fast"]
"""How a robot is simulated: real drivers over virtual devices in real time, or twins in simulated time."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """A mission to run, and a robot to run it on: names as the user gives them.

    Without a ``robot`` the default one is simulated.

    In simulated time ``speed`` is how many times faster than real time it goes at most, and ``eyes`` say whether
    pictures are drawn and searched ("pixels") or faces are known from the world ("truth").
    ``behaviours`` are files of Python with leaves of the user's own. ``pad`` is the node of a game pad that takes the
    wheels, in real time only. With ``physics`` the robot stands, walks and falls as a body with masses.
    ``ros2_domain`` is that of its nodes of ROS 2, instead of what its file says. ``without_stop`` lets a robot move
    although ``mission stop`` cannot reach the run.
    """

    mission: str
    params: Mapping[str, str] = field(default_factory=dict)
    robot: str | None = None
    simulate: Simulate | None = None
    world: "str | WorldConfig | None" = None
    camera: str | None = None
    ports: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0
    behaviours: Sequence[Path] = ()
    eyes: Literal["pixels", "truth"] = "pixels"
    speed: float = inf
    pad: str | None = None
    physics: bool = False
    ros2_domain: int | None = None
    without_stop: bool = False

    @property
    def simulation(self) -> Simulate | None:
        """How the robot is simulated, None when the real one moves."""
        return "wire" if self.simulate is None and self.robot is None else self.simulate

    @property
    def world_name(self) -> str:
        """The name of what a simulated robot stands in; empty for a robot that moves."""
        if self.simulation is None:
            return ""
        return (self.world if self.world is None or isinstance(self.world, str) else self.world.name) or DEFAULT_WORLD

    def world_file(self) -> "WorldConfig":
        """Read the world's file, unless it was handed over as it is. Raises InvalidFileError or UnknownNameError."""
        from config.world import load_world  # noqa: PLC0415 - the metal has no other world than this one

        if self.world is None or isinstance(self.world, str):
            return load_world(find("worlds", self.world or DEFAULT_WORLD))
        return self.world


def contradictions(
    order: RunRequest, named: Callable[..., str], ports_of: Callable[[RunRequest], Sequence[str]]
) -> Iterator[str]:
    """Yield what of a request contradicts the rest of it, or could only be ignored.

    ``named(name, value)`` returns how the user writes a wish: ``--simulate fast``, or ``simulate="fast"``.
    ``ports_of(order)`` returns the parts with ports that its robot has under names of their own.
    """
    fast, wire = named("simulate", "fast"), named("simulate", "wire")
    if order.simulation != "fast":
        if order.eyes == "truth" or order.speed != inf or order.physics:
            which = f"{named('eyes', 'truth')}, {named('speed')} and {named('physics')}"
            yield f"{which} are for simulated time: add {fast}"
    else:
        if order.camera is not None:
            yield f"{named('camera')} gives pictures in real time: it goes with {wire}, not with fast"
        if order.pad is not None:
            yield f"{named('pad')} is for hands, in real time: it goes with {wire}, not with fast"
    if order.ports and order.simulation is not None:
        yield f"{named('port')} names real ports: it goes with {named('robot', 'NAME')}, and not with a simulation"
    for part in order.ports:
        if part not in WIRED and part not in (others := ports_of(order)):
            yield f"{named('port')}: '{part}' is no part with a port; these are: {', '.join((*WIRED, *others))}"
    if order.world is not None and order.simulation is None:
        yield f"{named('world')} is for a simulated robot: add {wire}, or leave it out"
    if order.camera is not None and not _may_be_camera(order.camera):
        source = without_secrets(order.camera)
        yield f"{named('camera')}: '{source}': no such file, and no index, device or address of a camera"


def _may_be_camera(source: str) -> bool:
    """Whether there can be a camera: a file that is not there will not be plugged in, as a device may be."""
    kind = kind_of(source) if source.strip() else None
    return kind is not None and (kind not in (Kind.VIDEO, Kind.PICTURE) or Path(source).is_file())


if not TYPE_CHECKING:
    __getattr__ = renamed(__name__, {"Order": "RunRequest"})
