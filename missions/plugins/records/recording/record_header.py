"""The header of a record: mission, robot, seed and versions.

The writer process imports this module, so it imports nothing of the runner.
"""

from collections.abc import Mapping
from dataclasses import field

from drivers.api.fast_dataclass import dataclass

FORMAT_VERSION = 3
"""Version of the record format; readers refuse any other."""

VERSIONS_METADATA = "missiontree"
"""Name of the metadata with versions, seed and format."""

FILES_METADATA = "files"
"""Name of the metadata with the original path of each attached file."""

LIMIT_METADATA = "limit"
"""Name of the metadata with the time at which a record reached its size limit."""

TREE_ATTACHMENT = "tree.json"
"""Name of the attachment with the drawing of the mission's tree."""


@dataclass(frozen=True, slots=True)
class RecordHeader:
    """Settings of a recorded run.

    ``file`` is the name of the attachment with the mission. ``params`` are the params that the caller set, as text, and
    ``values`` all params as evaluated. ``simulate`` is empty for a real robot; ``eyes`` is ``pixels`` or ``truth``, and
    empty without a camera. ``rate`` is in ticks per second. ``started`` is the time of day (ISO 8601, UTC) at time 0 of
    the run's clock.

    ``parts`` are the parts that the mission uses, ``eye`` is the position of the camera (m). The writer process adds
    ``versions`` if they are empty. ``behaviours`` are the names of the attachments with user leaves, ``paths`` the
    original paths of attached files, ``models`` the SHA-256 of files too large to attach. ``command`` is the command
    line. ``mocks`` are the leaves that a test replaced. ``lag`` is the delay of the base (s), learnt in earlier runs.
    """

    mission: str
    file: str
    robot: str
    world: str
    params: Mapping[str, str]
    seed: int
    simulate: str
    eyes: str
    rate: float
    started: str
    command: tuple[str, ...]
    parts: tuple[str, ...]
    versions: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, str] = field(default_factory=dict)
    behaviours: tuple[str, ...] = ()
    paths: Mapping[str, str] = field(default_factory=dict)
    models: Mapping[str, str] = field(default_factory=dict)
    mocks: tuple[str, ...] = ()
    eye: tuple[float, float, float] = (0.0, 0.0, 1.0)
    lag: float | None = None
    format: int = FORMAT_VERSION


@dataclass(frozen=True, slots=True)
class RecordContents:
    """Initial contents of a record: its header, the files of the run, and the drawing of its tree."""

    header: RecordHeader
    files: Mapping[str, bytes]
    tree: bytes = b""
