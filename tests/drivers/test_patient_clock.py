"""A clock on which no time passes while a virtual device is held up by a busy machine."""

import pytest

from drivers.virtual import patient_clock
from drivers.virtual.patient_clock import PATIENCE, PatientClock


class Machine:
    """The machine's clock, by hand."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        """Return its time."""
        return self.now


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    """A machine whose time a test sets."""
    machine = Machine()
    monkeypatch.setattr(patient_clock, "time", machine)
    return machine


def test_it_is_the_machines_clock_while_it_waits_for_nobody(machine: Machine) -> None:
    clock = PatientClock()
    machine.now += 7.5
    assert clock.now() == 7.5


def test_no_time_passes_while_one_of_two_is_held_up(machine: Machine) -> None:
    clock = PatientClock()
    clock.attend("base")
    clock.attend("head")
    for _ in range(100):
        machine.now += 0.01
        clock.attend("base")
    assert clock.now() == pytest.approx(PATIENCE)
    clock.attend("head")
    machine.now += 0.01
    assert clock.now() == pytest.approx(PATIENCE + 0.01)


def test_time_goes_on_for_the_others_once_one_is_gone(machine: Machine) -> None:
    clock = PatientClock()
    clock.attend("base")
    machine.now += 1.0
    assert clock.now() == pytest.approx(PATIENCE)
    clock.dismiss("base")
    machine.now += 1.0
    assert clock.now() == pytest.approx(PATIENCE + 1.0)


def test_it_never_runs_backwards_whoever_comes_and_goes(machine: Machine) -> None:
    clock, seen = PatientClock(), [0.0]
    for turn in range(500):
        machine.now += (turn * 37 % 11) / 100
        if turn % 3:
            clock.attend(turn % 5)
        if turn % 7 == 0:
            clock.dismiss(turn % 4)
        seen.append(clock.now())
    assert seen == sorted(seen)
