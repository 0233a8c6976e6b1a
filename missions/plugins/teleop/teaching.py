"""Teaching of a game pad's layout: a person presses one control after another, then tries them in a dry run.

    stop -> stop again -> enable -> hold -> ahead -> left -> dry run -> layout

No robot is open meanwhile. A wrong press is reported, and the question is repeated.
"""

from collections.abc import Callable, Mapping
from typing import Protocol

from drivers.api.fast_dataclass import dataclass
from drivers.clock import Clock
from drivers.errors import DriverError
from missions.control.pilot import ENABLE_KEY, LATCH_KEY
from missions.plugins.teleop import layout as events
from missions.plugins.teleop.layout import PRESS_SHARE, AxisRange, Control, PadEvent, PadLayout, PadState, Stick

ANSWER_TIMEOUT = 30.0
"""Seconds within which a control must be pressed and released."""

RELEASE_TIME = 0.3
"""Seconds without a press or a large movement after which all controls count as released."""

MAX_TRIES = 5
"""Wrong answers to one question after which the teaching of a pad's layout ends with an error."""

MAX_AXIS_NOISE = 0.1
"""Largest noise of an axis at rest, as a share of its range."""

MAX_TRIGGER_REST = 0.2
"""Largest distance of a trigger's rest position from an end of its range, as a share of the range.

An axis that rests farther from both ends is a stick.
"""

MIN_STICK_SHARE = 0.25
"""Smallest movement of a stick, as a share of its range; from the middle to an end is 0.5."""

POLL_INTERVAL = 0.02
"""Seconds between two reads of the pad."""

DRY_RUN_DEAD_ZONE = 0.15
"""Dead zone of a stick in the dry run, as a share of its travel."""

HAT_AXES = range(0x10, 0x18)
"""Axes of hats (direction pads), which rest in the middle like sticks, but count as buttons."""


class TeachingError(DriverError):
    """The teaching of a game pad's button layout ended without a result."""


class PadEventSource(Protocol):
    """Source of a game pad's button and axis events, such as a ``Pad``."""

    def read_events(self) -> list[PadEvent]:
        """Return the events so far, without waiting. Raises NotConnected if the pad has disconnected."""
        ...


@dataclass(frozen=True, slots=True)
class Movement:
    """Controls that a person has used between two moments without motion: pressed ``buttons``, and moved ``axes``."""

    buttons: tuple[int, ...]
    axes: Mapping[int, tuple[int, int, float]]  # rest, farthest value, share of the span between them


