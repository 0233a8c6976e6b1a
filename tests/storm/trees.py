"""Missions by chance, as text: composites, modifiers and leaves of the language, for what a robot has."""

import json
from collections.abc import Callable, Collection, Mapping
from random import Random
from typing import Any

from behaviours.catalogue import LEAVES as KNOWN
from behaviours.leaf import Leaf
from drivers.api.kinds import REPEATABLE_KINDS
from tests.storm.leaves import (
    CARELESS,
    GOALS,
    LEFT,
    RAISES_LAST,
    STOPS_NOT,
    WAYS,
    CarelessArm,
    CarelessHead,
    RogueArm,
    RogueHead,
)

REORDERED = 0.3
"""The share of selectors whose children have their turns or weights."""

OFTEN = 0.7
"""The share of missions that begin again once they have ended."""

CONTESTS = 0.15
"""The share of missions in which a behaviour comes late, and takes what another one is moving."""

CUT, LAST = 0.16, 0.06
"""The share of missions in which something that moves is cut short, and nothing follows for a while; and of those that
end while something moves."""

NEVER = 99
"""Ticks that no behaviour has which is cut short."""

RECOVERED, CLEANED = 0.5, 0.1
"""The share of retried nodes with a ``recover``, and of all nodes with a ``finally``."""

ROGUES = 0.25
"""The share of leaves that misbehave, beside those that are drawn with the others."""

OF_OTHERS = 0.4
"""The share of leaves that a further part can do, where there is one, beside those that are drawn with the others."""

LED = ("mirror", "mirror", "follow_joint")
"""Leaves by which one joint leads another, of the same arm or of two."""

Draw = Callable[[Random], Any]

COMPOSITES = (
    "sequence",
    "sequence",
    "selector",
    "reactive_sequence",
    "reactive_selector",
    "parallel",
    "parallel",
    "race",
    "random_sequence",
    "random_selector",
)
MODIFIERS: Mapping[str, Draw] = {
    "for": lambda it: _seconds(it, 0.3, 6.0),
    "timeout": lambda it: _seconds(it, 0.3, 6.0),
    "hold": lambda it: _seconds(it, 0.1, 0.5),
    "delay": lambda it: _seconds(it, 0.1, 1.0),
    "cooldown": lambda it: _seconds(it, 0.1, 2.0),
    "retry": lambda it: it.choice([1, 2, "forever"]),
    "repeat": lambda it: it.choice([1, 2, "forever"]),
    "invert": lambda _: True,
    "on_failure": lambda _: "succeed",
    "on_success": lambda _: "fail",
}


def _seconds(it: Random, low: float, high: float) -> str:
    return f"{it.uniform(low, high):.2f} s"


def _metres(it: Random, low: float, high: float) -> str:
    return f"{it.uniform(low, high):.2f} m"


def _angle(it: Random, most: float) -> str:
    return f"{it.uniform(-most, most):.0f} deg"


def _rogue(it: Random) -> dict[str, object]:
    return {"way": it.choice(WAYS), "goal": it.choice(list(GOALS)), "after": it.randint(1, 30)}


def _careless(it: Random) -> dict[str, object]:
    return {**_rogue(it), "way": it.choice(CARELESS)}


LEAVES: Mapping[str, tuple[Collection[str], Draw]] = {
    "drive": (["base"], lambda it: {"distance": _metres(it, -0.6, 1.2), "speed": f"{it.uniform(0.05, 0.4):.2f} m/s"}),
    "turn": (["base"], lambda it: {"angle": _angle(it, 200), "speed": f"{it.uniform(20, 100):.0f} deg/s"}),
    "arc": (["base"], lambda it: {"radius": _metres(it, 0.2, 0.8), "angle": _angle(it, 200)}),
    "velocity": (["base"], lambda it: {"speed": _metres(it, -0.4, 0.4) + "/s", "turn": _angle(it, 90) + "/s"}),
    "go_to": (["base"], lambda it: {"x": _metres(it, -1, 2), "y": _metres(it, -1, 1)}),
    "wander": (["base", "range"], lambda it: {"speed": f"{it.uniform(0.1, 0.3):.2f} m/s"}),
    "dock": (["base"], lambda _: {}),
    "stop": (["base"], lambda _: {}),
    "bumped": (["base"], lambda _: {}),
    "battery_below": (["base"], lambda it: f"{it.randint(5, 90)} %"),
    "obstacle_within": (["range"], lambda it: f"{it.uniform(0.3, 2):.1f} m"),
    "rogue": ([], _rogue),
    "rogue_base": (["base"], _rogue),
    "rogue_head": (["head"], _rogue),
    "rogue_arm": (["arm"], _rogue),
    "careless_base": (["base"], _careless),
    "careless_head": (["head"], _careless),
    "careless_arm": (["arm"], _careless),
    "look": (["head"], lambda it: {"pan": _angle(it, 75), "tilt": _angle(it, 15)}),
    "scan": (["head"], lambda it: {"rows": it.randint(1, 2), "smooth": it.random() < 0.5}),
    "nod": (["head"], lambda it: it.randint(1, 3)),
    "shake_head": (["head"], lambda it: it.randint(1, 3)),
    "sweep_head": (["head"], lambda it: {"amplitude": f"{it.randint(10, 70)} deg", "period": _seconds(it, 2, 8)}),
    "look_at": (["head"], lambda it: {"x": _metres(it, 0.5, 2), "y": _metres(it, -1, 1), "z": "1 m"}),
    "find_face": (["head", "camera"], lambda _: {}),
    "track_face": (["head", "camera", "base"], lambda it: {"patience": _seconds(it, 0.5, 3)}),
    "follow_person": (["head", "camera", "base"], lambda it: {"distance": f"{it.uniform(0.8, 1.5):.1f} m"}),
    "face_seen": (["camera"], lambda it: _seconds(it, 0.2, 1)),
    "motion_seen": (["camera"], lambda _: {}),
    "gesture": (["arm"], lambda it: it.choice(["hello", "wave", "bow", "greeting", "goodbye"])),
    "torque": (["arm"], lambda it: it.random() < 0.7),
    "joint_hot": (["arm"], lambda _: {}),
    "say": (["voice"], lambda it: it.choice(["Hello", "I am here", "What a storm this is, is it not"])),
    "listen": (["microphone"], lambda it: {"for": ["yes", "no"], "timeout": _seconds(it, 1, 4)}),
    "show": (["screen"], lambda it: {"text": "storm", "for": _seconds(it, 0.5, 2)}),
    "wait": ([], lambda it: _seconds(it, 0.1, 3)),
    "log": ([], lambda _: "still here"),
    "notify": ([], lambda _: "look here"),
    "succeed": ([], lambda _: {}),
    "fail": ([], lambda _: "failed as requested"),
}  # fmt: skip
"""Leaves: the parts that each needs, and what it is given."""


