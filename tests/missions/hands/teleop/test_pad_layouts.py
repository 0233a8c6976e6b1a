"""Game pads whose buttons are only numbered: known by their model, refused, or taught; no base moves on a wrong one."""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from errno import ENOSPC
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import DeviceStatus
from drivers.clock import ManualClock, SystemClock
from drivers.errors import DriverError, NotConnected
from missions.control.pilot import ENABLE_KEY, LATCH_KEY, DriveInput
from missions.plugins.teleop import layout as events
from missions.plugins.teleop import pad
from missions.plugins.teleop import pad as pad_store
from missions.plugins.teleop.hand_driving import PadDevice
from missions.plugins.teleop.layout import (
    D_MODE_LAYOUT,
    STANDARD_LAYOUT,
    AxisRange,
    Control,
    PadEvent,
    PadLayout,
    PadModel,
    Stick,
    find_layout,
)
from missions.plugins.teleop.pad import Pad, find_pad, find_pads, load_layouts, save_layout
from missions.plugins.teleop.teaching import ANSWER_TIMEOUT, MAX_TRIES, PadTeacher, TeachingError
from missions.plugins.testing.recorders import RecordedBase
from tests.missions.command import command
from tests.tries import tries
from tests.waiting import wait_until

NUMBERED = frozenset(range(0x120, 0x12C))
NAMED = frozenset({0x130, 0x131, 0x133, 0x134, 0x136, 0x137, 0x13A, 0x13B})
AXES = frozenset({0, 1, 2, 5, 0x10, 0x11})

F310 = PadModel(0x046D, 0xC216, "Logitech Logitech Dual Action", NUMBERED, AXES)
STRANGER = PadModel(0x0810, 0x0001, "Twin USB Joystick", NUMBERED, AXES)
XBOX = PadModel(0x045E, 0x028E, "Microsoft X-Box 360 pad", NAMED, AXES)
SPANS = {code: AxisRange(0, 255) for code in (0, 1, 2, 5)} | {code: AxisRange(-1, 1) for code in (0x10, 0x11)}


class InHand:
    """A pad of a model in a test's hands: a named pipe is its node."""

    def __init__(self, folder: Path, model: PadModel | None, layouts: Mapping[str, PadLayout] | None = None) -> None:
        self.path = folder / "event7"
        os.mkfifo(self.path)
        self._keep = os.open(self.path, os.O_RDWR | os.O_NONBLOCK)
        self.clock = ManualClock(100.0)
        self.pad = Pad(
            str(self.path), self.clock, read_range=lambda _, axis: SPANS.get(axis), read_model=lambda _: model,
            load_saved=lambda: layouts or {},
        )  # fmt: skip

    def do(self, *done: tuple[int, int, int]) -> list[str]:
        os.write(self._keep, b"".join(PadEvent(*each).pack() for each in done))
        return self.pad.read_keys()

    def push(self) -> DriveInput | None:
        return self.pad.push(self.clock.now())

    def close(self) -> None:
        self.pad.close()
        os.close(self._keep)


@pytest.fixture
def hand(tmp_path: Path) -> Iterator[Callable[..., InHand]]:
    made = list[InHand]()

    def make(model: PadModel | None, layouts: Mapping[str, PadLayout] | None = None) -> InHand:
        made.append(InHand(tmp_path, model, layouts))
        return made[-1]

    yield make
    for each in made:
        each.close()


def test_d_mode_pad_drives_by_left_shoulder_and_has_two_stop_buttons(
    hand: Callable[..., InHand],
) -> None:
    d_mode = hand(F310)
    d_mode.pad.open()
    assert d_mode.do((events.KEY, 0x124, 1), (events.ABS, 1, 0)) == []
    assert d_mode.push() == DriveInput(1.0, 0.0)
    d_mode.do((events.KEY, 0x124, 0))
    assert d_mode.push() is None
    for stop in (0x121, 0x122):
        assert d_mode.do((events.KEY, stop, 1), (events.KEY, stop, 0)) == [LATCH_KEY]
    assert d_mode.do((events.KEY, 0x129, 1), (events.ABS, 0x11, -1)) == [ENABLE_KEY, "up"]


