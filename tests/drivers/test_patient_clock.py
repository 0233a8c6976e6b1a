"""A clock on which no time passes while a virtual device is held up by a busy machine."""

import pytest

from drivers.clock import ManualClock
from drivers.virtual.patient_clock import MAX_DEVICE_DELAY, PatientClock


@pytest.fixture
def machine() -> ManualClock:
    """A machine whose time a test sets."""
    return ManualClock()


def test_patient_clock_equals_the_machine_clock_without_devices(machine: ManualClock) -> None:
    clock = PatientClock(machine)
    machine.advance(7.5)
    assert clock.now() == 7.5


def test_no_time_passes_while_one_of_two_is_held_up(machine: ManualClock) -> None:
    clock = PatientClock(machine)
    clock.heartbeat("base")
    clock.heartbeat("head")
    for _ in range(100):
        machine.advance(0.01)
        clock.heartbeat("base")
    assert clock.now() == pytest.approx(MAX_DEVICE_DELAY)
    clock.heartbeat("head")
    machine.advance(0.01)
    assert clock.now() == pytest.approx(MAX_DEVICE_DELAY + 0.01)


def test_time_continues_after_a_device_unregisters(machine: ManualClock) -> None:
    clock = PatientClock(machine)
    clock.heartbeat("base")
    machine.advance(1.0)
    assert clock.now() == pytest.approx(MAX_DEVICE_DELAY)
    clock.unregister("base")
    machine.advance(1.0)
    assert clock.now() == pytest.approx(MAX_DEVICE_DELAY + 1.0)


def test_patient_clock_never_runs_backwards(machine: ManualClock) -> None:
    clock, seen = PatientClock(machine), [0.0]
    for turn in range(500):
        machine.advance((turn * 37 % 11) / 100)
        if turn % 3:
            clock.heartbeat(turn % 5)
        if turn % 7 == 0:
            clock.unregister(turn % 4)
        seen.append(clock.now())
    assert seen == sorted(seen)
