"""What a mock does, as a test file writes it: ``fails twice, then succeeds``, ``runs for 2 s, then fails``.

A script is a list of turns. One is taken each time that a mock starts, whether it comes to its end or is halted before;
the last turn is taken again and again.
"""

import math
from dataclasses import dataclass, replace

from missions.plugins.testing.phrases import Phrase

TOLD = "told to fail"
"""The reason of a mock that fails without one."""

VERBS = ("succeeds", "fails", "runs")
EXAMPLE = "such as 'fails twice, then succeeds'"


@dataclass(frozen=True, slots=True)
class Turn:
    """From a start to its end: runs for ``seconds`` and ``ticks``, then ends.

    ``end`` is success or failure, or running for one that does not end by itself (and then both are infinite).
    ``times`` says how many starts in a row it is for.
    """

    end: str
    times: int = 1
    seconds: float = 0.0
    ticks: float = 0.0
    reason: str = ""


Script = tuple[Turn, ...]


def read_script(phrase: Phrase) -> Script:
    """Read a script; whatever is wrong is noted, and the turns before it returned."""
    turns: list[Turn] = []
    waited: Turn | None = None  # "runs for 2 s", which is the beginning of the turn that follows
    while True:
        turn = _turn(phrase, waited)
        waited = turn if turn.end == "running" and turn.seconds + turn.ticks < math.inf else None
        if waited is None:
            turns.append(turn)
        if phrase.word != ",":
            break
        phrase.take()
        if not phrase.took("then"):
            phrase.wrong("what follows a comma", ("then",))
    if waited is not None:
        phrase.fault("what comes after it has run is missing", "write 'runs for 2 s, then succeeds', or 'runs' alone")
    if phrase.word == "then":
        phrase.fault("a comma is missing before 'then'", EXAMPLE)
    phrase.end()
    return tuple(turns)


def _turn(phrase: Phrase, waited: Turn | None) -> Turn:
    verb = phrase.took(*VERBS)
    if not verb:
        phrase.wrong(f"what a mock does ({EXAMPLE})", VERBS)
    if verb == "runs":
        return _running(phrase, waited)
    turn = Turn("success") if verb == "succeeds" else Turn("failure", reason=TOLD)
    if waited is not None:
        turn = replace(turn, seconds=waited.seconds, ticks=waited.ticks)
    turn = replace(turn, times=_times(phrase))
    if waited is None and phrase.took("after"):
        turn = _for(phrase, turn)
    if verb == "fails" and phrase.took("because"):
        turn = replace(turn, reason=phrase.quoted("'because'"))
    return turn


def _running(phrase: Phrase, waited: Turn | None) -> Turn:
    if waited is not None:
        phrase.fault("it runs already", "write how that ends: 'succeeds' or 'fails'")
    if phrase.took("for"):
        return _for(phrase, Turn("running"))
    return Turn("running", times=_times(phrase), seconds=math.inf, ticks=math.inf)


def _for(phrase: Phrase, turn: Turn) -> Turn:
    """Read ``3 ticks`` or ``2 s``."""
    if phrase.after in ("tick", "ticks"):
        turn = replace(turn, ticks=phrase.count("how many ticks"))
        phrase.take()
        return turn
    return replace(turn, seconds=phrase.quantity("how long", "duration"))


def _times(phrase: Phrase) -> int:
    """Read how often, which is once where nothing is said."""
    if phrase.after == "times":
        times = phrase.count("how often")
        phrase.take()
        return times
    return 2 if phrase.took("once", "twice") == "twice" else 1
