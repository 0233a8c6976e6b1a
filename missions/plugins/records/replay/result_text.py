"""Text that describes the result of a rerun."""

from collections.abc import Callable, Iterator

from missions.plugins.records.replay.perception_rerun import ComparedTrack, PerceptionComparison
from missions.plugins.records.replay.rerun import CommandDifference, RerunResult
from missions.plugins.records.replay.rerun_files import RerunFiles
from missions.plugins.records.replay.status_comparison import NodePlace, StatusDifference

FileNamer = Callable[[str], str]
"""Function that returns the name of a mission file as shown to the user."""

END_OF_RECORD_NOTE = "Later inputs are not recorded for a robot that behaves differently."


def rerun_lines(result: RerunResult, sources: RerunFiles) -> Iterator[str]:
    """Yield the result of a rerun as lines; ``sources`` has the names of the mission files."""
    counts = f"{result.ticks} ticks decided again, {result.nodes} nodes compared"
    if not result.nodes:
        yield "no node of the mission is in the recorded tree: nothing to compare"
        return
    if result.is_identical:
        yield f"{counts}: no difference"
    else:
        yield f"{counts}: {_verdict(result)}"
    if result.difference is not None:
        yield from _difference_lines(result.difference, sources.display_name)
    if result.command is not None:
        yield from _command_lines(result.command)
    if result.difference is not None:
        yield END_OF_RECORD_NOTE
    if result.first_reworded is not None:
        yield f"same status, other reason: {result.reworded_count}, the first in tick {result.first_reworded.tick}"
        yield from _difference_lines(result.first_reworded, sources.display_name)


def perception_lines(comparison: PerceptionComparison) -> Iterator[str]:
    """Yield the result of a perception rerun as lines."""
    kept = [track for track in comparison.recorded if track.is_confirmed and not track.is_missed]
    counts = f"{len(kept)} found as before, {len(comparison.lost_tracks)} lost, {len(comparison.new_tracks)} new"
    yield f"{comparison.picture_count} pictures searched again: {counts}"
    for sign, tracks in (("lost", comparison.lost_tracks), ("new", comparison.new_tracks), ("found", kept)):
        yield from (f"  {sign:<6} {_track_text(track)}" for track in tracks)


def _verdict(result: RerunResult) -> str:
    if result.unanswered:
        return f"stopped {result.unanswered}, which has no recorded reply"
    if result.difference is not None:
        return f"first difference in tick {result.difference.tick}, at {result.difference.t:.2f} s"
    return "the same statuses, but different commands"


def _difference_lines(difference: StatusDifference, file_name: FileNamer) -> Iterator[str]:
    yield f"  {difference.current_place}"
    yield f"    then  {_place_text(difference.recorded_place, file_name)}  {difference.recorded}"
    yield f"    now   {_place_text(difference.current_place, file_name)}  {difference.current}"


def _place_text(place: NodePlace, file_name: FileNamer) -> str:
    return f"{file_name(place.file)}:{place.line}"


def _command_lines(difference: CommandDifference) -> Iterator[str]:
    by = f", by {difference.place}" if difference.place else ""
    yield f"  first different command: tick {difference.tick}, at {difference.t:.2f} s, {difference.part}{by}"
    yield f"    then  {difference.recorded or 'none'}"
    yield f"    now   {difference.current or 'none'}"


def _track_text(track: ComparedTrack) -> str:
    return f"{track.label} from {track.start:.2f} s: in {track.found_count} of {track.picture_count} pictures"
