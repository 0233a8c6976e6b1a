"""When tasks are due, in places whose clocks change."""

from datetime import UTC, datetime, time, timedelta
from itertools import pairwise
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st

from missions.plugins.tasks.queue import DAYS, Repetition, first_time, local_zone, next_time, read_at, read_repetition
from tests.missions.service.small_queue import BERLIN, START

ZONES = st.sampled_from([BERLIN, ZoneInfo("America/New_York"), ZoneInfo("Australia/Lord_Howe"), ZoneInfo("UTC")])
MOMENTS = st.integers(1_577_836_800, 1_893_456_000).map(float)  # 2020 to 2030
EVERY_DAY = st.builds(
    Repetition, day=st.sampled_from([None, *range(7)]), at=st.builds(time, st.integers(0, 23), st.integers(0, 59))
)
PERIODS = st.floats(1.0, 1e6).map(lambda period: Repetition(period=period))


def berlin(text: str, fold: int = 0) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=BERLIN, fold=fold).timestamp()


@pytest.mark.parametrize(
    ("text", "due"),
    [
        ("12:01", "2026-11-21 12:01"),
        ("18:00", "2026-11-21 18:00"),
        ("12:00", "2026-11-22 12:00"),
        ("9:05", "2026-11-22 09:05"),
        ("2026-12-24 18:00", "2026-12-24 18:00"),
        ("2026-12-24T18:00", "2026-12-24 18:00"),
    ],
)
def test_time_of_day_is_the_next_such_time(text: str, due: str) -> None:
    assert read_at(text, START, BERLIN) == berlin(due)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("24:00", "'24:00' is not a time of day"),
        ("noon", "'noon' is not a time of day"),
        ("18", "'18' is not a time of day"),
        ("18:3x", "is not a time of day"),
        ("٢:00", "'٢:00' is not a time of day"),
        ("2026-1٢-24 18:00", "is not a time of day"),
        ("1²:00", "is not a time of day"),
        ("018:00", "is not a time of day"),
        ("9:5", "is not a time of day"),
        ("2026-02-30 18:00", "is not a date"),
        ("2026-11-21 11:59", "'2026-11-21 11:59' is in the past: it is 2026-11-21 12:00 now"),
    ],
)
def test_invalid_or_past_time_is_refused(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        read_at(text, START, BERLIN)


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("30 min", "1800 s"),
        ("1.5 h", "5400 s"),
        ("day", "day 12:00"),
        ("Day 06:30", "day 06:30"),
        ("monday", "monday 12:00"),
        ("sunday 7:00", "sunday 07:00"),
    ],
)
def test_repetition_without_time_of_day_uses_that_of_its_start(text: str, written: str) -> None:
    every = read_repetition(text, START, BERLIN)
    assert str(every) == written
    assert read_repetition(str(every), 0.0, BERLIN) == every


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("mondy", "did you mean 'monday'"),
        ("5", "such as '30 min', 'day' or 'monday 18:00'"),
        ("3 m", "is not a repetition"),
        ("٣ h", "is not a repetition"),
        ("day ٢:00", "'٢:00' is not a time of day"),
        ("0.5 s", "too often: at least 1 s"),
        ("-1 h", "too often"),
        ("1e15 s", "too rare: at most a year, 8784 h"),
        ("day 25:00", "'25:00' is not a time of day"),
    ],
)
def test_invalid_repetition_is_refused(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        read_repetition(text, START, BERLIN)


def test_a_weekday_comes_once_a_week() -> None:
    monday = Repetition(day=0, at=time(9))
    first = first_time(monday, START, BERLIN)
    assert first == berlin("2026-11-23 09:00")
    assert first_time(monday, first, BERLIN) == first
    assert next_time(monday, first, first + 60.0, BERLIN) == berlin("2026-11-30 09:00")


def test_time_skipped_by_daylight_saving_becomes_the_clock_change() -> None:
    every = Repetition(at=time(2, 30))
    gap = next_time(every, berlin("2026-03-28 02:30"), 0.0, BERLIN)
    assert datetime.fromtimestamp(gap, UTC) == datetime(2026, 3, 29, 1, 0, tzinfo=UTC)
    assert next_time(every, gap, gap, BERLIN) == berlin("2026-03-30 02:30"), "it does not stay at the later time"
    assert read_at("2026-03-29 02:30", START - 300 * 86400, BERLIN) == gap


@pytest.mark.parametrize(
    ("now", "at", "due", "next_due"),
    [
        ("2026-03-28 12:00", "02:30", "2026-03-29 03:00", "2026-03-30 02:30"),
        ("2026-03-28 12:00", "2026-03-29 02:30", "2026-03-29 03:00", "2026-03-30 02:30"),
        ("2026-03-28 12:00", "2026-03-29T2:30", "2026-03-29 03:00", "2026-03-30 02:30"),
        ("2026-03-28 12:00", "03:00", "2026-03-29 03:00", "2026-03-30 03:00"),
        ("2026-10-24 12:00", "02:30", "2026-10-25 02:30", "2026-10-26 02:30"),
    ],
)
def test_requested_time_is_kept_if_the_first_one_is_skipped(now: str, at: str, due: str, next_due: str) -> None:
    first = read_at(at, berlin(now), BERLIN)
    for text in ("day", "sunday"):
        every = read_repetition(text, first, BERLIN, at)
        assert first_time(every, first, BERLIN) == first == berlin(due)
        days = 1 if text == "day" else 7
        week = (datetime.fromisoformat(next_due) + timedelta(days=days - 1)).isoformat()
        assert next_time(every, first, first, BERLIN) == berlin(week)


def test_time_repeated_by_daylight_saving_runs_once() -> None:
    every = Repetition(at=time(2, 30))
    fold = next_time(every, berlin("2026-10-24 02:30"), 0.0, BERLIN)
    assert datetime.fromtimestamp(fold, UTC) == datetime(2026, 10, 25, 0, 30, tzinfo=UTC)
    assert next_time(every, fold, fold + 3600.0, BERLIN) == berlin("2026-10-26 02:30")


def test_half_an_hour_is_half_an_hour_whatever_the_clocks_do() -> None:
    due = berlin("2026-10-25 02:30")
    assert next_time(Repetition(period=1800.0), due, due, BERLIN) == due + 1800.0


@given(every=EVERY_DAY, begin=MOMENTS, zone=ZONES)
def test_daily_task_comes_once_on_each_day(every: Repetition, begin: float, zone: ZoneInfo) -> None:
    times = [first_time(every, begin, zone)]
    for _ in range(20):
        times.append(next_time(every, times[-1], times[-1], zone))
    days = [datetime.fromtimestamp(each, zone).date() for each in times]
    step = timedelta(days=1 if every.day is None else 7)
    assert all(after - before == step for before, after in pairwise(days))
    assert times[0] >= begin
    assert every.day is None or all(DAYS[day.weekday()] == DAYS[every.day] for day in days)
    off = [each for each in times if datetime.fromtimestamp(each, zone).time() != every.at]
    assert len(off) <= 1, "only where the clocks go forward is it another time of day"


@given(every=st.one_of(EVERY_DAY, PERIODS), due=MOMENTS, late=st.floats(-1e5, 1e7), zone=ZONES)
def test_the_next_time_is_the_first_after_both(every: Repetition, due: float, late: float, zone: ZoneInfo) -> None:
    found = next_time(every, due, due + late, zone)
    assert found > max(due, due + late)
    if every.period:
        steps = (found - due) / every.period
        assert steps == pytest.approx(round(steps), abs=1e-6)
        assert found - every.period <= max(due, due + late) + 1e-3
    else:
        assert found - max(due, due + late) <= (8 if every.day is not None else 2) * 86400.0


@given(every=st.one_of(EVERY_DAY, PERIODS))
def test_a_repetition_can_be_read_again(every: Repetition) -> None:
    again = read_repetition(str(every), 0.0, BERLIN)
    assert (again.day, again.at) == (every.day, every.at)
    assert again.period == pytest.approx(every.period, rel=1e-9)


def test_local_zone_is_that_of_tz_or_the_machine() -> None:
    assert local_zone({"TZ": ":Europe/Berlin"}) == BERLIN
    assert local_zone({"TZ": "Nowhere/At_all"}) is UTC
    now = datetime(2026, 7, 1, tzinfo=UTC)
    assert now.astimezone(local_zone({})).utcoffset() is not None
