"""How long things take on a device's wire, as its health has it."""

import pytest

from drivers.api import Source, Velocity
from drivers.base.limits import VelocityLimits
from drivers.base.velocity_multiplexer import VelocityMultiplexer
from drivers.errors import NoReply
from drivers.kobuki.virtual import VirtualKobuki
from drivers.servos.bus import ServoAddress
from drivers.transport.history import DelayStatistics
from tests.drivers.chains import chain
from tests.drivers.lines import direct_bus
from tests.drivers.test_kobuki_driver import Bench


def test_durations_are_counted_in_microseconds() -> None:
    delays = DelayStatistics()
    for seconds in (0.001, 0.003, 0.0005):
        delays.add(seconds)
    assert delays.counters("exchange") == {"exchanges": 3, "exchange_us": 4500, "longest_exchange_us": 3000}


def mux() -> VelocityMultiplexer:
    return VelocityMultiplexer(VelocityLimits(0.5, 1.9, 0.5, 3.5))


def test_command_delay_ends_at_the_first_matching_velocity() -> None:
    waiting = mux()
    waiting.request(Velocity(0.1, 0.0), 1.0, None)
    for now in (1.015, 1.035):
        waiting.next_velocity(now, None)
    waiting.request(Velocity(0.1, 0.0), 1.04, None)
    waiting.next_velocity(1.045, None)
    assert waiting.command_delays.counters("command") == {
        "commands": 2,
        "command_us": pytest.approx(20_000),
        "longest_command_us": pytest.approx(15_000),
    }


def test_command_that_was_never_executed_has_no_delay() -> None:
    stopped, overruled = mux(), mux()
    stopped.request(Velocity(0.1, 0.0), 1.0, None)
    stopped.stop()
    stopped.next_velocity(1.02, None)
    overruled.request(Velocity(0.1, 0.0), 1.0, None, Source.TELEOP)
    overruled.next_velocity(1.02, None)
    overruled.request(Velocity(0.2, 0.0), 1.03, None)
    overruled.next_velocity(1.04, None)
    assert stopped.command_delays.counters("command")["commands"] == 0
    assert overruled.command_delays.counters("command")["commands"] == 1


def test_base_counts_report_gaps_and_command_delays() -> None:
    bench = Bench(VirtualKobuki())
    bench.drive(2.0, 0.1)
    counters = bench.base.health().counters
    assert counters["report_gap_us"] / counters["report_gaps"] == pytest.approx(20_000, rel=0.1)
    assert counters["longest_report_gap_us"] >= 19_000
    assert counters["commands"] > 50
    assert counters["longest_command_us"] <= 45_000


def test_disconnected_time_is_not_a_report_gap() -> None:
    bench = Bench(VirtualKobuki())
    bench.link.run(1.0)
    bench.clock.advance(60.0)
    bench.base.on_connected()
    bench.link.run(1.0)
    assert bench.base.health().counters["longest_report_gap_us"] < 100_000


def test_bus_counts_exchange_times_without_unanswered_ones() -> None:
    bus, _, _ = direct_bus(chain(1, paced=True))
    for _ in range(3):
        bus.read_block(ServoAddress(1), 36, 11)
    with pytest.raises(NoReply):
        bus.read_block(ServoAddress(9), 36, 11, tries=1)
    counters = bus.exchanges.counters("exchange")
    assert counters["exchanges"] == 3
    assert counters["exchange_us"] / 3 == pytest.approx(250 + 500, rel=0.01)  # 25 bytes, and the servo's delay
    assert counters["longest_exchange_us"] == pytest.approx(250 + 500, rel=0.01)
