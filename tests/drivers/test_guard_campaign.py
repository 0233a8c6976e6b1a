"""The range guard among people and furniture, by chance: it drives into nothing that was visible in time."""

from statistics import median

import pytest

from drivers.base.twin import BaseTwin
from tests.drivers.guard_campaign import draw, play, run_errand
from tests.tries import tries

SEEDS, CLEAN_SEEDS = 16, 6
MOST_SEEDS, MOST_CLEAN_SEEDS = 10_000, 400


def test_guarded_base_never_hits_visible_obstacles() -> None:
    touched = [seed for seed in range(tries(SEEDS, MOST_SEEDS)) if play(seed).bad]
    assert touched == []


def test_unguarded_base_hits_obstacles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BaseTwin, "guard_by", lambda *_: None)
    assert sum(bool(play(seed).bad) for seed in range(20)) >= 3


def test_clean_missions_among_furniture_still_finish_and_take_no_longer() -> None:
    finished, slower = [], []
    for seed in range(min(tries(CLEAN_SEEDS, MOST_CLEAN_SEEDS), MOST_CLEAN_SEEDS)):
        without = run_errand(seed, guarded=False)
        if without.succeeded == without.leaves and without.nearest > 0.0:
            with_guard = run_errand(seed, guarded=True)
            finished.append(with_guard.succeeded == with_guard.leaves)
            slower += [with_guard.seconds / without.seconds - 1] if finished[-1] else []
    assert sum(finished) >= 0.95 * len(finished) - 1
    assert median(slower) <= 0.1


def test_all_hands_are_drawn_and_a_seed_plays_the_same_again() -> None:
    assert {draw(seed).hand for seed in range(20)} == {"leaves", "teleop", "studio"}
    assert play(3).way == play(3).way
