"""A clock on which no time passes while a virtual device is held up by a busy machine."""

import pytest

from drivers.clock import ManualClock
from drivers.virtual.patient_clock import PATIENCE, PatientClock


@pytest.fixture
def machine() -> ManualClock:
    """A machine whose time a test sets."""
    return ManualClock()


def test_it_is_the_machines_clock_while_it_waits_for_nobody(machine: ManualClock) -> None:
    clock = PatientClock(machine)
    machine.advance(7.5)
    assert clock.now() == 7.5


def test_no_time_passes_while_one_of_two_is_held_up(machine: ManualClock) -> None:
    clock = PatientClock(machine)
    clock.attend("base")
    clock.attend("head")
    for _ in range(100):
        machine.advance(0.01)
        clock.attend("base")
    assert clock.now() == pytest.approx(PATIENCE)
    clock.attend("head")
    machine.advance(0.01)
    assert clock.now() == pytest.approx(PATIENCE + 0.01)


def test_time_goes_on_for_the_others_once_one_is_gone(machine: ManualClock) -> None:
    clock = PatientClock(machine)
    clock.attend("base")
    machine.advance(1.0)
    assert clock.now() == pytest.approx(PATIENCE)
    clock.dismiss("base")
    machine.advance(1.0)
    assert clock.now() == pytest.approx(PATIENCE + 1.0)


def test_it_never_runs_backwards_whoever_comes_and_goes(machine: ManualClock) -> None:
    clock, seen = PatientClock(machine), [0.0]
    for turn in range(500):
        machine.advance((turn * 37 % 11) / 100)
        if turn % 3:
            clock.attend(turn % 5)
        if turn % 7 == 0:
            clock.dismiss(turn % 4)
        seen.append(clock.now())
    assert seen == sorted(seen)
