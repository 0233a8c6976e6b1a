"""What a run leaves behind that was ended at any moment: its record, its processes, and its notes."""

from contextlib import suppress
from pathlib import Path

from missions.control.run_search import search_runs
from missions.control.sockets import connect, socket_folder, socket_path
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.recording.validation import InvalidRecordError
from tests.forked import Forked

MARK = "MISSION_KILLED"
"""What the environment of a run has, and of all that it starts."""


def readable(record: Path, *, moved: bool) -> bool:
    """Read a record as far as it goes; one of a run that has moved something must be there."""
    try:
        list(open_record(record).tick_records)
    except (FileNotFoundError, InvalidRecordError):
        assert not moved
        return False
    return True


def nobody_left(mark: str) -> bool:
    return not marked(mark)


def marked(mark: str) -> dict[int, str]:
    """Return what all processes do that were started by the run of this mark, but for those that have ended."""
    found = {}
    for folder in Path("/proc").iterdir():
        with suppress(OSError):
            if folder.name.isdecimal() and f"{MARK}={mark}\0".encode() in (folder / "environ").read_bytes() + b"\0":
                found[int(folder.name)] = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
    return found


def writer_of(mark: str, record: Path) -> int | None:
    """Return the process that writes a record, once there is one."""
    files = {number: files_of(number) for number in marked(mark)}
    return next((number for number, names in files.items() if str(record) in names), None)


def files_of(process: int) -> set[str]:
    """Return the files that a process has open."""
    found = set[str]()
    with suppress(OSError):
        for link in Path(f"/proc/{process}/fd").iterdir():
            with suppress(OSError):
                found.add(str(link.readlink()))
    return found


def left_of(process: Forked) -> list[str]:
    """Return what is left of a run in the folder of all runs, once somebody has looked for it."""
    name = str(process.pid)
    assert all(each.run != name or each.holder is None for each in search_runs().processes)
    with suppress(OSError), connect(socket_path(name)):
        return [f"somebody answers for {name}"]
    return [path.name for path in socket_folder().glob(f"{name}.*")]
