"""The robot as a mission sees it: each part behind a proxy that caches, permits and records.

The proxies guarantee three things, whether a run is recorded or not:

- A property is read from its device once per tick. A later read in the same tick returns the cached value, unless a
  command went to the device in between. So a record of these values is enough to replay all decisions of the tree.
- Each command that moves a device is permitted first. A refusal raises DeviceFault, as a refusal by the driver does.
- Each command of a leaf is reported together with the name of the leaf.

In a record, the first part of each kind has the name of its field in ``behaviours.robot.Robot``, such as ``base`` or
``arm``. Additional parts, such as a second arm, have their own names. Arguments are recorded in the order of the
protocol, with defaults filled in.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from behaviours.leaf import Leaf
from behaviours.robot import Robot
from drivers.api import DEFAULT_STYLE, Device, Health, MouthShape, Priority, SpeechStyle, Utterance, Voice
from drivers.api.driver import resolve_name
from drivers.api.kinds import KINDS
from drivers.api.marks import commands
from drivers.errors import DeviceFault
from missions.executive.proxy import CommandReport, Permit, Proxy, for_leaf, make_proxy, permit_all
from missions.executive.tick_cache import PartCache, TickCache

# Proxy of a voice, written by hand: utterances are identified by numbers, from 1.
#
# ``say`` returns the number, and ``done`` and the other methods take it: a record cannot store an utterance.


class _NumberedUtterances:
    """Utterances of a ``voice`` that have not ended, by number from 1; records refer to them by these numbers."""

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
        return next((number for number, utterance in self.said.items() if utterance is now), None)

    def _add(self, utterance: Utterance) -> int:
        self.said = {number: earlier for number, earlier in self.said.items() if not earlier.done()}
        self._number += 1
        self.said[self._number] = utterance
        return self._number


class VoiceProxy(Proxy):
    """Proxy of a voice; it reports each utterance, with its style and priority if they are not the defaults."""

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
        if self._tell is not None:
            self._tell(self.name, self._source, {"rest": True})
        self._memo.command("rest", self._device.voice.rest)

    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        if self._tell is not None:
            options = {name: value for name, value in asdict(manner).items() if value}
            self._tell(self.name, self._source, {"say": text, **options, **_priority_dict(priority)})
        return self._utterance_proxy(
            self._memo.command("say", self._device.say, text, *non_default_manner(manner, priority))
        )

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        if self._tell is not None:
            self._tell(self.name, self._source, {"play": str(path), **_priority_dict(priority)})
        _, otherwise = non_default_manner(DEFAULT_STYLE, priority)
        return self._utterance_proxy(self._memo.command("play", self._device.play, str(path), otherwise))

    def speaking(self) -> Utterance | None:
        number: int | None = self._memo["speaking"]
        return None if number is None else self._utterance_proxy(number)

    def _utterance_proxy(self, number: int) -> "_UtteranceProxy":
        return _UtteranceProxy(number, self._device.said[number], self._memo)


def voice_proxy(voice: Voice, cache: TickCache) -> Voice:
    """Return the proxy of a voice; ``cache`` holds its values during a tick. Speech needs no permit."""
    numbered = _NumberedUtterances(voice)
    memo = cache.add_part("voice", {"health": voice.health, "speaking": numbered.speaking})
    return VoiceProxy(numbered, memo)


class _UtteranceProxy:
    """Proxy of an utterance, identified by its number."""

    __slots__ = ("_known", "_number", "_said")

    def __init__(self, number: int, utterance: Utterance, cache: PartCache) -> None:
        self._number = number
        self._said = utterance
        self._known = cache

    def done(self) -> bool:
        return self._known.query("done", lambda _: self._said.done(), self._number)

    def cancel(self) -> None:
        self._known.command("cancel", lambda _: self._said.cancel(), self._number)

    @property
    def cancelled(self) -> bool:
        return self._known.query("cancelled", lambda _: self._said.cancelled, self._number)

    @property
    def started(self) -> float | None:
        return self._known.query("started", lambda _: self._said.started, self._number)

    @property
    def mouth(self) -> Sequence[MouthShape]:
        return self._known.query("mouth", lambda _: tuple(self._said.mouth), self._number)


def non_default_manner(manner: SpeechStyle, priority: Priority) -> tuple[SpeechStyle | None, Priority | None]:
    """Return style and priority of speech, each None if it is the default, so that a record omits defaults."""
    return None if manner == DEFAULT_STYLE else manner, None if priority is Priority.NORMAL else priority


def _priority_or_default(priority: Priority | None) -> Priority:
    return Priority.NORMAL if priority is None else priority


def _priority_dict(priority: Priority) -> dict[str, str]:
    return {} if priority is Priority.NORMAL else {"priority": priority.name.lower()}


class StaleCommandGuard:
    """Refuses commands of leaves which started before their device reconnected.

    Such a leaf planned for a situation that may have changed, so it fails. The leaf that the mission starts next
    (another branch, or a retry) may move the device. ``permit`` is called first, and may refuse a command too.
    """

    def __init__(self, permit: Callable[[], None]) -> None:
        self._permit = permit

    def __call__(self, device: Device, leaf: Leaf | None) -> None:
        self._permit()
        returned = device.health().reconnected_at
        if leaf is not None and returned is not None and leaf.started_at < returned:
            raise DeviceFault(
                f"{device.name}: it was away for a while, and {leaf.label} began before it was back",
                hint="start it again: put a 'retry' around it",
            )


PART_FIELDS = tuple(kind.field for kind in KINDS.values())
"""Names by which records refer to the parts of a robot, such as ``base``, one for each kind of part."""


@cache
def resolve_protocol(kind: str) -> type:
    """Return the protocol class of a kind of part, such as ``Joints``, as leaves see it.

    ``kind`` is the name of the kind, or its name in records.
    """
    found = next(each for each in KINDS.values() if kind in (each.field, each.name))
    protocol: type = resolve_name(found.leaf_protocol or found.protocol)
    return protocol


@cache
def command_names(kind: str) -> frozenset[str]:
    """Return the names of the command methods of a kind of part; all others are queries.

    Those of a voice include the commands of its utterances.
    """
    return commands(resolve_protocol(kind)) | (commands(Utterance) if kind == "voice" else frozenset())


def with_proxies(robot: Robot, cache: TickCache, permit: Permit = permit_all) -> Robot:
    """Return ``robot`` with a proxy for each part; ``permit`` is called before each command that moves a device."""
    return _replace_parts(
        robot,
        {
            part: voice_proxy(device, cache)
            if part == "voice"
            else make_proxy(part, resolve_protocol(kind), device, cache, permit)
            for part, kind, device in _iter_parts(robot)
        },
    )


def robot_for(leaf: Leaf, robot: Robot, report: CommandReport) -> Robot:
    """Return ``robot`` for ``leaf``: its commands are passed to ``report`` with the leaf's name.

    The parts of ``robot`` must have proxies. They refuse every command that could move something, from any thread, of a
    leaf that does not run (see ``HaltableNode.may_move``), and always of a leaf within a ``finally``.
    """
    source = f"{leaf.name} ({leaf.key})" if leaf.name != leaf.kind else f"{leaf.kind} ({leaf.key})"
    proxies = {
        part: for_leaf(proxy, source, report, leaf) for part, kind, proxy in _iter_parts(robot) if command_names(kind)
    }
    return _replace_parts(robot, proxies).with_named_parts(leaf.named_parts)


def _iter_parts(robot: Robot) -> Iterator[tuple[str, str, Any]]:
    """Yield for each part of the robot its name, its kind (both as in records), and its device or proxy."""
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
