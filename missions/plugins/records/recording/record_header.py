"""What a record says of itself at its beginning: which mission it is of, on which robot, with which seed and versions.

Light on purpose: the process that writes records imports it, and none of what makes a run.
"""

from collections.abc import Mapping
from dataclasses import field

from drivers.api.fast_dataclass import dataclass

FORMAT_VERSION = 2
"""Layout of records; a reader refuses any other number."""

VERSIONS_METADATA = "missiontree"
"""The name of the metadata that say what has made a record: versions, seed, format."""

FILES_METADATA = "files"
"""The name of the metadata that say where each attached file was found."""

LIMIT_METADATA = "limit"
"""The name of the metadata that say that a record was as large as it might get, and when that was."""

TREE_ATTACHMENT = "tree.json"
"""The attachment with the drawing of the mission's tree."""


@dataclass(frozen=True, slots=True)
class RecordHeader:
    """What was run, and how.

    ``file`` is the attachment that is the mission, ``params`` those that the caller gave, as texts, ``values`` all of
    them as they turned out. ``simulate`` is empty for a real robot; ``eyes`` are ``pixels`` or ``truth``, and empty
    without a camera. ``rate`` is in ticks a second. ``started`` is the time of day (ISO 8601, UTC) at which the run's
    clock showed 0. ``parts`` are those of the robot that the mission has to do with, ``eye`` where its camera sits (m).
    ``versions`` are found out by the process that writes the record, where they are not told.
    ``behaviours`` are the attachments with leaves of the user's own, ``paths`` where every attached file was found,
    ``models`` the SHA-256 of files too large to attach. ``command`` is what was typed. ``mocks`` are the leaves that a
    test had replaced. ``lag`` is how long (s) the base takes to begin, as earlier runs had learnt it.
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
    """What stands before the first moment of a record: its head, the files of the run, and the drawing of its tree."""

    header: RecordHeader
    files: Mapping[str, bytes]
    tree: bytes = b""
