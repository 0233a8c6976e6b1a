"""The leaves of the conformance cases: they do as they are told, and write down every call that they get."""

from collections.abc import Sequence
from typing import Any

from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf, argument
from behaviours.run import RunState
from drivers.clock import Clock
from drivers.errors import DeviceFault, NoReply, NotConnected, SensorSilent

ERRORS: dict[str, Exception] = {
    "crashes": RuntimeError("out of luck"),
    "crashes silently": RuntimeError(),
    "is offline": NotConnected("the cable is out"),
    "is silent": SensorSilent("the thermometer does not report"),
    "gets no reply": NoReply("no reply after 3 tries"),
    "is overloaded": DeviceFault("motor 3 is overloaded"),
}
"""What a probe may be told to raise."""

OUTCOMES: dict[str, Any] = {"running": RUNNING, "success": SUCCESS, "failure": FAILURE, "nonsense": "nonsense"}
"""What a probe may be told to return; ``nonsense`` is no status."""


class Bench(RunState):
    """A run that keeps, in order, what its probes were called for, and what was settled in their place."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self.log: list[str] = []
        self.safe_stop = self._settled

    def _settled(self, claims: frozenset[str]) -> None:
        self.log.append(f"{' and '.join(sorted(claims))} settled")


class Probe(Leaf):
    """Give these outcomes in turn, one a tick, from the first again once they are used up.

    A halt or a restart does not rewind it. An outcome is a status, ``nonsense``, or one of ERRORS, which it raises.
    Its start goes as ``starting`` says, in turn too: ``well``, or one of ERRORS; ``stopping`` says how it ends or is
    halted.
    A halt takes it ``halts_in`` more ticks. It fails with the reason ``because``.
    """

    tag = "probe"
    output_doc = "what it was told to find"
    outcomes: Any = argument("value", "statuses, nonsense or errors, in turn", principal=True)
    starting: Any = argument("value", "well, or an error, in turn", default="well")
    stopping: Any = argument("value", "well, or an error, in turn", default="well")
    halts_in: int = argument("count", "how many more ticks a halt takes", default=0)
    because: str = argument("text", "the reason for a failure", default="failed as requested")
    finds: Any = argument("value", "what it keeps when it succeeds", default=None)

    run: Bench
    _given = 0
    _starts = 0
    _stops = 0
    _left = 0
    _working = False

    def initialise(self) -> None:
        """Write it down."""
        self._tell("starts")
        self._working = True
        self._starts += 1
        _raise(_turn(self.starting, self._starts))

    def update(self) -> Status:
        """Give the next outcome; a tick that should not come is written down, which no case expects."""
        if not self._working:
            self._tell("is ticked though it has not started")
        self._given += 1
        word = _turn(self.outcomes, self._given)
        _raise(word)
        status: Status = OUTCOMES[word]
        if status is SUCCESS:
            self.result = self.finds
        return self.fail(self.because) if status is FAILURE else status

    def terminate(self, new_status: Status) -> None:
        """Write it down."""
        self._tell("halts" if new_status is Status.INVALID else f"ends {new_status.value.lower()}")
        self._working = False
        self._left = self.halts_in
        self._stops += 1
        _raise(_turn(self.stopping, self._stops))

    def halting(self) -> bool:
        """Take the ticks that it was told to take."""
        self._left -= 1
        return self._left >= 0

    def _tell(self, what: str) -> None:
        self.run.log.append(f"{self.name} {what}")


class BaseProbe(Probe):
    """A probe that drives the base."""

    tag = "base_probe"
    drives = frozenset({"base"})


class ArmProbe(Probe):
    """A probe that moves the arm."""

    tag = "arm_probe"
    drives = frozenset({"arm"})


class VoiceProbe(Probe):
    """A probe that speaks."""

    tag = "voice_probe"
    drives = frozenset({"voice"})


class PatientProbe(BaseProbe):
    """A probe that drives the base and has three seconds to come to rest."""

    tag = "patient_probe"
    halt_limit = 3.0


class Echo(Leaf):
    """Write down a value as it was when this leaf started. Succeeds at once."""

    tag = "echo"
    value: Any = argument("value", "what to write down", principal=True)

    run: Bench

    def update(self) -> Status:
        """Write it down as Python does, so that 3 and '3' differ."""
        self.run.log.append(f"{self.name} hears {self.value!r}")
        return SUCCESS


PROBES: dict[str, type[Leaf]] = {
    leaf.tag: leaf for leaf in (Probe, BaseProbe, ArmProbe, VoiceProbe, PatientProbe, Echo)
}
"""The words that the cases add to the language."""


def _turn(told: object, number: int) -> str:
    """Return what is to be done for the ``number``-th time."""
    words: Sequence[object] = told if isinstance(told, list) else [told]
    return str(words[(number - 1) % len(words)])


def _raise(word: str) -> None:
    if word in ERRORS:
        raise ERRORS[word]
