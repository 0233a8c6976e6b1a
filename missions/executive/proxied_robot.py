"""A robot as a mission asks and commands it: within a moment each question has one answer, and a part is asked once.

That is so whether a run is recorded or not, and it is what makes a record enough to decide everything over again:
whatever a tree is told from outside comes through here. A command that is not permitted is refused here too, as a
driver would. So what was decided before a part was back moves it no more: the behaviour fails, and the mission decides
anew. A leaf sees the robot so that what it commands is told, with its name on it. In answers the parts go by the names
that they have in ``behaviours.robot.Robot``: base, head, arm, ranger, voice, sight, hearing, screen, and further parts
of a kind by their own. Arguments are those of the protocol in its order, with what may be left out.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import RunState
from drivers.api import DEFAULT_STYLE, Device, Health, MouthShape, Priority, SpeechStyle, Utterance, Voice
from drivers.api.driver import resolve_name
from drivers.api.kinds import KINDS
from drivers.api.marks import commands
from drivers.errors import DeviceFault
from missions.executive.proxy import CommandReport, Permit, Proxy, for_leaf, make_proxy, permit_all
from missions.executive.tick_cache import PartCache, TickCache

# The proxy of a voice, written by hand: what is said goes by its number, from 1.
#
# The answer to ``say`` is the number, by which ``done`` and its like are asked: a record cannot keep an utterance
# itself.


class _NumberedUtterances:
    """The utterances of a ``voice`` by their numbers, as far as they go on; and the newest."""

    def __init__(self, voice: Voice) -> None:
        self.voice = voice
        self.said: dict[int, Utterance] = {}
        self._number = 0

    def say(self, text: str, manner: SpeechStyle | None, priority: Priority | None) -> int:
        return self._add(self.voice.say(text, manner or DEFAULT_STYLE, _priority_or_default(priority)))

    def play(self, path: str, priority: Priority | None) -> int:
        return self._add(self.voice.play(Path(path), _priority_or_default(priority)))

    def speaking(self) -> int | None:
        now = self.voice.speaking()
        return next((number for number, said in self.said.items() if said is now), None)

    def _add(self, utterance: Utterance) -> int:
        self.said = {number: earlier for number, earlier in self.said.items() if not earlier.done()}
        self._number += 1
        self.said[self._number] = utterance
        return self._number


class VoiceProxy(Proxy):
    """A voice whose words are told, with how they are said where that is not as usual."""

    __slots__ = ("close", "health", "name", "open")
    open: Callable[[], None]
    close: Callable[[], None]
    health: Callable[[], Health]

    def __init__(self, device: _NumberedUtterances, memo: PartCache) -> None:
        super().__init__(device, memo)
        voice = device.voice
        self.name, self.open, self.close = voice.name, voice.open, voice.close
        self.health = partial(memo.__getitem__, "health")

    def rest(self) -> None:
        """See drivers.api.Device."""
        if self._tell is not None:
            self._tell(self.name, self._source, {"rest": True})
        self._memo.command("rest", self._device.voice.rest)

    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """See drivers.api.Voice."""
        if self._tell is not None:
            told = {name: value for name, value in asdict(manner).items() if value}
            self._tell(self.name, self._source, {"say": text, **told, **_priority_dict(priority)})
        return self._utterance_proxy(
            self._memo.command("say", self._device.say, text, *non_default_manner(manner, priority))
        )

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """See drivers.api.Voice."""
        if self._tell is not None:
            self._tell(self.name, self._source, {"play": str(path), **_priority_dict(priority)})
        _, otherwise = non_default_manner(DEFAULT_STYLE, priority)
        return self._utterance_proxy(self._memo.command("play", self._device.play, str(path), otherwise))

    def speaking(self) -> Utterance | None:
        """See drivers.api.Voice."""
        number: int | None = self._memo["speaking"]
        return None if number is None else self._utterance_proxy(number)

    def _utterance_proxy(self, number: int) -> "_UtteranceProxy":
        return _UtteranceProxy(number, self._device.said[number], self._memo)


def voice_proxy(voice: Voice, cache: TickCache) -> Voice:
    """Return ``voice`` behind its proxy, see ``missions.executive.proxy.make_proxy``: a voice needs no permit."""
    numbered = _NumberedUtterances(voice)
    memo = cache.add_part("voice", {"health": voice.health, "speaking": numbered.speaking})
    return VoiceProxy(numbered, memo)


class _UtteranceProxy:
    """Something being said, by its number."""

    __slots__ = ("_known", "_number", "_said")

    def __init__(self, number: int, utterance: Utterance, cache: PartCache) -> None:
        self._number = number
        self._said = utterance
        self._known = cache

    def done(self) -> bool:
        """See drivers.api.Utterance."""
        return self._known.query("done", lambda _: self._said.done(), self._number)

    def cancel(self) -> None:
        """See drivers.api.Utterance."""
        self._known.command("cancel", lambda _: self._said.cancel(), self._number)

    @property
    def cancelled(self) -> bool:
        """See drivers.api.Utterance."""
        return self._known.query("cancelled", lambda _: self._said.cancelled, self._number)

    @property
    def started(self) -> float | None:
        """See drivers.api.Utterance."""
        return self._known.query("started", lambda _: self._said.started, self._number)

    @property
    def mouth(self) -> Sequence[MouthShape]:
        """See drivers.api.Utterance."""
        return self._known.query("mouth", lambda _: tuple(self._said.mouth), self._number)


def non_default_manner(manner: SpeechStyle, priority: Priority) -> tuple[SpeechStyle | None, Priority | None]:
    """Return how something is said, None for what is as usual: so a record has no more than what was asked for."""
    return None if manner == DEFAULT_STYLE else manner, None if priority is Priority.NORMAL else priority


def _priority_or_default(priority: Priority | None) -> Priority:
    return Priority.NORMAL if priority is None else priority


def _priority_dict(priority: Priority) -> dict[str, str]:
    return {} if priority is Priority.NORMAL else {"priority": priority.name.lower()}


class StaleCommandGuard:
    """The permit of a run: asked before a device is set moving; ``permit`` is asked before.

    A behaviour that began before the device was back from a long absence raises DeviceFault, so it fails; whatever the
    mission starts then (the next of a selector, another try) is a fresh decision, and may move it.
    """

    def __init__(self, run: RunState, permit: Callable[[], None]) -> None:
        self._run = run
        self._permit = permit

    def __call__(self, device: Device) -> None:
        """Raise DeviceFault where the behaviour that has the word is not to move ``device`` now."""
        self._permit()
        leaf, returned = self._run.active_leaf, device.health().reconnected_at
        if leaf is not None and returned is not None and leaf.started_at < returned:
            raise DeviceFault(
                f"{device.name}: it was away for a while, and {leaf.label} began before it was back",
                hint="decide anew when it is back: put a 'retry' around it",
            )


PART_FIELDS = tuple(kind.field for kind in KINDS.values())
"""The parts by their names in answers."""


@cache
def resolve_protocol(kind: str) -> type:
    """Return the protocol of what leaves see of a kind of part, by its name, or that in answers."""
    found = next(each for each in KINDS.values() if kind in (each.field, each.name))
    protocol: type = resolve_name(found.leaf_protocol or found.protocol)
    return protocol


@cache
def command_names(kind: str) -> frozenset[str]:
    """Return what a kind of part is told, by its name in answers; the rest it is asked.

    A voice is told to cancel what it says, by its number.
    """
    return commands(resolve_protocol(kind)) | (commands(Utterance) if kind == "voice" else frozenset())


def with_proxies(robot: Robot, cache: TickCache, permit: Permit = permit_all) -> Robot:
    """Return ``robot`` so that its parts answer through ``answers``; ``permit`` is asked before anything moves."""
    return _replace_parts(
        robot,
        {
            part: voice_proxy(device, cache)
            if part == "voice"
            else make_proxy(part, resolve_protocol(kind), device, cache, permit)
            for part, kind, device in _iter_parts(robot)
        },
    )


def robot_for(node: Node, robot: Robot, report: CommandReport) -> Robot:
    """Return a ``robot`` that ``with_proxies`` has made as ``node`` sees it: each command that it gives is told."""
    source = f"{node.name} ({node.key})" if node.name != node.kind else f"{node.kind} ({node.key})"
    told = {part: for_leaf(proxy, source, report) for part, kind, proxy in _iter_parts(robot) if command_names(kind)}
    return _replace_parts(robot, told).with_named_parts(getattr(node, "named_parts", {}))


def _iter_parts(robot: Robot) -> Iterator[tuple[str, str, Any]]:
    """Yield the name of each part in answers, that of its kind there, and what stands for it."""
    for part in PART_FIELDS:
        device = getattr(robot, f"{part}_part")
        if device is not None:
            yield part, part, device
    for name, other in robot.extra_parts.items():
        yield name, KINDS[other.kind].field, other.part


def _replace_parts(robot: Robot, parts: Mapping[str, Any]) -> Robot:
    fields: dict[str, Any] = {f"{part}_part": device for part, device in parts.items() if part in PART_FIELDS}
    others = {name: replace(other, part=parts.get(name, other.part)) for name, other in robot.extra_parts.items()}
    return replace(robot, extra_parts=others, **fields)
