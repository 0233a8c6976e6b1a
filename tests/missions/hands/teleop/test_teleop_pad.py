"""A game pad, at the level of the kernel's events: bytes as of ``struct input_event`` in, pushes and keys out."""

import os
from collections.abc import Iterator
from math import inf
from pathlib import Path
from struct import calcsize

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import ManualClock
from drivers.errors import NotConnected
from missions.control.pilot import ENABLE_KEY, LATCH_KEY, DriveInput, Pilot
from missions.plugins.teleop import layout, pad
from missions.plugins.teleop.hand_driving import drive_by_hand
from missions.plugins.teleop.layout import AxisRange, PadEvent, parse_events, parse_range, range_request
from missions.plugins.teleop.pad import DEAD_ZONE, SILENCE_TIMEOUT, Pad, find_pad
from missions.plugins.testing.recorders import RecordedBase

TIME = bytes(2 * calcsize("l"))

GOLDEN = [
    ("03 00 01 00 00 80 FF FF", PadEvent(layout.ABS, layout.STICK_Y, -32768)),
    ("03 00 00 00 FF 7F 00 00", PadEvent(layout.ABS, layout.STICK_X, 32767)),
    ("03 00 10 00 FF FF FF FF", PadEvent(layout.ABS, layout.HAT_X, -1)),
    ("01 00 36 01 01 00 00 00", PadEvent(layout.KEY, layout.SHOULDER_LEFT, 1)),
    ("01 00 31 01 01 00 00 00", PadEvent(layout.KEY, layout.EAST, 1)),
    ("01 00 3B 01 00 00 00 00", PadEvent(layout.KEY, layout.START, 0)),
    ("00 00 00 00 00 00 00 00", PadEvent(layout.SYN, 0, 0)),
    ("00 00 03 00 00 00 00 00", PadEvent(layout.SYN, layout.SYN_DROPPED, 0)),
]

HOLD, LET_GO = (PadEvent(layout.KEY, layout.SHOULDER_LEFT, value) for value in (1, 0))
AHEAD = PadEvent(layout.ABS, layout.STICK_Y, -32768)
RIGHT = PadEvent(layout.ABS, layout.STICK_X, 32767)


class Held:
    """A pad in a test's hands: a named pipe is its node."""

    def __init__(self, path: Path) -> None:
        os.mkfifo(path)
        self.clock = ManualClock(100.0)
        self.pad = Pad(str(path), self.clock, read_range=lambda *_: AxisRange(-32768, 32767))
        self.pad.open()
        self._hand = os.open(path, os.O_WRONLY)

    def do(self, *done: PadEvent) -> list[str]:
        """Do this, and return the keys that the pad makes of it."""
        os.write(self._hand, b"".join(event.pack() for event in done))
        return self.pad.read_keys()

    def push(self) -> DriveInput | None:
        return self.pad.push(self.clock.now())

    def unplug(self) -> None:
        if self._hand >= 0:
            os.close(self._hand)
            self._hand = -1


@pytest.fixture
def held(tmp_path: Path) -> Iterator[Held]:
    found = Held(tmp_path / "event7")
    yield found
    found.unplug()
    found.pad.close()
    found.pad.close()


@pytest.mark.parametrize(("raw", "event"), GOLDEN)
def test_an_event_is_the_bytes_of_the_kernel_in_both_directions(raw: str, event: PadEvent) -> None:
    assert parse_events(TIME + bytes.fromhex(raw)) == [event]
    assert event.pack() == TIME + bytes.fromhex(raw)


@given(st.binary(max_size=200))
def test_any_bytes_are_events_or_none(data: bytes) -> None:
    assert len(parse_events(data)) == len(data) // (len(TIME) + 8)


def test_axis_range_is_requested_by_axis_number() -> None:
    assert [range_request(axis) for axis in (0, 1)] == [0x80184540, 0x80184541]
    info = b"".join(number.to_bytes(4, "little") for number in (128, 0, 255, 0, 15, 0))
    assert parse_range(info) == AxisRange(0, 255)
    assert AxisRange(0, 255).scale(255) == 1.0
    assert AxisRange(0, 0).scale(0) == 0.0


@given(st.integers(-40000, 40000), st.integers(-40000, 40000))
def test_stick_scale_is_monotonic_and_bounded(one: int, other: int) -> None:
    span = AxisRange(-32768, 32767)
    low, high = (span.scale(value, DEAD_ZONE) for value in sorted((one, other)))
    assert -1.0 <= low <= high <= 1.0