@pytest.mark.parametrize(
    ("model", "why"),
    [
        (STRANGER, "its buttons are only numbered"),
        (replace(F310, buttons=frozenset(range(0x120, 0x124))), "its buttons are only numbered"),
        (replace(XBOX, buttons=NAMED | {0x132, 0x135}), "its buttons are only numbered"),
        (replace(XBOX, buttons=NAMED - {0x136}), "it has no left shoulder, east or Start button"),
        (replace(XBOX, buttons=NAMED - {0x131}), "it has no left shoulder, east or Start button"),
        (replace(XBOX, axes=frozenset({0x10, 0x11})), "or no left stick"),
        (replace(F310, axes=frozenset({0x10, 0x11})), "its buttons are only numbered"),
    ],
)
def test_unknown_pad_is_refused_with_a_teaching_hint(hand: Callable[..., InHand], model: PadModel, why: str) -> None:
    unknown = hand(model)
    with pytest.raises(NotConnected, match=why) as told:
        unknown.pad.open()
    assert model.key in str(told.value)
    assert told.value.hint.startswith(f"mission teleop --teach-pad {unknown.path}")
    assert unknown.pad._descriptor == -1
    assert unknown.push() is None


def test_refused_pad_beside_a_mission_is_reported_once_and_sends_nothing(
    hand: Callable[..., InHand],
) -> None:
    base, told, unknown = RecordedBase(ManualClock()), list[DeviceStatus](), hand(STRANGER)
    beside = PadDevice(base, lambda: unknown.pad, SystemClock(), report=told.append)
    beside.open()
    wait_until(lambda: "only numbered" in beside.health().detail)
    beside.close()
    assert [(each.kind, each.hint.split("  ")[0]) for each in told] == [
        ("offline", f"mission teleop --teach-pad {unknown.path}")
    ]
    assert base.commands == []


def test_a_node_of_which_nothing_is_known_stops_by_both_and_drives_by_named_buttons_alone(
    hand: Callable[..., InHand],
) -> None:
    node = hand(None)
    node.pad.open()
    assert node.do((events.KEY, 0x124, 1), (events.ABS, 1, 0)) == []
    assert node.push() is None
    assert node.do((events.KEY, 0x121, 1), (events.KEY, 0x131, 1)) == [LATCH_KEY, LATCH_KEY]


def test_models_have_layouts_and_a_taught_one_goes_first() -> None:
    mine = PadLayout(Control(0x126), (Control(0x120),), Control(0x127))
    assert find_layout("/x", XBOX, {}) == STANDARD_LAYOUT
    assert find_layout("/x", F310, {}) == D_MODE_LAYOUT
    assert find_layout("/x", F310, {F310.key: mine}) == mine
    wireless = replace(F310, product=0xC219, name="Logitech Cordless RumblePad 2")
    assert find_layout("/x", wireless, {F310.key: mine}) == D_MODE_LAYOUT
    assert find_layout("/x", STRANGER, {STRANGER.key: mine}) == mine
    with pytest.raises(NotConnected, match="only numbered"):
        find_layout("/x", replace(STRANGER, name="Another"), {STRANGER.key: mine})
    with pytest.raises(NotConnected, match="it lacks buttons or sticks of its taught layout"):
        find_layout("/x", replace(XBOX, buttons=NAMED), {XBOX.key: mine})


def test_d_mode_pads_are_found_after_pads_with_named_buttons(tmp_path: Path) -> None:
    for name, bits in {"event3": "fff00000000 0 0 0 0", "event5": "7cdb000000000000 0 0 0 0"}.items():
        (tmp_path / name / "device" / "capabilities").mkdir(parents=True)
        (tmp_path / name / "device" / "capabilities" / "key").write_text(bits)
    assert find_pads(tmp_path) == ["/dev/input/event5", "/dev/input/event3"]
    (tmp_path / "event5/device/capabilities/key").unlink()
    assert find_pad(tmp_path) == "/dev/input/event3"


@given(st.binary(min_size=1, max_size=96))
def test_kernel_capability_bits_are_parsed(bits: bytes) -> None:
    whole = int.from_bytes(bits, "little")
    assert events.parse_codes(bits) == {at for at in range(8 * len(bits)) if whole >> at & 1}


# --- teaching ---------------------------------------------------------------------------------------------------------

Step = list[tuple[int, int, int]]


def button(code: int) -> list[Step]:
    return [[(events.KEY, code, 1)], [(events.KEY, code, 0)]]


def axis(code: int, *values: int) -> list[Step]:
    return [[(events.ABS, code, value)] for value in values]


