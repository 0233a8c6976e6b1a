"""Tests of a sweep's runs: in this process, over several, and when one of those dies."""

import multiprocessing
from dataclasses import replace
from pathlib import Path

import cv2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from missions.plugins.testing.sweep.processes import MAX_CHUNK_SEEDS, WORKER_DIED, run_here, split_seeds
from missions.plugins.testing.sweep.sweep import run_seeds
from missions.plugins.testing.sweep.variation import SweepRow, ValueRange, Variation
from tests.missions.testing.sweep import labour


def by_seed(rows: list[SweepRow]) -> list[SweepRow]:
    return sorted(rows, key=lambda row: row.seed)


def test_run_depends_only_on_its_seed(tmp_path: Path) -> None:
    sweep = labour.glance(tmp_path)
    rows = run_seeds(sweep, range(8))
    assert [row.seed for row in rows] == list(range(8))
    assert {row.result for row in rows} == {"success", "failure"}
    assert run_seeds(sweep, [6, 2]) == [rows[6], rows[2]]


def test_row_has_drawn_values_and_failure_reason(tmp_path: Path) -> None:
    bearing, light, patience = labour.VARIED
    behind = replace(bearing, values=ValueRange(150.0, 150.0))
    (row,) = run_seeds(labour.glance(tmp_path, (behind, light, patience)), [3])
    assert row.values == (150.0, light.draw(3), patience.draw(3))
    assert (row.result, row.reason) == ("failure", f"no face found (timed out after {patience.draw(3):g} s)")
    assert row.seconds == pytest.approx(float(patience.draw(3)), abs=0.1)


def test_run_beyond_the_time_limit_is_unfinished_and_others_continue(tmp_path: Path) -> None:
    sweep = labour.glance(tmp_path, (Variation("person.bearing", "deg", ValueRange(150.0, 150.0)),))
    rows = run_seeds(replace(sweep, limit=1.0), [0, 1])
    assert [(row.result, row.reason) for row in rows] == [("unfinished", "not finished within 1 s")] * 2
    assert rows[0].seconds == pytest.approx(1.0, abs=0.1)


def test_impossible_world_is_an_error_in_its_row(tmp_path: Path) -> None:
    sweep = labour.glance(tmp_path, (Variation("person.distance", "m", ValueRange(1.0, 8.0)),))
    rows = run_seeds(sweep, range(8))
    outside = [row for row in rows if float(row.values[0]) > 5.0]
    assert outside
    assert outside == [row for row in rows if row.result == "error"]
    assert "Anna is outside the room" in outside[0].reason


def test_opencv_keeps_to_one_thread_while_a_worker_runs_and_no_longer(tmp_path: Path) -> None:
    before = cv2.getNumThreads()
    run_seeds(labour.glance(tmp_path, ()), [0])
    assert cv2.getNumThreads() == before


def test_run_that_kills_its_worker_is_an_error_and_others_continue(tmp_path: Path) -> None:
    sweep = labour.glance(tmp_path)
    rows = by_seed(list(run_here(sweep, range(16), 1, work=labour.deadly)))
    expected = labour.at_once(sweep, range(16))
    expected[5] = SweepRow(5, sweep.draw(5), "error", WORKER_DIED, 0.0, 0)
    assert rows == expected


def test_killed_worker_loses_no_run(tmp_path: Path) -> None:
    sweep = replace(labour.glance(tmp_path), file=str(tmp_path / "died"))
    rows = by_seed(list(run_here(sweep, range(16), 1, work=labour.deadly_once)))
    assert (tmp_path / "died").exists()
    assert rows == labour.at_once(sweep, range(16))


def test_aborted_sweep_leaves_no_worker(tmp_path: Path) -> None:
    work = run_here(labour.glance(tmp_path), range(100_000), 2)
    next(work)
    work.close()
    assert multiprocessing.active_children() == []


@given(st.integers(1, 500), st.integers(1, 64), st.integers(0, 1000))
def test_the_chunks_hold_every_seed_once_and_keep_all_workers_busy(runs: int, workers: int, first: int) -> None:
    seeds = range(first, first + runs)
    cut = split_seeds(seeds, workers)
    assert [seed for chunk in cut for seed in chunk] == list(seeds)
    assert max(len(chunk) for chunk in cut) <= MAX_CHUNK_SEEDS
    assert len(cut) >= min(runs, 4 * workers)
