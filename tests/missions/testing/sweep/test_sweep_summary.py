"""Tests of what many runs say together."""

from math import isclose

import pytest
from hypothesis import given
from hypothesis import strategies as st

from missions.plugins.testing.sweep.files import runs_csv
from missions.plugins.testing.sweep.report import report
from missions.plugins.testing.sweep.summary import Z95, Rate, Summary, bin_runs, cause_of, summarise, wilson
from missions.plugins.testing.sweep.variation import DrawnValue, Outcome, SweepRow, ValueList, ValueRange, Variation

FAR = Variation("person.distance", "m", ValueRange(0.0, 5.0))


def row(
    seed: int, result: Outcome = "success", reason: str = "", seconds: float = 5.0, *values: DrawnValue
) -> SweepRow:
    return SweepRow(seed, values, result, reason, seconds, 100)


@pytest.mark.parametrize(
    ("successes", "runs", "low", "high"),
    [
        # Newcombe, Statistics in Medicine 17 (1998), 857-872, table I, method 3: the score method without correction.
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_interval_matches_published_values(successes: int, runs: int, low: float, high: float) -> None:
    assert wilson(successes, runs) == pytest.approx((low, high), abs=5e-5)


@given(st.integers(1, 5000).flatmap(lambda runs: st.tuples(st.integers(0, runs), st.just(runs))))
def test_wilson_interval_contains_the_share_and_solves_the_score_equation(counts: tuple[int, int]) -> None:
    successes, runs = counts
    share = successes / runs
    low, high = wilson(successes, runs)
    assert 0.0 <= low <= share <= high <= 1.0
    for bound in (low, high):
        if 0.0 < bound < 1.0:
            assert isclose((share - bound) ** 2, Z95**2 * bound * (1 - bound) / runs, rel_tol=1e-6, abs_tol=1e-12)
    mirrored = wilson(runs - successes, runs)
    assert (1 - mirrored[1], 1 - mirrored[0]) == pytest.approx((low, high))


def test_without_a_run_nothing_is_known() -> None:
    assert Rate(0, 0).interval == (0.0, 1.0)
    assert Rate(0, 0).share == 0.0


def test_causes_are_counted_without_their_numbers_and_the_most_frequent_comes_first() -> None:
    rows = [
        row(0),
        row(1, "failure", "no face for 2 s"),
        row(2, "failure", "turned by 12.5 deg, not by -90 deg"),
        row(3, "failure", "turned by 8 deg, not by 90 deg"),
        row(4, "error", "cannot be"),
        row(5, "failure", ""),
    ]
    found = [(each.text, each.runs, each.seed) for each in summarise(rows, ()).causes]
    assert found == [
        ("turned by # deg, not by # deg", 2, 2),
        ("error: cannot be", 1, 4),
        ("failure", 1, 5),
        ("no face for 2 s", 1, 1),
    ]
    assert cause_of(rows[0]) == ""


def test_times_are_those_of_successful_runs() -> None:
    rows = [*(row(seed, seconds=float(seed)) for seed in range(101)), row(101, "failure", "no", 999.0)]
    times = summarise(rows, ()).times
    assert times is not None
    assert (times.p5, times.median, times.p95, times.longest) == pytest.approx((5.0, 50.0, 95.0, 100.0))
    assert summarise(rows[-1:], ()).times is None


def test_the_worst_show_one_of_each_cause_before_more_of_the_same() -> None:
    rows = [
        row(0, seconds=30.0),
        row(1, seconds=3.0),
        *(row(seed, "failure", "frequent", 60.0) for seed in (2, 3, 4, 5, 6)),
        row(7, "failure", "rare", 2.0),
        row(8, "error", "broken", 0.0),
    ]
    assert [each.seed for each in summarise(rows, ()).worst] == [8, 2, 7, 3, 4]
    assert [each.seed for each in summarise(rows[:2], ()).worst] == [0, 1]


@given(st.lists(st.tuples(st.floats(0, 5), st.booleans()), max_size=60))
def test_each_run_is_in_one_part_of_a_range(values: list[tuple[float, bool]]) -> None:
    pairs = [(far, row(0, "success" if good else "failure")) for far, good in values]
    found = bin_runs(FAR, pairs)
    assert [(each.low, each.high) for each in found] == [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5)]
    assert sum(each.rate.runs for each in found) == len(values)
    assert sum(each.rate.successes for each in found) == sum(good for _, good in values)


def test_few_whole_numbers_and_words_each_stand_for_themselves() -> None:
    pairs: list[tuple[DrawnValue, SweepRow]] = [(1, row(0)), (3, row(1)), (3, row(2, "failure"))]
    found = bin_runs(Variation("people", "", ValueRange(1, 3)), pairs)
    assert [(each.label, each.rate.successes, each.rate.runs) for each in found] == [
        ("1", 1, 1),
        ("2", 0, 0),
        ("3", 1, 2),
    ]
    words = bin_runs(Variation("person.look", "", ValueList(("anna", "ben", "anna"))), [("ben", row(0))])
    assert [(each.label, each.rate.runs) for each in words] == [("anna", 0), ("ben", 1)]
    assert len(bin_runs(Variation("people", "", ValueRange(1, 100)), pairs)) == 5


def example() -> tuple[list[SweepRow], Summary]:
    rows = [row(seed, "success", "", 5.0 + seed, seed / 2) for seed in range(9)]
    rows.append(row(9, "failure", "no face for 2 s", 7.25, 4.5))
    return rows, summarise(rows, [FAR])


def test_report_is_a_plain_table() -> None:
    told = report(example()[1], lambda each: (f"{FAR.name}={each.values[0]}", f"mission run x --seed {each.seed}"))
    assert told.splitlines()[:12] == [
        "success   90.0 %   (9 of 10; 95 % interval 59.6 to 98.2 %)",
        "time      median 9.0 s, 5 % below 5.4 s, 5 % above 12.6 s, longest 13.0 s   (simulated, of the successes)",
        "",
        "causes of failure   runs   first seed",
        "no face for 2 s        1            9",
        "",
        "person.distance (m)   runs   success     95 % interval",
        "0 to 1                   2   100.0 %   34.2 to 100.0 %",
        "1 to 2                   2   100.0 %   34.2 to 100.0 %",
        "2 to 3                   2   100.0 %   34.2 to 100.0 %",
        "3 to 4                   2   100.0 %   34.2 to 100.0 %",
        "4 to 5                   2    50.0 %     9.5 to 90.5 %",
    ]
    assert told.splitlines()[14:17] == [
        "  seed 9: failure after 7.2 s: no face for 2 s",
        "    person.distance=4.5",
        "    mission run x --seed 9",
    ]


def test_the_csv_has_a_line_for_each_run() -> None:
    lines = runs_csv(example()[0], [FAR]).splitlines()
    assert lines[0] == "seed,person.distance (m),result,cause,reason,seconds,ticks"
    assert lines[1] == "0,0.0,success,,,5.0,100"
    assert lines[10] == "9,4.5,failure,no face for # s,no face for 2 s,7.25,100"
