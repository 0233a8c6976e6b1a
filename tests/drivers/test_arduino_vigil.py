"""Whether a board is the one that we know: a probe too many is none without end, and no proof where there is doubt."""

from drivers.arduino.vigil import ANSWER, Vigil


def met(now: float) -> Vigil:
    """Return one that has met its board: a probe, the question that belongs to its answer, and the answer."""
    vigil = Vigil()
    vigil.probed(now)
    vigil.questioned(now)
    vigil.answered(now)
    return vigil


def test_an_answer_that_took_too_long_sets_off_one_probe_and_not_one_after_the_other() -> None:
    vigil, now = met(10.0), 11.0
    vigil.probed(now)
    assert vigil.overdue(now + ANSWER + 0.01)
    now += 2 * ANSWER
    under_way, probes = 1, 0
    while under_way and probes < 20:
        now += 0.002
        if vigil.questioned(now):  # each answer begins with a question
            vigil.probed(now)
            under_way, probes = under_way + 1, probes + 1
        vigil.answered(now)
        under_way -= 1
    assert probes == 1
    assert vigil.asked_at is None


def test_a_board_that_asks_once_more_soon_after_its_answer_is_doubted_until_it_answers_again() -> None:
    vigil = met(10.0)
    assert vigil.sure(10.01)
    assert not vigil.questioned(10.02)
    assert not vigil.sure(10.02)
    assert vigil.doubtful
    vigil.probed(10.03)
    vigil.questioned(10.04)
    vigil.answered(10.04)
    assert vigil.sure(10.05)
    assert not vigil.doubtful


def test_a_board_that_asks_twice_later_on_is_probed() -> None:
    vigil = met(10.0)
    assert not vigil.questioned(12.5)
    assert vigil.questioned(13.0)
