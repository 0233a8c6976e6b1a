"""A game pad beside a mission: whoever holds its shoulder button has the wheels, and the mission waits."""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from math import inf
from threading import Event, Thread
from types import MappingProxyType

from behaviours.run import log
from drivers.api import Base, DeviceStatus, Health, Report, ignore
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.transport.loop import guarded
from missions.control.pilot import GAZES, LATCH, MAX_STATE_AGE, PACES, Pilot, Push
from missions.plugins.teleop.layout import UnknownPadError
from missions.plugins.teleop.pad import Pad

# What each key means: the keys of ROS's teleop_twist_keyboard, the arrows for the head. Pure; the time is handed in.
#
# A terminal tells of keys that go down and of their auto-repeat, and never of one that is let go. So a key is held
# for as long as it keeps coming.

FIRST = 0.75
"""Seconds that a key counts as held when it was pressed: auto-repeat begins after up to 0.66 s (the X server's)."""

AGAIN = 0.3
"""Seconds that it counts as held once it repeats: some keyboards do so only ten times a second, and lines stutter."""

REPEAT = 0.2
"""Seconds within which a key that comes again repeats by itself; nobody types the same key so fast for long."""


MOVES: Mapping[str, Push] = MappingProxyType(
    {
        "u": Push(1, 1), "i": Push(1, 0), "o": Push(1, -1),
        "j": Push(0, 1), "l": Push(0, -1),
        "m": Push(-1, -1), ",": Push(-1, 0), ".": Push(-1, 1),
    }
)  # fmt: skip
"""The keys that drive; back to the left turns the base to the right, as ROS has it."""

STOP = "k"
ENDS = frozenset({"escape", "end"})

HELP = """\
u i o    drive: hold a key, and let go to stop     q z  faster, slower
j k l    k and every other key stop at once        w x  that ahead alone
m , .    the arrows turn the head                  e c  that of turning alone
space stops until Enter enables again; Esc or Ctrl-C ends"""


class Held:
    """The keys of a terminal that a person holds. It begins with no key."""

    def __init__(self) -> None:
        self._key = ""
        self._pressed = self._until = -inf

    def press(self, key: str, now: float) -> None:
        """Take a key that came at ``now`` seconds. One that neither drives, nor changes speed or gaze, stops."""
        if key in PACES or key in GAZES:
            return
        repeats = key == self._key and now - self._pressed <= REPEAT
        self._key, self._pressed = key, now
        self._until = now + (AGAIN if repeats else FIRST)

    def push(self, now: float) -> Push | None:
        """Return which way at ``now`` seconds; None when no key that drives is held."""
        return MOVES.get(self._key) if now <= self._until else None


# Taking the wheels: what hands push is passed on to the pilot, again and again, until somebody ends it.

# How late the keys of a terminal are, such as one at the far end of an SSH connection.
#
# The terminal is asked where its cursor is, which every terminal answers by itself, as any VT100 did. Answers and
# keys come in one stream: a key that follows an answer was pressed by a person who has seen all that was shown before
# the question.

ASK_INTERVAL = 0.1
"""Seconds from one question to the next."""

MAX_OPEN_QUESTIONS = 8
"""Questions that wait for an answer; more would say nothing new, and would be left to the shell at the end."""

ANSWER_TIMEOUT = 60.0
"""Seconds after which a question counts as lost."""

FIRST_ANSWER_TIMEOUT = 12.0
"""Seconds after which a terminal of this machine counts as one that never answers, so that its keys drive: more than
the slowest line takes there and back, 5 s each."""

FIRST_ROW = 2
"""The row of the first place: F3 with Shift is a key that looks like an answer of row 1."""


class LineDelay:
    """Measures the delay of a terminal with ``write``, by its ``clock``; ``size`` returns its columns and rows.

    The place to which a question moves the cursor is its number: an answer belongs to one question. ``remote`` says
    whether the terminal may be on another machine, and ``relay`` names a program that answers for it. With
    ``unknown_is_good`` keys drive also where the delay cannot be known.
    """

    def __init__(
        self,
        write: Callable[[str], object],
        clock: Clock,
        size: Callable[[], tuple[int, int]],
        *,
        remote: bool = False,
        relay: str = "",
        unknown_is_good: bool = False,
    ) -> None:
        self._write, self._clock, self._size = write, clock, size
        self._remote, self._relay, self._unknown_is_good = remote, relay, unknown_is_good
        self._begun_at = clock.now()
        self._asked: OrderedDict[tuple[int, int], float] = OrderedDict()
        self._number = 0
        self._asked_at = -inf
        self._seen_at = -inf
        self._round_trip = inf

    def ask(self) -> None:
        """Ask the terminal, unless that was done a moment ago. The cursor is back at once."""
        now = self._clock.now()
        while self._asked and now - next(iter(self._asked.values())) > ANSWER_TIMEOUT:
            self._asked.popitem(last=False)
        if self._relay or now - self._asked_at < ASK_INTERVAL or len(self._asked) >= MAX_OPEN_QUESTIONS:
            return
        self._asked_at = now
        columns, rows = self._size()
        row, column = divmod(self._number, max(1, columns))
        place = min(FIRST_ROW, rows) + row % max(1, rows - FIRST_ROW + 1), column + 1
        self._number += 1
        self._asked[place] = now
        self._write(f"\x1b7\x1b[{place[0]};{place[1]}H\x1b[6n\x1b8")

    def answer(self, row: int, column: int) -> None:
        """Take an answer of the terminal; one to no question is none."""
        if (row, column) not in self._asked:
            return
        place = None
        while place != (row, column):  # those before it are lost, for answers keep their order
            place, self._seen_at = self._asked.popitem(last=False)
        self._round_trip = self._clock.now() - self._seen_at

    @property
    def waiting(self) -> bool:
        """Whether answers are on their way."""
        return bool(self._asked)

    @property
    def refusal(self) -> str:
        """Why keys do not drive at present; empty where they do."""
        now = self._clock.now()
        if self._seen_at == -inf:
            waits = self._remote or now - self._begun_at < FIRST_ANSWER_TIMEOUT
            if self._unknown_is_good or not waits:
                return ""
            told = f"{self._relay} answers for the terminal" if self._relay else "the terminal does not answer"
            return f"delay unknown: {told}"
        return f"line too slow: {now - self._seen_at:.1f} s ({MAX_STATE_AGE:g} s at most)" if self.late else ""

    @property
    def late(self) -> bool:
        """Whether the line has answered, and is too slow."""
        return self._seen_at > -inf and self._clock.now() - self._seen_at >= MAX_STATE_AGE

    def words(self) -> str:
        """Return why keys do not drive, or the round trip, for the line that is shown; empty where it is unknown."""
        return self.refusal or ("" if self._seen_at == -inf else f"{1000 * self._round_trip:.0f} ms")