STOP, AGAIN, ENABLES, HOLDS, AHEAD, LEFT = (
    "press the button that should STOP", "press the STOP button again", "press the button that ENABLES",
    "press the button that you will HOLD", "push the drive stick straight AHEAD", "push it straight to the LEFT",
)  # fmt: skip
DRY = ("hold HOLD and push AHEAD", "still holding, push to the LEFT", "release HOLD", "press STOP", "press ENABLE")


class Person:
    """Answers each question by steps of events, one at each look; the last answer to a question is used again.

    What is asked for and has no answer is nothing: the person waits.
    """

    def __init__(self, answers: Mapping[str, list[list[Step]]], values: Mapping[int, int] | None = None) -> None:
        self.clock = ManualClock()
        self.answers = {question: list(each) for question, each in answers.items()}
        self.said: list[str] = []
        self._steps: list[Step] = []
        self._asked = ""
        self.gone = ""
        self.noise: Step = []
        self.values = dict.fromkeys((0, 1, 5), 128) if values is None else values

    def say(self, text: str) -> None:
        self.said.append(text)
        if text.startswith("  "):
            return
        self._asked = next((each for each in (*self.answers, *DRY, LEFT) if text.startswith(each)), "")
        given = self.answers.get(self._asked, [])
        if given:
            self._steps = [*(given.pop(0) if len(given) > 1 else given[0])]
        if self.gone and text.startswith(self.gone):
            raise NotConnected("pad: /dev/input/event7: disconnected")

    def read_events(self) -> list[PadEvent]:
        step = self._steps.pop(0) if self._steps else []
        return [PadEvent(*each) for each in (*self.noise, *step)]

    def teach(self, spans: Mapping[int, AxisRange] = SPANS) -> PadLayout:
        return PadTeacher(self, spans, self.values, self.clock, self.say, self.clock.advance).teach()


def person(**changed: list[list[Step]]) -> Person:
    """Return somebody who teaches a pad by the buttons 0x122, 0x129 and 0x124, and the left stick."""
    words = {"stop": STOP, "again": AGAIN, "enable": ENABLES, "hold": HOLDS, "ahead": AHEAD, "left": LEFT}
    words |= dict(zip(("dry_ahead", "dry_left", "dry_let_go", "dry_stop", "dry_enable"), DRY, strict=True))
    answers: dict[str, list[list[Step]]] = {
        STOP: [button(0x122)], AGAIN: [button(0x122)], ENABLES: [button(0x129)], HOLDS: [button(0x124)],
        AHEAD: [axis(1, 60, 0, 0, 90, 128)], LEFT: [axis(0, 40, 0, 128)],
        DRY[0]: [[[(events.KEY, 0x124, 1)], *axis(1, 0)]], DRY[1]: [axis(1, 128) + axis(0, 0)],
        DRY[2]: [[[(events.KEY, 0x124, 0)]]], DRY[3]: [button(0x122)], DRY[4]: [button(0x129)],
    }  # fmt: skip
    return Person(answers | {words[word]: given for word, given in changed.items()})


TAUGHT = PadLayout(Control(0x124), (Control(0x122),), Control(0x129), Stick(1, -1, 128), Stick(0, -1, 128))


def test_taught_pad_drives_with_its_stored_layout(hand: Callable[..., InHand], tmp_path: Path) -> None:
    layout = person().teach()
    assert layout == TAUGHT
    path = save_layout(STRANGER.key, layout, tmp_path / "mine" / "pads.json")
    assert path.stat().st_mode & 0o777 == 0o600
    mine = hand(STRANGER, load_layouts(path))
    mine.pad.open()
    mine.do((events.KEY, 0x124, 1), (events.ABS, 0, 0))
    assert mine.push() == DriveInput(0.0, 1.0)
    assert mine.do((events.KEY, 0x122, 1)) == [LATCH_KEY]
    assert mine.do((events.KEY, 0x121, 1)) == []


