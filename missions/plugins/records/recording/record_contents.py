"""Collects the files and settings of a run that are written at the start of its record."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Protocol

from config.diagnostics import InvalidFileError, SourceText
from config.file_io import read_regular
from config.library import SHEET_SUFFIXES
from config.robot import RobotConfig
from config.yaml_nodes import Mapping as Marked
from config.yaml_nodes import compose
from drivers.api.secrets import without_secrets
from missions.assembly.models import YUNET, models_folder
from missions.assembly.part_factory import camera_position
from missions.language.expressions import format_value
from missions.language.plan import Plan
from missions.library.shipped import behaviour_files
from missions.plugins.records.recording.record_header import RecordContents, RecordHeader
from missions.trees.drawing import to_json
from missions.trees.drawing_builder import drawing_of
from perception.model_files import MAX_MODEL_BYTES

FILE_KINDS = ("mission", "world", "gesture", "gait", "controller", "object", "move", "robot")
"""Kinds of the YAML files of a run; a file's kind is the first of these words that is a top-level key of the file."""


class RecordedRequest(Protocol):
    """The fields of ``missions.request.RunRequest`` that a record stores."""

    @property
    def mission(self) -> str:
        """Name or file of the mission to record."""
        ...

    @property
    def behaviours(self) -> Sequence[Path]:
        """Python files with user leaves, named on the command line of the run."""
        ...

    @property
    def params(self) -> Mapping[str, str]:
        """Mission parameters by name, as typed on the command line."""
        ...

    @property
    def seed(self) -> int:
        """Random seed of the run."""
        ...

    @property
    def eyes(self) -> str:
        """Kind of perception in simulation: ``pixels`` or ``truth``."""
        ...

    @property
    def simulation(self) -> str | None:
        """Kind of simulation; None for a robot with hardware."""
        ...

    @property
    def world_name(self) -> str:
        """Name of the simulated robot's world; empty for a robot with hardware."""
        ...


def contents_of(
    request: RecordedRequest,
    plan: Plan,
    config: RobotConfig,
    files: Mapping[Path, bytes],
    *,
    started: datetime,
    command: Sequence[str] = (),
    mocks: Sequence[str] = (),
    lag: float | None = None,
) -> RecordContents:
    """Return the initial contents of a record.

    ``files`` are the contents of all files read for the run, by path. ``started`` is the time of day at time 0 of the
    run's clock. ``command`` is the command line, and ``mocks`` are the leaves that a test replaces. ``lag`` is the
    delay of the base (s), as learnt in earlier runs.
    """
    names = dict(_name_files(files, {path.resolve() for path in behaviour_files(request.mission, request.behaviours)}))
    mission = Path(plan.source.name).resolve()
    chosen = plan.tree.parts & config.parts
    simulation = request.simulation
    head = RecordHeader(
        mission=plan.mission,
        file=next((name for name, path in names.items() if path == mission), f"mission/{mission.name}"),
        robot=config.name,
        world=request.world_name,
        params=dict(request.params),
        seed=request.seed,
        simulate=simulation or "",
        eyes="" if "camera" not in chosen else request.eyes if simulation == "fast" else "pixels",
        rate=config.rate,
        started=started.isoformat(),
        command=tuple(map(without_secrets, command)),
        parts=tuple(sorted(chosen)),
        values={name: format_value(value) for name, value in plan.params.items()},
        behaviours=tuple(name for name in names if name.startswith("behaviours/")),
        paths={name: str(path) for name, path in names.items()},
        models=_model_checksums(config),
        mocks=tuple(mocks),
        eye=camera_position(config),
        lag=lag,
    )
    tree = json.dumps(to_json(drawing_of(plan)), ensure_ascii=False).encode()
    return RecordContents(head, {name: _without_passwords(files[path]) for name, path in names.items()}, tree)


def _without_passwords(data: bytes) -> bytes:
    """Return the content of a file without the passwords of URLs."""
    try:
        return without_secrets(data.decode()).encode() if b"://" in data else data
    except UnicodeDecodeError:
        return data


def _name_files(files: Mapping[Path, bytes], python: set[Path]) -> Iterator[tuple[str, Path]]:
    """Yield for each file its name in the record, such as ``mission/greet.yaml``; equal names are numbered."""
    taken: set[str] = set()
    for path, data in files.items():
        kind = "behaviours" if path in python else _file_kind(path, data)
        name, number = f"{kind}/{path.name}", 1
        while name in taken:
            number += 1
            name = f"{kind}/{path.stem}-{number}{path.suffix}"
        taken.add(name)
        yield name, path


def _file_kind(path: Path, data: bytes) -> str:
    """Return the kind of a file of a run, by its name ending or its top-level keys; "file" if unknown."""
    if path.suffix.lower() in SHEET_SUFFIXES:
        return "move"
    try:
        root = compose(SourceText(str(path), data.decode("utf-8-sig")))
    except (InvalidFileError, UnicodeDecodeError):
        return "file"
    keys = set(root.keys()) if isinstance(root, Marked) else set()
    return next((kind for kind in FILE_KINDS if kind in keys), "file")


def _model_checksums(config: RobotConfig) -> dict[str, str]:
    """Return the SHA-256 of the face detection model, by file name; empty if it is missing."""
    if config.camera is None or config.camera.detector != "yunet":
        return {}
    path = Path(config.camera.model).expanduser() if config.camera.model else models_folder() / YUNET.file
    try:
        return {path.name: hashlib.sha256(read_regular(path, MAX_MODEL_BYTES)).hexdigest()}
    except OSError:  # making the detector reports this error
        return {}
