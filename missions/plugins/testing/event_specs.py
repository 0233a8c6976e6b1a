"""Events of a run as test files write them: ``track_face starts``, ``says "Hello"``, ``base stops``."""

from collections.abc import Callable
from dataclasses import dataclass

from drivers.api.kinds import KINDS
from missions.executive.guard import REFLEXES
from missions.plugins.testing.phrases import Phrase

NODE_VERBS: tuple[str, ...] = ("starts", "succeeds", "fails", "halts")
PART_VERBS = ("disconnects", "reconnects", "complains")
BASE_VERBS = ("moves", "stops")
REFLEX_VERBS = ("fires", "clears")
VERBS = (*NODE_VERBS, *PART_VERBS, *BASE_VERBS, *REFLEX_VERBS)
SAYS = ("say", "says")

NodeError = Callable[[str], str]
"""Function that returns an error for the name of a node; empty if the mission has such a node."""


@dataclass(frozen=True, slots=True)
class ObservedEvent:
    """An event of a run, ``time`` seconds after its start: the action ``verb`` of a node, a part or another source.

    ``names`` are the names of the source that a test file can use. ``text`` is an utterance, a failure reason, a part's
    fault, or a reflex's detail. ``key`` is the node's key in the tree, with a dot appended for events that the node's
    behaviour caused itself.
    """

    time: float
    names: tuple[str, ...]
    verb: str
    text: str = ""
    key: str = ""

    def __str__(self) -> str:
        if self.verb == "says":
            return f'says "{self.text}"'
        return f"{self.names[-1]} {self.verb}" + (f" ({self.text})" if self.text else "")


@dataclass(frozen=True, slots=True)
class EventSpec:
    """An event named in a test file: a source, its action ``verb``, and a part of the event's ``text``."""

    name: str
    verb: str
    text: str = ""

    def matches(self, event: ObservedEvent) -> bool:
        """Return whether ``event``, which a run has reported, is the event that the test file names."""
        return self.verb == event.verb and self.name in event.names and self.text in event.text

    def __str__(self) -> str:
        return f'says "{self.text}"' if self.verb == "says" else f"{self.name} {self.verb}"


def read_event(phrase: Phrase, node_error: NodeError) -> EventSpec:
    """Read an event from the words of a phrase; the words after the event are not consumed."""
    if phrase.word in SAYS and phrase.following_word not in NODE_VERBS:  # else it is a behaviour of that name
        phrase.take()
        return EventSpec("robot", "says", phrase.take_quoted("'says'"))
    words = phrase.words_until(VERBS)
    if len(words) > 1 and phrase.words_until(()) == words:  # no verb, so the last word was meant to be one
        words.pop()
    name, verbs = " ".join(words).strip('"'), NODE_VERBS
    if name in KINDS:
        verbs = (*BASE_VERBS, *PART_VERBS) if name == "base" else PART_VERBS
    elif name in REFLEXES and (
        node_error(name) or phrase.words_until(NODE_VERBS) != words
    ):  # else a behaviour of that name
        verbs = REFLEX_VERBS
    elif problem := node_error(name):
        phrase.add_fault(problem)
    for _ in words:
        phrase.take()
    verb = phrase.take_if(*verbs)
    if not verb:
        phrase.reject(f"the event of '{name}'", verbs)
    return EventSpec(name, verb)
