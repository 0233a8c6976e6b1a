"""Whether a file is a record of ours, and which; if it is none, what it is instead."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from config.library import kinds_of, wrong_kind
from missions.records.recording.codec import from_json
from missions.records.recording.faults import InvalidRecordError, seconds, strict_json, understanding
from missions.records.recording.head import FORMAT, METADATA, Head

if TYPE_CHECKING:  # it needs mcap, which may be missing
    from missions.records.recording.container import Container

PROFILE = "missiontree"
"""How the header of a file says that it is ours."""

FIRST_YEAR, LAST_YEAR = 1970, 2200
"""Between these every clock of a robot is."""

NEWEST = f"was written by a newer MissionTree; this one reads format {FORMAT}\n  try: pip install --upgrade missiontree"


def no_mcap(path: Path) -> InvalidRecordError:
    """Return what is to be said of a file that does not begin as MCAP files do. Raises OSError."""
    if not path.is_file():
        made = path if path.suffix == ".mcap" else "run.mcap"
        hint = f"mission run MISSION --record {made}, which makes one"
        return InvalidRecordError(f"{path}: no record: it is not even a file\n  try: {hint}")
    if path.stat().st_size == 0:
        return InvalidRecordError(f"{path}: is empty: its run ended before anything was written")
    if "missions" in kinds_of(path):
        return InvalidRecordError(
            f"{path}: a mission, and no record\n  try: mission run {path} --record {path.stem}.mcap, which makes one"
        )
    if other := wrong_kind("records", path):
        return InvalidRecordError(other)
    return InvalidRecordError(f"{path}: no record: it does not begin as an MCAP file does")


def head_in(container: "Container", tables: Mapping[str, Mapping[str, str]]) -> Head:
    """Return what a record says of itself. Raises InvalidRecordError where it is none of ours, or too new."""
    path, header = container.path, container.header()
    if METADATA not in tables and (header is None or header.profile != PROFILE):
        raise _foreign(container)
    data = next((message.data for message in container.messages(frozenset({"/mission"}))), None)
    with understanding(path):
        written = {"format": int(tables.get(METADATA, {}).get("format", FORMAT))} if data is None else strict_json(data)
        if written["format"] > FORMAT:
            raise InvalidRecordError(f"{path}: {NEWEST}")
        if data is None:
            raise InvalidRecordError(f"{path}: its beginning is missing or damaged, so that none of it can be read")
        return _sound(from_json(written, Head))


def _sound(head: Head) -> Head:
    """Return a head whose numbers can be reckoned with. Raises ValueError for another."""
    if not FIRST_YEAR <= datetime.fromisoformat(head.started).year <= LAST_YEAR:
        raise ValueError(f"no run began at {head.started:.40}")
    for figure in (head.rate, 0.0 if head.lag is None else head.lag, *head.eye):
        seconds(figure)
    if head.rate <= 0:
        raise ValueError(f"a rate of {head.rate:g} Hz")
    return head


def _foreign(container: "Container") -> InvalidRecordError:
    path, header = container.path, container.header()
    if header is None or not container.chunk_spans:
        return InvalidRecordError(f"{path}: ends or is damaged before it says what it is of: nothing can be read")
    by = " and ".join(filter(None, (header.profile, header.library)))
    told = f": it is of {by}" if by else ""
    return InvalidRecordError(
        f"{path}: an MCAP file, but no record of MissionTree{told}\n  try: Foxglove, which opens it"
    )