def test_the_stick_drives_only_while_the_shoulder_button_is_held(held: Held) -> None:
    held.do(AHEAD, RIGHT)
    assert held.push() is None
    held.do(HOLD)
    assert held.push() == DriveInput(ahead=1.0, left=-1.0)
    held.do(LET_GO)
    assert held.push() is None


def test_stick_has_a_dead_zone_and_fine_control_for_small_pushes(held: Held) -> None:
    held.do(HOLD, PadEvent(layout.ABS, layout.STICK_Y, 3000))
    assert held.push() == DriveInput(0.0, 0.0)
    held.do(PadEvent(layout.ABS, layout.STICK_Y, -18000))
    push = held.push()
    assert push is not None
    assert 0.2 < push.ahead < 0.3


def test_silent_pad_is_released_until_held_again(held: Held) -> None:
    held.do(HOLD, AHEAD)
    held.clock.advance(SILENCE_TIMEOUT)
    assert held.push() == DriveInput(1.0, 0.0)
    held.clock.advance(0.01)
    assert held.push() is None
    held.do(AHEAD)
    assert held.push() is None
    held.do(HOLD)
    assert held.push() == DriveInput(1.0, 0.0)


def test_dropped_events_release_the_pad(held: Held) -> None:
    held.do(HOLD, AHEAD, PadEvent(layout.SYN, layout.SYN_DROPPED, 0))
    assert held.push() is None


def test_buttons_and_the_cross_are_keys(held: Held) -> None:
    cross = [(layout.HAT_X, -1), (layout.HAT_X, 0), (layout.HAT_X, 1), (layout.HAT_Y, -1), (layout.HAT_Y, 1)]
    assert held.do(*(PadEvent(layout.ABS, *where) for where in cross)) == ["left", "right", "up", "down"]
    pressed = [PadEvent(layout.KEY, button, value) for button in (layout.EAST, layout.START, 0x120) for value in (1, 0)]
    assert held.do(*pressed) == [LATCH_KEY, ENABLE_KEY]


def test_latch_and_enable_require_the_hold_button_again(held: Held) -> None:
    for key in (LATCH_KEY, ENABLE_KEY):
        held.do(HOLD, AHEAD)
        held.pad.press("q", 0.0)
        assert held.push() is not None
        held.pad.press(key, 0.0)
        assert held.push() is None


def test_unplugged_pad_stops_the_base(held: Held) -> None:
    base = RecordedBase(held.clock)
    held.do(HOLD, AHEAD)
    ticks = iter(range(9))

    def typed(seconds: float) -> str:
        held.clock.advance(seconds)
        if next(ticks) == 3:
            held.unplug()
        return ""

    with pytest.raises(NotConnected, match=r"event7: disconnected"):
        drive_by_hand(Pilot(base), typed, held.pad, held.clock, lambda _: None)
    assert len(base.commands) == 3 + 2
    assert base.commands[-2] == "stop"


def test_missing_pad_device_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NotConnected, match="no such device"):
        Pad(str(tmp_path / "event9"), ManualClock()).open()


def test_plain_file_as_pad_drives_nothing(tmp_path: Path) -> None:
    file = tmp_path / "event1"
    file.write_bytes(HOLD.pack() + AHEAD.pack())
    plain = Pad(str(file), ManualClock(inf))
    plain.open()
    try:
        with pytest.raises(NotConnected):
            plain.read_keys()
        assert plain.push(0.0) is None
    finally:
        plain.close()


def test_the_first_game_pad_is_found_among_keyboards_and_mice(tmp_path: Path) -> None:
    keys = {
        "event0": "402000000 3803078f800d001 feffffdfffefffff fffffffffffffffe",  # a keyboard
        "event1": "1f0000 0 0 0 0",  # a mouse: words up to the buttons 0x110 to 0x114
        "event2": "0",
        "event10": "7cdb000000000000 0 0 0 0",  # a pad
        "event11": "7cdb000000000000 0 0 0 0",
    }
    for name, bits in keys.items():
        folder = tmp_path / name / "device" / "capabilities"
        folder.mkdir(parents=True)
        (folder / "key").write_text(bits + "\n", encoding="ascii")
    (tmp_path / "event3").mkdir()  # one without any
    assert find_pad(tmp_path) == "/dev/input/event10"
    with pytest.raises(NotConnected, match="no game pad"):
        find_pad(tmp_path / "event10")


def test_pad_help_names_the_buttons() -> None:
    assert all(word in pad.PAD_HELP for word in ("left shoulder", "left stick", "cross", "east", "Start"))