OWN: Mapping[str, type[Leaf]] = {leaf.tag: leaf for leaf in (RogueHead, RogueArm, CarelessHead, CarelessArm)}
"""Leaves of the storm that say on which part they work."""

Limits = Mapping[str, tuple[float, float]]
"""How far each joint of an arm goes, in degrees."""


class Trees:
    """Draws missions for a robot with these ``parts``, ``joints`` of each arm, and the kinds of ``others`` by name."""

    def __init__(
        self, chance: Random, parts: Collection[str], joints: Mapping[str, Limits], others: Mapping[str, str]
    ) -> None:
        self._chance, self._joints, self._others = chance, joints, others
        self._parts = frozenset(parts)
        self._words = [word for word, (needs, _) in LEAVES.items() if self._has(word, needs)]
        self._words += ["move_joints", "move_joints", "move_joints", "sweep"] if joints else []
        self._words += LED * 4 if {*joints} - {"arm"} else []

    def mission(self) -> str:
        """Return the text of a mission; whether it can be run is for the checker to say."""
        kind = self._chance.random()
        if kind < CUT:
            tree, often = self._cut(), 0.0
        elif kind < CUT + LAST:
            tree, often = self._last(), 0.0
        else:
            tree, often = self._contest() if kind < CUT + LAST + CONTESTS else self._tree(3), OFTEN
        if self._chance.random() < often:
            tree = {"sequence": [{**tree, "on_failure": "succeed"}, {"wait": "50 ms"}], "repeat": "forever"}
        return f"mission: storm\ntree: {json.dumps(tree)}\n"

    def _tree(self, depth: int) -> dict[str, Any]:
        chance = self._chance
        if depth and chance.random() < (1.0 if depth == 3 else 0.55):
            children = [self._tree(depth - 1) for _ in range(chance.randint(1, 3))]
            step: dict[str, Any] = {chance.choice(COMPOSITES): children}
            if "selector" in step and chance.random() < REORDERED:
                step["in_turn"] = True
            elif "random_selector" in step and chance.random() < REORDERED:
                step["weights"] = [chance.randint(1, 3) for _ in children]
        else:
            step = self._leaf()
        for word in chance.sample(sorted(MODIFIERS), chance.choice([0, 0, 0, 1, 1, 2])):
            step[word] = MODIFIERS[word](chance)
        if step.get("retry", 1) != 1 and chance.random() < RECOVERED:
            step["recover"] = self._leaf()
        if chance.random() < CLEANED:
            step["finally"] = self._cleanup()
        return step

    def _cleanup(self) -> dict[str, Any]:
        """Draw what runs finally: a leaf that may, or one that claims nothing and tries to move all."""
        parts = {"voice": {"say": "I stop here"}, "screen": {"show": "storm"}}
        honest = [step for part, step in parts.items() if part in self._parts]
        return self._chance.choice([*honest, {"log": "cleaned"}, *[{"rogue_cleanup": _rogue(self._chance)}] * 2])

    def _contest(self) -> dict[str, Any]:
        chance = self._chance
        rogues = [word for word in self._words if word.startswith("rogue_")]
        if not rogues:
            return self._tree(3)
        word = chance.choice(rogues)
        named = self._named(word)
        first = {**_rogue(chance), "way": "comes late", **named}
        second = {**_rogue(chance), "way": chance.choice(WAYS), **named}
        return {"reactive_selector": [{word: first}, {word: second}, self._tree(1)]}

    def _cut(self) -> dict[str, Any]:
        chance = self._chance
        ways = {"rogue": chance.choice([STOPS_NOT, RAISES_LAST]), "careless": "faults"}
        leaves = [
            {word: {"way": way, "goal": "fast", "after": NEVER, **self._named(word)}}
            for kind, way in ways.items()
            for word in (f"{kind}_head", f"{kind}_arm")
            if word in self._words
        ]
        if "look" in self._words:
            leaves += [{"look": {"pan": chance.choice(["-75 deg", "75 deg"]), **self._named("look")}}]
        if "mirror" in self._words:
            leaves += [{"mirror": self._led("mirror")}]
        leaf = chance.choice([*leaves, self._leaf()])
        moved = {**leaf, "timeout": _seconds(chance, 0.2, 0.8), "on_failure": "succeed"}
        return {"sequence": [moved, {"wait": _seconds(chance, 1.0, 4.0)}], "repeat": "forever"}

    def _last(self) -> dict[str, Any]:
        rogues = [word for word in self._words if word.startswith("rogue_")]
        if not rogues:
            return self._tree(3)
        word = self._chance.choice(rogues)
        return {word: {"way": LEFT, "goal": "fast", "after": self._chance.randint(1, 10), **self._named(word)}}

    def _leaf(self) -> dict[str, Any]:
        chance = self._chance
        rogues = [word for word in self._words if word.startswith(("rogue", "careless"))]
        words = rogues if chance.random() < ROGUES else self._words
        if self._others and chance.random() < OF_OTHERS:
            words = [each for each in words if each in LED or _kind_of(each) in self._others.values()] or words
        word = chance.choice(words)
        if word in ("move_joints", "sweep"):
            return {word: self._moved(word)}
        if word in LED:
            return {word: self._led(word)}
        given, named = LEAVES[word][1](chance), self._named(word)
        if named and not isinstance(given, dict):
            given = {next(each.name for each in _leaf_of(word).arguments.values() if each.principal): given}
        return {word: given | named if named else given}

    def _has(self, word: str, needs: Collection[str]) -> bool:
        """Whether the robot has what a leaf needs, or another of the kind that the leaf can be told to use."""
        missing = {*needs} - self._parts
        return not missing or (missing == {_kind_of(word)} and missing <= {*self._others.values()})

    def _named(self, word: str) -> dict[str, str]:
        """Return what says on which part a leaf works, by chance; nothing where there is no other, or it is not it."""
        kind = _kind_of(word)
        names = [name for name, its in self._others.items() if its == kind]
        if not names:
            return {}
        name = self._chance.choice([*names, *({kind} & self._parts)])
        return {} if name == kind else {"on": name}

    def _moved(self, word: str) -> dict[str, Any]:
        """Return what an arm is to do, by itself."""
        chance, arm = self._chance, self._arm()
        on = {} if arm == "arm" else {"on": arm}
        if word == "move_joints":
            goals = {joint: self._within(arm, joint) for joint in self._some(arm)}
            return {"to": goals, "speed": f"{chance.randint(5, 60)} deg/s", **on}
        joint = self._some(arm)[0]
        ends = sorted((self._within(arm, joint), self._within(arm, joint)), key=lambda it: float(it.split()[0]))
        return {"joints": [joint], "between": ends, "period": _seconds(chance, 2, 6), **on}

    def _led(self, word: str) -> dict[str, Any]:
        """Return which joints lead which, of one arm or of two."""
        chance, leader, follower = self._chance, self._arm(), self._arm()
        given: dict[str, Any] = {"on": follower} if leader == follower else {"on": follower, "leader_arm": leader}
        if word == "mirror" and leader != follower and chance.random() < 0.5:
            return given  # those of one name
        given |= {"leader": self._some(leader)[0], "follower": self._some(follower)[0]}
        given["scale"] = round(chance.uniform(-2, 2), 1)
        return given | ({"past": f"{chance.randint(0, 20)} deg"} if word == "follow_joint" else {})

    def _arm(self) -> str:
        return self._chance.choice(sorted(self._joints)) if len(self._joints) > 1 else next(iter(self._joints))

    def _some(self, arm: str) -> list[str]:
        joints = self._joints[arm]
        return self._chance.sample(sorted(joints), self._chance.randint(1, min(3, len(joints))))

    def _within(self, arm: str, joint: str) -> str:
        return f"{self._chance.uniform(*self._joints[arm][joint]):.0f} deg"


def _leaf_of(word: str) -> type[Leaf]:
    return OWN.get(word) or KNOWN[word]


def _kind_of(word: str) -> str:
    """Return the kind of part that a leaf can be told to use; nothing for one that cannot."""
    leaf = OWN.get(word) or KNOWN.get(word)
    on = None if leaf is None else leaf.arguments.get("on")
    return on.kind if on is not None and on.kind in REPEATABLE_KINDS else ""