def test_teaching_accepts_triggers_hats_and_off_centre_sticks(hand: Callable[..., InHand]) -> None:
    trigger = axis(2, 90, 255, 255, 30, 0)
    mine = person(
        stop=[axis(0x11, 1, 0)], again=[axis(0x11, 1, 0)], hold=[trigger],
        ahead=[axis(5, 200, 255, 160)], left=[axis(0, 128, 255, 128)],
        dry_ahead=[axis(2, 255) + axis(5, 255)], dry_left=[axis(5, 160) + axis(0, 255)],
        dry_let_go=[axis(2, 0)], dry_stop=[axis(0x11, 1, 0)],
    )  # fmt: skip
    mine.values = {0: 128, 1: 128, 5: 160, 2: 0, 0x10: 0, 0x11: 0}
    mine.noise = [(events.ABS, 1, 126), (events.ABS, 1, 131)]  # a stick that trembles
    layout = mine.teach()
    assert layout == PadLayout(
        Control(2, 0, 255), (Control(0x11, 0, 1),), Control(0x129), Stick(5, 1, 160), Stick(0, 1, 128)
    )
    pad_of = hand(STRANGER, {STRANGER.key: layout})
    pad_of.pad.open()
    pad_of.do((events.ABS, 2, 255), (events.ABS, 5, 160))
    assert pad_of.push() == DriveInput(0.0, 0.0)
    pad_of.do((events.ABS, 5, 255), (events.ABS, 0, 0))
    assert pad_of.push() == DriveInput(1.0, -1.0)
    pad_of.do((events.ABS, 5, 0), (events.ABS, 2, 150))  # half let go: it holds until 40 %
    assert pad_of.push() == DriveInput(-1.0, -1.0)
    pad_of.do((events.ABS, 2, 90))
    assert pad_of.push() is None
    assert pad_of.do((events.ABS, 0x11, -1), (events.ABS, 0x11, 1)) == ["up", LATCH_KEY]


@pytest.mark.parametrize(
    ("spans", "first", "values"),
    [
        ({2: AxisRange(0, 255)}, 0, (255, 0)),  # one that knows two values
        ({2: AxisRange(-127, 127)}, 0, (127, -127)),  # of which the kernel knows nothing before its first report
        ({2: AxisRange(0, 1023)}, 0, (300, 1023, 0)),
        ({2: AxisRange(0, 255)}, 255, (0, 255)),  # turned round
    ],
)
def test_teaching_recognises_a_trigger_by_its_rest_position(
    spans: dict[int, AxisRange], first: int, values: tuple[int, ...]
) -> None:
    pressed = axis(2, *values)
    mine = person(hold=[pressed], dry_ahead=[axis(2, values[-2]) + axis(1, 0)], dry_let_go=[axis(2, values[-1])])
    mine.values = {**mine.values, 2: first}
    assert mine.teach(SPANS | spans).hold == Control(2, values[-1], values[-2])


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"enable": [button(0x122), button(0x129)]}, "  that is STOP already; press another one"),
        ({"hold": [button(0x129), button(0x124)]}, "  that is ENABLE already; press another one"),
        ({"hold": [axis(0, 0, 128), button(0x124)]}, "  a stick, not a button"),
        (
            {"stop": [[[(1, 0x122, 1), (1, 0x121, 1)], [(1, 0x122, 0), (1, 0x121, 0)]], button(0x122)]},
            "  two buttons at once; press only one",
        ),
        ({"again": [button(0x123), button(0x122)]}, "  that is button 0x123; it was button 0x122"),
        ({"ahead": [button(0x120), axis(1, 0, 128)]}, "  a button, not a stick"),
        ({"ahead": [axis(1, 0, 128) + axis(0, 10, 128), axis(1, 0, 128)]}, "  not straight; push it straight"),
        ({"ahead": [axis(2, 255, 0), axis(1, 0, 128)]}, "  it moves one way only, like a trigger; push a stick"),
        ({"left": [axis(1, 0, 128), axis(0, 0, 128)]}, "  the same axis as ahead; push it to the left"),
        ({"dry_stop": [[*button(0x123), *button(0x122)]]}, "  that is another button"),
        ({"dry_stop": [[*button(0x129), *button(0x122)]]}, "  that is ENABLE"),
    ],
)
def test_wrong_press_is_named_and_requested_again(changed: dict[str, list[list[Step]]], said: str) -> None:
    mine = person(**changed)
    assert mine.teach() == TAUGHT
    assert said in mine.said


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"hold": []}, rf"nothing was pressed for {ANSWER_TIMEOUT:g} s"),
        ({"hold": [[[(1, 0x124, 1)]]]}, "a button stays pressed"),
        ({"ahead": [axis(1, 0)]}, "a stick is not released"),
        ({"enable": [button(0x122)]}, "too many wrong answers"),
        ({"again": [button(0x123)]}, "the STOP button was not found again"),
        ({"ahead": [[[(0, 3, 0)]]]}, "events were lost"),
        ({"dry_ahead": [[[(1, 0x124, 1)], *axis(1, 255)]]}, "the dry run failed at: hold HOLD and push AHEAD"),
        ({"dry_let_go": []}, "the dry run failed at: release HOLD"),
        ({"dry_stop": [button(0x123) * MAX_TRIES]}, "the dry run failed at: press STOP"),
    ],
)
def test_failed_teaching_returns_no_layout(changed: dict[str, list[list[Step]]], why: str) -> None:
    with pytest.raises(TeachingError, match=why):
        person(**changed).teach()


