"""The figures of a record: what is counted, and from when to when times are taken."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.api import HeadPose, Health, Velocity
from drivers.errors import NoReply
from missions.executive.tick_record import Answer, TickRecord
from missions.plugins.records.recording.items import HealthItem, ViewItem
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.statistics.computation import (
    PICTURE_SEARCH,
    PICTURE_TO_PERCEPTS,
    TICK_LATE,
    TICK_WORK,
    compute_stats,
)
from missions.plugins.records.statistics.figures import Stats, TimeQuantiles, WireFigures, merge_stats, time_quantiles
from perception.api import View
from tests.benchmarks.recording import run
from tests.missions.records.recording.small_record import HEAD, Item, face, items, write

REAL = replace(HEAD, simulate="", world="")


def stats_of(path: Path, what: Sequence[Item], *, real: bool = True) -> Stats:
    return compute_stats(open_record(write(path / "run.mcap", what, head=REAL if real else HEAD)))


def tick(number: int, *answers: Answer, late: float = 0.0, spent: float = 0.001) -> TickRecord:
    return TickRecord("tick", number, number / 20, late, spent, list(answers))


LOOK: Answer = ("head", "look", (HeadPose(0.1, 0.0),), HeadPose(0.1, 0.0))
DRIVE: Answer = ("base", "drive", (Velocity(0.1, 0.0),), Velocity(0.1, 0.0))


def looked(stamp: float | None) -> Answer:
    return ("sight", "looked", (), stamp)


def test_stats_count_run_ticks_and_nodes(tmp_path: Path) -> None:
    stats = stats_of(tmp_path, items(), real=False)
    assert (stats.kind.mission, stats.kind.simulate, stats.results) == ("greet", "fast", {"success": 1})
    assert (stats.ticks, stats.seconds) == (80, 4.0)
    nodes = {place.key: (node.ticks, node.success, node.failure) for place, node in stats.nodes.items()}
    assert nodes == {"1": (80, 1, 0), "1.1": (51, 1, 1)}
    assert [place.title for place in stats.nodes] == ["sequence", "look_for"]


def test_lateness_and_overruns_follow_the_schedule(tmp_path: Path) -> None:
    moments = [tick(1, late=0.002, spent=0.001), tick(2, spent=0.12), tick(3, late=0.051)]
    stats = stats_of(tmp_path, moments)
    assert stats.delays[TICK_LATE].tolist() == [0.002, 0.0, 0.051]
    assert stats.delays[TICK_WORK].tolist() == [0.001, 0.12, 0.001]
    assert stats.overruns == 2 + 1  # 0.12 s at 20 Hz, then 0.052 s


def test_in_simulated_time_nothing_is_late_and_no_search_takes_time(tmp_path: Path) -> None:
    stats = stats_of(tmp_path, [tick(1, spent=0.3), ViewItem(1.0, View(0.9, (face(0.9),)))], real=False)
    assert (stats.overruns, TICK_LATE in stats.delays, PICTURE_SEARCH in stats.delays) == (0, False, False)
    assert stats.delays[PICTURE_TO_PERCEPTS].tolist() == pytest.approx([0.1])


def test_search_time_and_picture_to_percepts_are_separate(tmp_path: Path) -> None:
    stats = stats_of(tmp_path, [ViewItem(1.08, View(1.0, spent=0.03)), ViewItem(2.0, View())])
    assert stats.delays[PICTURE_SEARCH].tolist() == [0.03]
    assert stats.delays[PICTURE_TO_PERCEPTS].tolist() == pytest.approx([0.08])


def test_reaction_time_spans_picture_to_resulting_command(
    tmp_path: Path,
) -> None:
    moments = [
        tick(1, LOOK, looked(0.01)),  # commanded before it was asked: the picture had no part in that
        tick(2, looked(0.04), LOOK),
        tick(3, looked(0.04), LOOK),  # the same picture
        tick(4, looked(None), LOOK),
        tick(5, ("sight", "faces", (), (face(0.2), face(0.21))), LOOK),
        tick(6, looked(0.29), ("head", "look", (HeadPose(0.1, 0.0),), NoReply("head: silent", hint="wait"))),
    ]
    stats = stats_of(tmp_path, moments)
    found = {name: times.tolist() for name, times in stats.delays.items() if name.startswith("picture to")}
    assert found == {"picture to head on the wire": pytest.approx([0.1 + 0.001 - 0.04, 0.25 + 0.001 - 0.21])}


def test_base_command_is_sent_at_its_next_renewal(tmp_path: Path) -> None:
    counters = {"commands": 4, "command_us": 40_000, "longest_command_us": 20_000, "frames": 7}
    checked = HealthItem(1.0, {"base": Health(True, counters=counters)})
    stats = stats_of(tmp_path, [tick(2, looked(0.04), DRIVE), checked])
    assert stats.wires == {("base", "command"): WireFigures(4, 0.04, 0.02)}
    assert stats.delays["picture to base on the wire"].tolist() == pytest.approx([0.1 + 0.001 + 0.01 - 0.04])
    assert stats.counts == {("base", "frames"): 7}


def test_in_simulated_time_a_reaction_ends_with_the_command(tmp_path: Path) -> None:
    stats = stats_of(tmp_path, [tick(2, looked(0.04), DRIVE)], real=False)
    assert stats.delays["picture to base command"].tolist() == pytest.approx([0.06])


def test_counters_are_differences_and_gauges_are_ignored(tmp_path: Path) -> None:
    def checked(t: float, tries: int) -> HealthItem:
        counters = {"tries": tries, "exchanges": tries, "exchange_us": tries * 1000, "achieved rate (Hz)": 100}
        return HealthItem(t, {"arm": Health(True, counters={**counters, "longest_exchange_us": 3000})})

    stats = stats_of(tmp_path, [checked(0.0, 10), checked(2.0, 250)])
    assert stats.counts == {("arm", "tries"): 250}
    assert stats.wires == {("arm", "exchange"): WireFigures(250, 0.25, 0.003)}
    assert stats.wires["arm", "exchange"].mean == pytest.approx(0.001)


def test_runs_of_one_kind_are_taken_together_with_every_single_time(tmp_path: Path) -> None:
    fast = stats_of(tmp_path, items(), real=False)
    real = stats_of(tmp_path, [tick(1, late=0.1), tick(2, late=0.3)])
    other = stats_of(tmp_path, [tick(1, late=0.2)])
    together = merge_stats([real, fast, other])
    assert [(each.kind.simulate, each.records) for each in together] == [("", 2), ("fast", 1)]
    assert sorted(together[0].delays[TICK_LATE].tolist()) == [0.1, 0.2, 0.3]
    assert together[0].results == {"not recorded": 2}
    twice = merge_stats([fast, fast])[0]
    assert [(node.ticks, node.runs) for node in twice.nodes.values()] == [(160, 2), (102, 4)]


def test_quantiles_cover_all_times() -> None:
    times = np.arange(101.0)
    assert time_quantiles(times) == TimeQuantiles(101, 50.0, 95.0, 99.0, 100.0)


def test_simulated_run_is_read_back_completely_from_its_record(tmp_path: Path) -> None:
    path = tmp_path / "patrol.mcap"
    outcome = run(path, ticks=100)
    assert outcome.told == outcome.read
    assert outcome.read["/moments"] >= 100
    assert len(outcome.recorded.work) == len(outcome.bare.work) == 100
    assert compute_stats(open_record(path)).ticks == 100
