"""What a re-run, and a second look at the pictures, have brought, in words."""

from collections.abc import Callable, Iterator

from missions.plugins.records.replay.compare import Difference, Place
from missions.plugins.records.replay.rerun import OtherCommand, Rerun
from missions.plugins.records.replay.see import Seen, Track
from missions.plugins.records.replay.sources import Sources

Shown = Callable[[str], str]
"""Returns the name of a mission's file for people."""

ENDS_HERE = "What the robot would have been told from here on is nowhere recorded."


def about_rerun(rerun: Rerun, sources: Sources) -> Iterator[str]:
    """Yield what a re-run has brought, a line for each thing; ``sources`` know what the mission's files are called."""
    counts = f"{rerun.ticks} ticks decided again, {rerun.nodes} nodes compared"
    if not rerun.nodes:
        yield "no node of the mission is in the recorded tree: there is nothing to compare"
        return
    if rerun.same:
        yield f"{counts}: no difference"
    else:
        yield f"{counts}: {_verdict(rerun)}"
    if rerun.difference is not None:
        yield from _difference(rerun.difference, sources.shown)
    if rerun.command is not None:
        yield from _command(rerun.command)
    if rerun.difference is not None:
        yield ENDS_HERE
    if rerun.reworded is not None:
        yield f"same status, other words: {rerun.words}, the first in tick {rerun.reworded.tick}"
        yield from _difference(rerun.reworded, sources.shown)


def about_sight(seen: Seen) -> Iterator[str]:
    """Yield what a second look at the pictures of a record has brought."""
    kept = [track for track in seen.then if track.long and not track.missed]
    counts = f"{len(kept)} found as then, {len(seen.lost)} lost, {len(seen.new)} new"
    yield f"{seen.pictures} pictures searched again: {counts}"
    for sign, tracks in (("lost", seen.lost), ("new", seen.new), ("found", kept)):
        yield from (f"  {sign:<6} {_track(track)}" for track in tracks)


def _verdict(rerun: Rerun) -> str:
    if rerun.unheard:
        return f"the record ends what can be known: {rerun.unheard}, which it has never heard"
    if rerun.difference is not None:
        return f"first difference in tick {rerun.difference.tick}, at {rerun.difference.t:.2f} s"
    return "the same statuses, but not the same commands"


def _difference(difference: Difference, shown: Shown) -> Iterator[str]:
    yield f"  {difference.now_at}"
    yield f"    then  {_place(difference.then_at, shown)}  {difference.then}"
    yield f"    now   {_place(difference.now_at, shown)}  {difference.now}"


def _place(place: Place, shown: Shown) -> str:
    return f"{shown(place.file)}:{place.line}"


def _command(other: OtherCommand) -> Iterator[str]:
    by = f", by {other.by}" if other.by else ""
    yield f"  first other command: tick {other.tick}, at {other.t:.2f} s, {other.part}{by}"
    yield f"    then  {other.then or 'none'}"
    yield f"    now   {other.now or 'none'}"


def _track(track: Track) -> str:
    return f"{track.what} from {track.begun:.2f} s: in {track.found} of {track.pictures} pictures"