class PadTeacher:
    """Teaches a layout by questions through ``say`` and events of ``pad``.

    ``ranges`` and ``values`` are the ranges and initial values of the pad's axes. ``pause`` waits some seconds, and
    raises an exception if the person cancels the teaching.
    """

    def __init__(
        self,
        pad: PadEventSource,
        ranges: Mapping[int, AxisRange],
        values: Mapping[int, int],
        clock: Clock,
        say: Callable[[str], None],
        pause: Callable[[float], object],
    ) -> None:
        self._pad, self._clock, self._say, self._pause = pad, clock, say, pause
        self._ranges = {code: span for code, span in ranges.items() if span.most > span.least}
        # Before its first report the kernel takes an axis to be at 0, which is then its least value.
        self._values = {
            code: at for code, at in values.items() if code in self._ranges and at > self._ranges[code].least
        }

    def teach(self) -> PadLayout:
        """Return the taught and tested layout. Raises TeachingError, and NotConnected if the pad disconnects."""
        stop = self._ask_control("press the button that should STOP the robot", {})
        self._confirm("press the STOP button again", stop)
        enable = self._ask_control("press the button that ENABLES it again after a stop", {stop: "STOP"})
        taken = {stop: "STOP", enable: "ENABLE"}
        hold = self._ask_control("press the button that you will HOLD while you drive", taken)
        ahead = self._ask_stick("push the drive stick straight AHEAD, and release it", ())
        left = self._ask_stick("push it straight to the LEFT, and release it", (ahead.code,))
        layout = PadLayout(hold, (stop,), enable, ahead, left)
        for fault in layout.find_errors():
            raise TeachingError(f"pad: {fault}", hint="start again, with other buttons")
        self._dry_run(layout)
        return layout

    # --- questions ----------------------------------------------------------------------------------------------------

    def _ask_control(self, question: str, taken: Mapping[Control, str]) -> Control:
        for _ in range(MAX_TRIES):
            self._say(question)
            found = self._control_of(self._movement())
            if isinstance(found, str):
                self._say(f"  {found}")
            elif (role := _role(found, taken)) is not None:
                self._say(f"  that is {role} already; press another one")
            else:
                self._say(f"  {describe_control(found)}")
                return found
        raise TeachingError("pad: too many wrong answers; nothing was saved", hint="mission teleop --teach-pad")

    def _confirm(self, question: str, wanted: Control) -> None:
        for _ in range(MAX_TRIES):
            self._say(question)
            found = self._control_of(self._movement())
            if isinstance(found, Control) and _role(found, {wanted: ""}) is not None:
                return
            seen = found if isinstance(found, str) else f"that is {describe_control(found)}"
            self._say(f"  {seen}; it was {describe_control(wanted)}")
        raise TeachingError(
            "pad: the STOP button was not found again; nothing was saved",
            hint="start again: mission teleop --teach-pad",
        )

    def _ask_stick(self, question: str, taken: tuple[int, ...]) -> Stick:
        for _ in range(MAX_TRIES):
            self._say(question)
            found = self._stick_of(self._movement(), taken)
            if isinstance(found, Stick):
                self._say(f"  axis {found.code}")
                return found
            self._say(f"  {found}")
        raise TeachingError("pad: too many wrong answers; nothing was saved", hint="mission teleop --teach-pad")

    def _control_of(self, moved: Movement) -> Control | str:
        """Return the control that was pressed, or an error text."""
        if len(moved.buttons) > 1:
            return "two buttons at once; press only one"
        if moved.buttons:  # a trigger may be a button and an axis
            return Control(moved.buttons[0])
        wide = {
            code: it
            for code, it in moved.axes.items()
            if it[2] >= (PRESS_SHARE if code not in HAT_AXES else MIN_STICK_SHARE)
        }
        if len(wide) != 1:
            return "a stick, not a button" if moved.axes else "an unknown control"
        ((code, (rest, end, _)),) = wide.items()
        span = self._ranges[code]
        if code not in HAT_AXES and min(rest - span.least, span.most - rest) > MAX_TRIGGER_REST * (
            span.most - span.least
        ):
            return "a stick, not a button"
        return Control(code, rest, end)

    def _stick_of(self, moved: Movement, taken: tuple[int, ...]) -> Stick | str:
        """Return the axis of the stick that was pushed, or an error text; the axes ``taken`` are already in use."""
        if moved.buttons:
            return "a button, not a stick"
        ranked = sorted(moved.axes.items(), key=lambda each: -each[1][2])
        if not ranked or ranked[0][1][2] < MIN_STICK_SHARE:
            return "hardly moved; push it all the way"
        if len(ranked) > 1 and ranked[1][1][2] > 0.7 * ranked[0][1][2]:
            return "not straight; push it straight"
        code, (rest, end, _) = ranked[0]
        span = self._ranges[code]
        if code in taken:
            return "the same axis as ahead; push it to the left"
        if code not in HAT_AXES and min(rest - span.least, span.most - rest) <= MAX_TRIGGER_REST * (
            span.most - span.least
        ):
            return "it moves one way only, like a trigger; push a stick"
        return Stick(code, 1 if end > rest else -1, rest)

    # --- listening ----------------------------------------------------------------------------------------------------

    def _movement(self) -> Movement:
        """Wait until a control was pressed or moved, and released; return the changes.

        Raises TeachingError after ``ANSWER_TIMEOUT``.
        """
        begun = quiet_since = self._clock.now()
        down, pressed = set[int](), list[int]()
        seen = {code: [value] for code, value in self._values.items()}
        settled = dict(self._values)
        while True:
            for event in self._pad.read_events():
                if (event.kind, event.code) == (events.SYN, events.SYN_DROPPED):
                    raise TeachingError(
                        "pad: events were lost; nothing was saved", hint="start again: mission teleop --teach-pad"
                    )
                if event.kind == events.KEY and event.value == 1:
                    down.add(event.code)
                    pressed += [event.code] * (event.code not in pressed)
                elif event.kind == events.KEY and event.value == 0:
                    down.discard(event.code)
                elif event.kind == events.ABS and event.code in self._ranges:
                    seen.setdefault(event.code, []).append(event.value)
                    self._values[event.code] = event.value
                    if self._share(event.code, event.value, settled.get(event.code, event.value)) <= MAX_AXIS_NOISE:
                        continue
                    settled[event.code] = event.value
                else:
                    continue
                quiet_since = self._clock.now()
            now = self._clock.now()
            moved = [code for code, values in seen.items() if self._travel(code, values)[2] >= MIN_STICK_SHARE]
            back = all(self._is_released(code, seen[code]) for code in moved)
            if (pressed or moved) and not down and back and now - quiet_since >= RELEASE_TIME:
                return Movement(tuple(pressed), {code: self._travel(code, values) for code, values in seen.items()})
            if now - begun > ANSWER_TIMEOUT:
                why = (
                    "a button stays pressed" if down else "a stick is not released" if moved else "nothing was pressed"
                )
                raise TeachingError(
                    f"pad: {why} for {ANSWER_TIMEOUT:g} s; nothing was saved",
                    hint="start again: mission teleop --teach-pad",
                )
            self._pause(POLL_INTERVAL)

    def _share(self, code: int, value: int, other: int) -> float:
        span = self._ranges[code]
        return abs(value - other) / (span.most - span.least)

    def _is_released(self, code: int, values: list[int]) -> bool:
        """Return whether an axis is back at its first value, or at an end of its range after a movement over all of it.

        The second case is a trigger: until it first moves, some pads report a wrong rest position.
        """
        span = self._ranges[code]
        whole = self._share(code, max(values), min(values)) >= 1 - MAX_AXIS_NOISE
        at_end = min(self._share(code, values[-1], end) for end in (span.least, span.most)) <= MAX_AXIS_NOISE
        return self._share(code, values[-1], values[0]) <= MAX_AXIS_NOISE or (whole and at_end)

    def _travel(self, code: int, values: list[int]) -> tuple[int, int, float]:
        rest = values[-1]
        end = max(values, key=lambda value: abs(value - rest))
        return rest, end, self._share(code, end, rest)

    # --- the dry run --------------------------------------------------------------------------------------------------

    def _dry_run(self, layout: PadLayout) -> None:
        """Let the person try each control without a robot. Raises TeachingError after too many wrong controls."""
        state = PadState(layout, self._ranges, DRY_RUN_DEAD_ZONE)
        self._say("now a dry run: nothing moves")
        self._wait_for(state, "hold HOLD and push AHEAD", lambda _: _is_pushed(state, layout.ahead, layout.left))
        self._wait_for(state, "still holding, push to the LEFT", lambda _: _is_pushed(state, layout.left, layout.ahead))
        self._wait_for(state, "release HOLD", lambda _: not state.is_held)
        self._wait_for(state, "press STOP", lambda key: key == LATCH_KEY)
        self._wait_for(state, "press ENABLE", lambda key: key == ENABLE_KEY)

    def _wait_for(self, state: PadState, question: str, condition: Callable[[str], bool]) -> None:
        begun, wrong = self._clock.now(), 0
        self._say(question)
        while not condition(""):
            for event in self._pad.read_events():
                if (event.kind, event.code) == (events.SYN, events.SYN_DROPPED):
                    state.clear()
                key = state.on_event(event)
                if condition(key):
                    return
                if key or (event.kind == events.KEY and event.value == 1 and event.code != state.layout.hold.code):
                    wrong += 1
                    self._say(f"  that is {'STOP' if key == LATCH_KEY else 'ENABLE' if key else 'another button'}")
            if wrong >= MAX_TRIES or self._clock.now() - begun > ANSWER_TIMEOUT:
                raise TeachingError(
                    f"pad: the dry run failed at: {question}; nothing was saved",
                    hint="start again: mission teleop --teach-pad",
                )
            self._pause(POLL_INTERVAL)


def _is_pushed(state: PadState, there: Stick, other: Stick) -> bool:
    return state.is_held and state.deflection(there) > 0.3 and abs(state.deflection(other)) < 0.3


def _role(control: Control, taken: Mapping[Control, str]) -> str | None:
    """Return the role that a control already has in the layout, such as "enable"; None if it has none.

    Two presses of a trigger count as the same control if both were in the same direction: their values differ a little.
    """
    for other, role in taken.items():
        same = (control.kind, control.code) == (other.kind, other.code)
        if same and (control.rest is None or (control.end > control.rest) == (other.end > (other.rest or 0))):
            return role
    return None


def describe_control(control: Control) -> str:
    """Return the name of a control for messages, such as "button 5"."""
    return f"button {control.code:#x}" if control.rest is None else f"axis {control.code}, to {control.end}"
