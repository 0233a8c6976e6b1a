"""How many pictures a record has: never more than the rate, never more than there is room for, and never none."""

from hypothesis import given
from hypothesis import strategies as st

from missions.plugins.records.recording.budget import FrameBudget


@given(st.floats(0.5, 30.0), st.floats(1.0, 60.0))
def test_frames_are_recorded_at_the_given_rate_at_most(rate: float, camera: float) -> None:
    budget = FrameBudget(1e9, rate)
    kept = [number / camera for number in range(int(20 * camera)) if budget.accept(number / camera)]
    assert len(kept) <= 20 * rate + 2
    assert len(kept) >= min(rate, camera) * 20 * 0.6 - 2


@given(st.integers(1_000, 500_000), st.integers(1, 100))
def test_recorded_frames_never_exceed_the_byte_budget(room: int, size: int) -> None:
    budget = FrameBudget(room, 5.0)
    used = 0
    for number in range(20_000):
        if budget.accept(number / 10):
            budget.consume(size)
            used += size
    assert used <= room + size


def test_each_time_half_of_the_room_is_gone_the_rate_is_halved() -> None:
    budget = FrameBudget(1000, 8.0)
    rates = []
    for _ in range(9):
        budget.consume(100)
        rates.append(budget.rate)
    assert rates == [8.0, 8.0, 8.0, 8.0, 4.0, 4.0, 4.0, 2.0, 1.0]


def test_a_rate_of_nothing_is_no_frame() -> None:
    assert not any(FrameBudget(1e9, 0.0).accept(float(t)) for t in range(10))
