"""Listener that records the events of a run, in the form in which test files name events."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from behaviours.leaf import RUNNING, Leaf
from behaviours.node import Node
from drivers.api import Pose2D, Velocity
from missions.executive.events import (
    CommandSent,
    Event,
    FaultRaised,
    Logged,
    NodeChanged,
    Notified,
    ReflexFired,
    Ticked,
)
from missions.executive.executive import Result
from missions.executive.submission import Submission
from missions.language.nodes import MODIFIERS
from missions.language.outcomes import possible_ends
from missions.language.plan import Step
from missions.plugins.testing.event_specs import ObservedEvent
from missions.plugins.testing.mocks import Mock
from missions.trees.drawing import ACTIVE

STANDSTILL_SPEED = 0.005
"""Speed below which a base is at rest, in m/s and rad/s."""

END_VERBS = {"success": "succeeds", "failure": "fails"}
FIXED_ENDS = {"succeed": ("success",), "fail": ("failure",)}
"""Leaves that always end in the same way, with the ends that coverage expects of them."""

NOTICE_VERBS = {"offline": "disconnects", "online": "reconnects", "fault": "complains"}


@dataclass(frozen=True, slots=True)
class NodeRecord:
    """Results of one node of a mission: position in the file, statuses, counts of starts and ends, and failure reasons.

    ``ends`` are the statuses with which the node can end.
    """

    file: str
    line: int
    key: str
    kind: str
    name: str
    statuses: Mapping[str, int]
    reasons: tuple[str, ...]
    ends: tuple[str, ...] = ()


@dataclass(slots=True)
class CaseHistory:
    """Records the events of a test case's run. ``listeners`` are called with each event, at once.

    ``claim_conflict`` names a part that two leaves drove at the same time, ``is_moving`` says whether the base moved at
    the last tick, ``pose`` is its final pose in the world frame, and ``joints`` the final arm angles (radians).
    ``said`` are the robot's utterances, ``heard_by`` the utterances that each person heard, ``showed`` and ``moods``
    the contents of its screen (an empty text if cleared), and ``notified`` its notices, in order. ``result`` and
    ``returns`` are the result and the return values of the mission, after its end; the result is "running" if the
    case's timeout has ended it. ``left_out`` are the names of nodes below mocked ones, as ``find_left_out`` returns
    them.
    """

    events: list[Event] = field(default_factory=list)
    observed_events: list[ObservedEvent] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    heard_by: Mapping[str, list[str]] = field(default_factory=dict)
    showed: list[str] = field(default_factory=list)
    moods: list[str] = field(default_factory=list)
    notified: list[str] = field(default_factory=list)
    claim_conflict: str = ""
    listeners: list[Callable[[ObservedEvent], None]] = field(default_factory=list)
    result: Result | None = None
    returns: Mapping[str, object] = field(default_factory=dict)
    is_moving: bool = False
    pose: Pose2D | None = None
    joints: Mapping[str, float] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    _velocity: Callable[[], Velocity] | None = None
    _missions: dict[str, str] = field(default_factory=dict)
    _speaker: str = ""
    _leaves: list[Leaf] = field(default_factory=list)
    _offline_parts: set[str] = field(default_factory=set)
    _running: set[str] = field(default_factory=set)
    _statuses: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    _reasons: dict[str, dict[str, None]] = field(default_factory=lambda: defaultdict(dict))

    def attach(self, root: Node, velocity: Callable[[], Velocity] | None = None) -> None:
        """Observe a tree at every tick, and the base's true ``velocity``, if it has a base."""
        missions = (node for node in root.iterate() if isinstance(node, Submission | Mock))
        self._missions = {node.key: node.mission for node in missions if node.mission}
        self._leaves = [node for node in root.iterate() if isinstance(node, Leaf) and node.claims]
        self._velocity = velocity

    def __call__(self, event: Event) -> None:
        self.events.append(event)
        match event:
            case NodeChanged():
                self._on_node_changed(event)
            case Ticked():
                self._on_tick(event.t)
            case FaultRaised():
                self._on_fault_raised(event)
            case ReflexFired():
                verb = "fires" if event.on else "clears"
                self._add_event(ObservedEvent(event.t, (event.condition,), verb, event.where))
            case Logged(level="voice"):
                self.said.append(event.text)
                self._add_event(ObservedEvent(event.t, ("robot",), "says", event.text, self._speaker))
            case Notified():
                self.notified.append(event.text)
            case CommandSent(to="voice"):
                self._speaker = f"{event.source.rpartition('(')[2].rstrip(')')}."
            case CommandSent(to="screen"):
                self._on_screen_command(event.values)
            case _:
                pass

    def starts(self, name: str) -> int:
        """Return how often nodes started that have ``name`` as their name or as their word, such as ``drive``."""
        return self._count(name, "starts")

    def outcomes(self, name: str) -> dict[str, int]:
        """Return the counts of starts and ends of nodes that have ``name`` as their name or word, such as ``drive``."""
        return {verb: count for verb in ("starts", "succeeds", "fails", "halts") if (count := self._count(name, verb))}

    def nodes(self, root: Node, tree: Step) -> tuple[NodeRecord, ...]:
        """Return the record of every node of the tree, in the file's order; ``tree`` is its plan."""
        return tuple(
            NodeRecord(
                step.source.name,
                step.mark.line,
                key,
                step.kind,
                step.name,
                dict(self._statuses.get(key, {})),
                tuple(self._reasons.get(key, {})),
                FIXED_ENDS.get(step.kind) or tuple(sorted(possible_ends(step))),
            )
            for key, step in _steps_by_key(tree, root.key)  # from the plan: below a mock no nodes were built
        )

    def _on_node_changed(self, event: NodeChanged) -> None:
        self._statuses[event.node][event.status] += 1
        if event.status == "failure":
            self._reasons[event.node][event.reason] = None
        ran = event.node in self._running
        if event.status in ACTIVE:
            self._running.add(event.node)
        else:
            self._running.discard(event.node)
        if event.kind in MODIFIERS:  # modifiers have the name of their node
            return
        names = (event.kind, self._missions.get(event.node, event.kind), event.name)
        if not ran and event.status not in ("idle", "skipped"):
            self._add_event(ObservedEvent(event.t, names, "starts", key=event.node))
        if event.status in END_VERBS:
            reason = event.reason if event.status == "failure" else ""
            self._add_event(ObservedEvent(event.t, names, END_VERBS[event.status], reason, event.node))
        elif event.status == "idle" and ran:
            self._add_event(ObservedEvent(event.t, names, "halts", key=event.node))

    def _on_fault_raised(self, event: FaultRaised) -> None:
        if event.status == "offline":
            self._offline_parts.add(event.part)
        elif event.status == "online":
            if event.part not in self._offline_parts:  # the first connection is not an event
                return
            self._offline_parts.discard(event.part)
        self._add_event(ObservedEvent(event.t, (event.part,), NOTICE_VERBS[event.status], event.detail))

    def _on_screen_command(self, values: Mapping[str, object]) -> None:
        if "show" in values:
            self.showed.append(str(values["show"]))
        if "mood" in values:
            self.moods.append(str(values["mood"]))

    def _on_tick(self, time: float) -> None:
        moves = self._velocity is not None and _is_moving(self._velocity())
        if moves != self.is_moving:
            self.is_moving = moves
            self._add_event(ObservedEvent(time, ("base",), "moves" if moves else "stops"))
        owners: dict[str, Leaf] = {}
        for leaf in self._leaves:
            if leaf.status is RUNNING and leaf.is_acting:
                for part in sorted(leaf.claims):
                    owner = owners.setdefault(part, leaf)
                    if owner is not leaf and not self.claim_conflict:
                        self.claim_conflict = f"at {time:.2f} s {owner.label} and {leaf.label} both drive the {part}"

    def _add_event(self, happening: ObservedEvent) -> None:
        self.observed_events.insert(self._insert_index(happening), happening)
        for hear in list(self.listeners):  # a listener may remove itself
            hear(happening)

    def _insert_index(self, happening: ObservedEvent) -> int:
        """Return the index at which to insert an event in the list of events.

        A node reports its start after the events of its first tick, but the start comes before them.
        """
        place = len(self.observed_events)
        if happening.verb == "starts":
            inside = f"{happening.key}."
            for number in range(place - 1, -1, -1):
                earlier = self.observed_events[number]
                if earlier.time != happening.time:
                    break
                if earlier.key.startswith(inside):
                    place = number
        return place

    def _count(self, name: str, verb: str) -> int:
        return sum(1 for each in self.observed_events if each.verb == verb and name in each.names)


def _is_moving(velocity: Velocity) -> bool:
    return max(abs(velocity.linear), abs(velocity.angular)) > STANDSTILL_SPEED


def _steps_by_key(step: Step, key: str) -> Iterator[tuple[str, Step]]:
    """Yield each step with the key of its node in the built tree, parents first."""
    yield key, step
    for place, child in enumerate(step.children, start=1):
        yield from _steps_by_key(child, f"{key}.{place}")