@pytest.mark.parametrize("question", [STOP, AGAIN, ENABLES, HOLDS, AHEAD, LEFT, *DRY])
def test_pad_unplugged_during_teaching_is_reported(question: str) -> None:
    mine = person()
    mine.gone = question
    with pytest.raises(NotConnected, match="disconnected"):
        mine.teach()


# --- the file ---------------------------------------------------------------------------------------------------------


def test_layouts_of_several_pads_are_stored_together(tmp_path: Path) -> None:
    file = tmp_path / "pads.json"
    other = PadLayout(Control(2, 0, 255), (Control(0x11, 0, 1),), Control(0x129), Stick(5, 1, 160), Stick(0, 1))
    assert load_layouts(file) == {}
    save_layout("0810:0001 Twin", TAUGHT, file)
    save_layout("0810:0001 Other", other, file)
    save_layout("0810:0001 Twin", replace(TAUGHT, enable=Control(0x128)), file)
    assert load_layouts(file) == {"0810:0001 Twin": replace(TAUGHT, enable=Control(0x128)), "0810:0001 Other": other}


def damaged() -> Iterator[object]:
    """Yield what is no layout."""
    good = {
        "hold": {"button": 1}, "stops": [{"button": 2}], "enable": {"button": 3},
        "ahead": {"axis": 1, "sign": -1, "rest": None}, "left": {"axis": 0, "sign": -1, "rest": None},
    }  # fmt: skip
    for key, value in {
        "hold": {"button": 2}, "stops": [], "enable": {"button": "3"}, "ahead": {"axis": 0, "sign": -1, "rest": None},
        "left": {"axis": 0, "sign": 0, "rest": None},
    }.items():  # fmt: skip
        yield {"x": {**good, key: value}}
    yield {"x": {**good, "hold": {"axis": 2, "rest": 5, "end": 5}}}
    yield {"x": {**good, "hold": {"axis": 1, "rest": 0, "end": 5}}}
    yield {"x": {**good, "hold": {"button": True}}}
    yield {"x": {key: value for key, value in good.items() if key != "stops"}}
    yield [1]
    yield {"x": None}


@pytest.mark.parametrize("content", [json.dumps(each) for each in damaged()] + ["", "{", "[" * 9999, "\udcff"])
def test_a_damaged_file_is_refused_and_drives_nothing(tmp_path: Path, content: str) -> None:
    file = tmp_path / "pads.json"
    file.write_bytes(content.encode(errors="surrogateescape"))
    with pytest.raises(NotConnected, match=r"pads\.json: cannot be used") as told:
        load_layouts(file)
    assert f"rm {file}" in told.value.hint


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture
def at_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path