TICK = 0.05
"""Seconds between two commands: a command that lives for 0.3 s may miss five."""


def drive_by_hand(
    pilot: Pilot,
    typed: Callable[[float], str],
    pad: Pad | None,
    clock: Clock,
    show: Callable[[str], None],
    line: LineDelay | None = None,
) -> None:
    """Let a person drive with the keys that ``typed`` gives out, or with a ``pad`` that is open, until a key ends it.

    ``typed`` waits for so many seconds at most, and returns the empty text where none came; ``show`` is given a line
    to be seen. Keys that waited because all this was held up (SIGSTOP, a line that is stuck) drive nothing any more.
    Keys that come over a slow ``line`` neither drive nor turn the head; then all is to be let go once.
    Whatever ends it, the wheels are let go. Raises NotConnected when the pad has gone.
    """
    hand = Held() if pad is None else pad
    before, late, refused = clock.now(), False, False
    try:
        while True:
            key, now = typed(TICK), clock.now()
            if now - before > AGAIN:
                key = _left_of(key, typed)
            if key in ENDS:
                return
            before = now
            if line is not None and pad is None:
                late = line.late or (late and hand.push(now) is not None)
                refused = late or bool(line.refusal)
            for each in (key, *(() if pad is None else pad.keys())):
                if each:
                    hand.press(each, now)
                    if not (refused and each in GAZES):
                        pilot.press(each)
            pilot.steer(None if refused else hand.push(now))
            told = [pilot.words()]
            if line is not None:
                line.ask()
                told = ["let go of all keys" if refused and not line.refusal else line.words(), *told]
            show(" | ".join(filter(None, told)))
    finally:
        pilot.steer(None)


def _left_of(key: str, typed: Callable[[float], str]) -> str:
    """Take the keys that have waited, ``key`` and those behind it; return the one that ends or latches, else STOP."""
    found = STOP
    while key and key not in ENDS:
        found = LATCH if LATCH in (key, found) else STOP
        key = typed(0.0)
    return key or found


RETRY = 1.0
"""Seconds between two attempts to find the pad."""


class Beside:
    """A ``drivers.api.Device`` that moves nothing of its own: it reads a pad and commands ``base``, on its own thread.

    ``pad`` makes the pad, plugged in or not: it may be another each time. The head stays the mission's.
    """

    name = "pad"

    def __init__(self, base: Base, pad: Callable[[], Pad], clock: Clock, *, report: Report = ignore) -> None:
        self._pilot = Pilot(base)
        self._pad = pad
        self._clock = clock
        self._report = guarded(report)
        self._ending = Event()
        self._thread: Thread | None = None
        self._health = Health(False, "pad: not opened yet")

    def open(self) -> None:
        """Start looking for the pad; returns at once, whether it is there or not."""
        if self._thread is None:
            self._ending.clear()
            self._thread = Thread(target=self._run, name="pad", daemon=True)
            self._thread.start()

    def rest(self) -> None:
        """Do nothing: the base comes to rest by itself."""

    def close(self) -> None:
        """Let go of the wheels and end the thread. Safe from any state, more than once."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def health(self) -> Health:
        """Say whether the pad is there."""
        return self._health

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                self._serve()
            except NotConnected as error:
                self._lost(str(error), error.hint, refused=isinstance(error, UnknownPadError))
            except Exception as error:  # whatever it is, the pad must not seem to be there
                log.exception("the pad cannot be read")
                self._lost(f"pad: {type(error).__name__}: {error}", "")

    def _lost(self, why: str, hint: str, *, refused: bool = False) -> None:
        """Say once that the pad is not there, or why it is refused, and wait a while."""
        if self._health.online or (refused and why != self._health.detail):
            self._report(DeviceStatus(self.name, "offline", why, hint))
        self._health = Health(False, why, hint)
        self._ending.wait(RETRY)

    def _serve(self) -> None:
        """Pass on what the pad says until it has gone, or all ends."""
        pad = self._pad()
        pad.open()
        self._health = Health(True)
        self._report(DeviceStatus(self.name, "online", f"{pad.path}: a game pad"))
        try:
            drive_by_hand(self._pilot, self._wait, pad, self._clock, _unseen)
        finally:
            pad.close()

    def _wait(self, seconds: float) -> str:
        """Wait; the only key that is ever pressed here is that of the end."""
        return "end" if self._ending.wait(seconds) else ""


def _unseen(line: str) -> None:
    """Show a line to nobody: the mission shows its own."""
    del line