def test_teach_pad_command_stores_the_layout(
    at_home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = person()
    node = at_home / "event7"
    node.write_bytes(b"")
    monkeypatch.setattr("missions.plugins.teleop.command.SystemClock", lambda: mine.clock)
    monkeypatch.setattr("missions.plugins.teleop.command._pause", mine.clock.advance)
    monkeypatch.setattr("missions.plugins.teleop.command.click.echo", mine.say)
    monkeypatch.setattr(pad, "read_pad_model", lambda _: STRANGER)
    monkeypatch.setattr(Pad, "read_axes", lambda *_: (SPANS, mine.values))
    monkeypatch.setattr(Pad, "read_events", lambda _: mine.read_events())
    assert command(capsys, "teleop", "--teach-pad", str(node)).code == 0
    assert load_layouts() == {STRANGER.key: TAUGHT}
    assert str(pad_store.pads_file()) in mine.said[-1]


def test_teach_pad_command_refuses_ambiguous_or_unknown_pads(
    at_home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(pad, "find_pads", lambda *_: ["/dev/input/event7", "/dev/input/event9"])
    told = command(capsys, "teleop", "--teach-pad")
    assert told.code == 2
    assert "several game pads are plugged in" in told.err
    assert "mission teleop --teach-pad /dev/input/event7  (or /dev/input/event9)" in told.err
    node = at_home / "event7"
    node.write_bytes(b"")
    told = command(capsys, "teleop", "--teach-pad", str(node))
    assert "the kernel does not know the model of this pad" in told.err
    assert not pad_store.pads_file().exists()


@pytest.mark.parametrize(("content", "words"), [("{", "cannot be used"), ("{}", "No space left")])
def test_teaching_is_refused_if_the_layout_cannot_be_stored(
    at_home: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    content: str,
    words: str,
) -> None:
    def full(_: int) -> None:
        raise OSError(ENOSPC, "No space left on device")

    file = pad_store.pads_file()
    file.parent.mkdir(parents=True)
    file.write_text(content)
    monkeypatch.setattr("missions.cli.outputs.os.fsync", full)
    monkeypatch.setattr(pad, "read_pad_model", lambda _: pytest.fail("the pad was opened"))
    node = at_home / "event7"
    node.write_bytes(b"")
    told = command(capsys, "teleop", "--teach-pad", str(node))
    assert told.code != 0
    assert str(file) in told.err
    assert words in told.err


def test_an_error_of_teaching_is_one_of_a_device() -> None:
    assert issubclass(TeachingError, DriverError)


# --- any pad ----------------------------------------------------------------------------------------------------------


def strange_pad(chance: Random) -> tuple[dict[int, AxisRange], dict[int, int], PadLayout]:
    """Return a pad that chance has made: what its axes measure, where they are, and its layout."""
    codes = chance.sample([0, 1, 2, 3, 4, 5, 9, 10], 6)
    spans, values = dict[int, AxisRange](), dict[int, int]()
    sticks, triggers = codes[:2], codes[2:]
    for code in codes:
        low, high = chance.choice([(0, 255), (-32768, 32767), (0, 1023), (-127, 127)])
        spans[code] = AxisRange(low, high)
    made = list[Stick]()
    for code in sticks:
        span = spans[code]
        rest = round((span.least + span.most) / 2 + chance.uniform(-0.2, 0.2) * (span.most - span.least))
        values[code] = rest
        made.append(Stick(code, chance.choice([-1, 1]), rest))
    controls = list[Control]()
    buttons = chance.sample(range(0x120, 0x140), 3)
    for code in buttons:
        trigger = triggers.pop() if chance.random() < 0.4 else None
        if trigger is None:
            controls.append(Control(code))
            continue
        ends = [spans[trigger].least, spans[trigger].most]
        chance.shuffle(ends)
        values[trigger] = chance.choice([ends[0], 0])  # before its first report the kernel says 0
        controls.append(Control(trigger, *ends))
    return spans, values, PadLayout(controls[0], (controls[1],), controls[2], made[0], made[1])


def moved(control: Control, *, down: bool) -> list[Step]:
    """Press a control, slowly where it is a trigger, or let it go."""
    if control.rest is None:
        return [[(events.KEY, control.code, int(down))]]
    ways = [control.rest + (control.end - control.rest) * share // 4 for share in (1, 2, 3, 4)]
    return axis(control.code, *(ways if down else [*ways[2::-1], control.rest]))


def press(control: Control) -> list[Step]:
    return moved(control, down=True) + moved(control, down=False)


def pushed(stick: Stick, span: AxisRange) -> tuple[list[Step], list[Step]]:
    """Push a stick to its end, and let it go."""
    end, rest = span.most if stick.sign > 0 else span.least, stick.rest or 0
    return axis(stick.code, (rest + end) // 2, end), axis(stick.code, (rest + end) // 2, rest)


def test_teaching_recovers_the_layout_of_random_pads() -> None:
    for seed in range(tries(30, most=2000)):
        spans, values, layout = strange_pad(Random(seed))  # noqa: S311 - no secret
        (stop,) = layout.stops
        (out, back), (left, left_back) = (pushed(each, spans[each.code]) for each in (layout.ahead, layout.left))
        mine = person(
            stop=[press(stop)], again=[press(stop)], enable=[press(layout.enable)], hold=[press(layout.hold)],
            ahead=[out + back], left=[left + left_back], dry_ahead=[moved(layout.hold, down=True) + out],
            dry_left=[back + left], dry_let_go=[left_back + moved(layout.hold, down=False)],
            dry_stop=[press(stop)], dry_enable=[press(layout.enable)],
        )  # fmt: skip
        mine.values = values
        assert mine.teach(spans) == layout, seed
