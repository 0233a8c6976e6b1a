"""Random missions for exports: of nodes that BehaviorTree.CPP has as well, or of all kinds of nodes."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from random import Random
from typing import Any

from missions.language.nodes import COMPOSITES, MODIFIERS

Tree = dict[str, Any]
VARIABLES = ("a", "b", "c")
LISTS = """params:
  numbers: [1, 2, 3]
  points: [{x: 1 m, y: 0 m}, {x: 2 m, y: 1 m}]
  things: {type: list, of: text, default: ["a b", "5"]}
  limits: [-60 deg, 60 deg]
  way: 1 m
"""
"""Params of missions of all kinds."""
COUNTS = (1, 2, 3)


@dataclass
class Draw:
    """Draws missions from a seed: files by name, of which ``main.yaml`` is the first, and scripts of leaves.

    With ``all_kinds``, there are nodes, leaves and values of all kinds; otherwise only those that BehaviorTree.CPP has,
    and no time passes in them.
    """

    random: Random
    all_kinds: bool = False
    files: dict[str, str] = field(default_factory=dict)
    outcomes: dict[str, str] = field(default_factory=dict)
    _numbers: Iterator[int] = field(default_factory=count)
    _is_main: bool = True

    def mission(self, depth: int = 3) -> None:
        """Draw the main mission, and those that it runs."""
        first: Tree = {"set": {name: self.random.randint(0, 2) for name in VARIABLES} | {"flag": True, "word": "one"}}
        tree: Tree = {"sequence": [first, self.tree(depth, rounds=True)]}
        params = LISTS if self.all_kinds else ""
        self.files["main.yaml"] = f"mission: main\n{params}tree: {json.dumps(tree)}\n"

    def tree(self, depth: int, *, rounds: bool) -> Tree:
        """Draw a node with modifiers; without ``rounds``, none below begins a round at another tick than there."""
        tree = self._node(depth, rounds=rounds)
        for word in self.random.sample(sorted(self._modifiers()), self.random.choice((0, 0, 0, 1, 1, 2))):
            if word in ("retry", "repeat", "while", "until", "for") and not (rounds or self.all_kinds):
                continue
            if word in ("while", "until", "for") and not self.all_kinds and depth:
                tree = self._node(0, rounds=False)
            tree[word] = self._modifiers()[word]()
            if self.all_kinds and word in ("retry", "finally") and self.random.random() < 0.4:
                tree |= {"recover": self._recovery()} if word == "retry" else {"halt_limit": "2 s"}
        return tree

    def _node(self, depth: int, *, rounds: bool) -> Tree:
        random = self.random
        if depth == 0:
            return self._leaf()
        draw = random.randrange(12)
        if draw < 4 or (draw < 6 and not self.all_kinds):
            word = random.choice(("sequence", "selector", "reactive_sequence", "reactive_selector"))
            inner = rounds and not word.startswith("reactive")
            return self._named({word: [self.tree(depth - 1, rounds=inner) for _ in range(random.randint(1, 3))]})
        if draw < 6:
            return self._composite(depth)
        if draw < 8:
            return self._parallel(depth)
        if draw == 8:
            return self._switch(depth, rounds=rounds)
        if draw == 9 and rounds:
            return self._named({"wait_for": self.tree(depth - 1, rounds=True)})
        if draw == 10:
            return self._submission(depth)
        if draw == 11 and self.all_kinds:
            return self._named({"for_each": self._loop(depth)})
        return self._leaf()

    def _composite(self, depth: int) -> Tree:
        random = self.random
        word = random.choice(sorted(COMPOSITES))
        children = [self.tree(depth - 1, rounds=False) for _ in range(random.randint(1, 3))]
        more: Tree = {"in_turn": True} if word == "selector" and random.random() < 0.5 else {}
        if word == "random_selector" and random.random() < 0.6:
            more = {"weights": random.choice(([random.randint(1, 3) for _ in children], ["50 %"] * len(children)))}
            if self._is_main and len(children) == 3 and random.random() < 0.4:
                more = {"weights": "${numbers}"}
        return self._named({word: children, **more})

    def _loop(self, depth: int) -> Tree:
        random = self.random
        name = f"m{next(self._numbers)}"
        lists: list[Any] = [
            [1, 2],
            ["x", "y"],
            "[a, b]",
            "[a] + [b, 2]",
            [{"x": 1, "say": "a: b"}, {"x": 2, "say": "5"}],
        ]
        if self._is_main:
            lists += ["numbers", "points", "${things}"]
        loop: Tree = {"in": random.choice(lists), "as": name, "do": self.tree(depth - 1, rounds=False)}
        if loop["in"] == "points" and random.random() < 0.7:
            loop["do"] = {"go_to": {"x": f"${{{name}.x}}", "y": f"${{{name}.y}}"}}
        return {**loop, **({"number": f"k{name}"} if random.random() < 0.3 else {})}

    def _named(self, tree: Tree) -> Tree:
        return tree if self.random.random() < 0.3 else {**tree, "name": f"n{next(self._numbers)}"}

    def _parallel(self, depth: int) -> Tree:
        random = self.random
        children = [self.tree(depth - 1, rounds=False) for _ in range(random.randint(1, 3))]
        if random.random() < 0.4:
            return self._named({"race": children})
        counts = {
            word: random.choice((*COUNTS, "all"))
            for word in ("success_count", "failure_count")
            if random.random() < 0.4
        }
        return self._named(
            {"parallel": children, **counts, **({"wait_for_all": True} if random.random() < 0.3 else {})}
        )

    def _switch(self, depth: int, *, rounds: bool) -> Tree:
        random = self.random
        word = random.choice(("switch", "reactive_switch"))
        inner = rounds and word == "switch"
        if word == "switch" or random.random() < 0.5:
            cases: tuple[str, ...] = random.choice((("true",), ("false",), ("true", "false")))
            on = self._condition()
        else:
            cases, on = random.choice((("0", "1"), ("0", "1", "2"))), random.choice(VARIABLES)
        switch: Tree = {"on": on, "cases": {each: self.tree(depth - 1, rounds=inner) for each in cases}}
        if cases != ("true", "false") and random.random() < 0.6:
            switch["default"] = self.tree(depth - 1, rounds=inner)
        return self._named({word: switch})

    def _submission(self, depth: int) -> Tree:
        """Draw a mission that reads ``given``, and sets ``found`` at its start."""
        if not self._is_main:
            return self._leaf()
        name = f"part_{next(self._numbers)}"
        self._is_main = False
        first = {"set": {"found": "${given + 1}", "a": "${given}", "b": 1, "c": 2, "flag": False, "word": "two"}}
        tree = {"sequence": [first, self.tree(depth - 1, rounds=False)]}
        self._is_main = True
        returns = "returns: {found: found}\n" if self.random.random() < 0.5 else ""
        params: Tree = {"given": 1}
        call: Tree = {"mission": name, "with": {"given": "${a}" if self.random.random() < 0.5 else 2}}
        if self.all_kinds:
            params |= {"rooms": ["hall", "study"], "far": "1 m", "places": [{"x": "1 m"}]}
            others = {"rooms": ["a: b", "5"], "far": "${way * 2}", "places": [{"x": "2 m"}, {"x": "50 cm"}]}
            call["with"] |= {key: value for key, value in others.items() if self.random.random() < 0.5}
        self.files[f"{name}.yaml"] = (
            f"mission: {name}\nparams: {json.dumps(params)}\ntree: {json.dumps(tree)}\n{returns}"
        )
        if not returns:
            call["returns"] = {f"found_{next(self._numbers)}": "found"}
        return self._named(call)

    def _leaf(self) -> Tree:
        random = self.random
        draw = random.randrange(12)
        if draw == 0:
            return {"check": self._condition()}
        if draw == 1:
            return {"set": self._assignment()}
        if draw == 2:
            return random.choice(({"succeed": None}, {"fail": "as drawn"}, {"fail": None}))
        if draw == 3 and not self.all_kinds:
            return {"wait_until": self._condition()}
        if draw > 6 and self.all_kinds:
            return self._other_leaf()
        name = f"n{next(self._numbers)}"
        self.outcomes[name] = "".join(random.choices("RSF", k=random.randint(1, 4)))
        return {"probe": None, "name": name}

    def _other_leaf(self) -> Tree:
        if self._is_main and self.random.random() < 0.2:
            return self.random.choice(
                (
                    {"navigate_through": "${points}"},
                    {"find_face": {"pan": "${limits}"}},
                    {"listen": {"for": "${things}"}},
                    {"set": {"numbers": "${numbers + [a]}"}},
                    {"switch": {"on": "way", "cases": {"1 m": {"succeed": None}, "2 m": {"fail": None}}}},
                    {"drive": "${way}"},
                )
            )
        return self.random.choice(
            (
                {"drive": "1 m"},
                {"drive": {"distance": "${a * 1 m}", "speed": "0.2 m/s"}},
                {"say": "Good day, ${word}"},
                {"say": "{no: pointer}"},
                {"say": "5"},
                {"say": "${word if a > 1 else 'no'}"},
                {"say": "${word}, ${a} times"},
                {"find_face": {"scans": "${a + 1}"}},
                {"set": {"dice": "${random(0, 10)}"}},
                {"check": "random(0, 1) < 0.5"},
                {"set": {"place": {"x": "${base.x}", "say": "${word}", "all": [1, "a: b"]}}},
                {"set": {"seen": [{"x": "1 m", "say": "5"}]}},
                {"find_face": {"pan": ["-60 deg", "60 deg"], "scans": 1}, "as": "person"},
                {"listen": {"for": ["yes", "no: never"], "timeout": "3 s"}, "as": "answer"},
                {"move_joints": {"to": {"elbow": "30 deg", "wrist": "${a * 1 deg}"}}},
                {"wait": "150 ms"},
                {"wait": "${a * 1 s}"},
                {"check": "battery.percent > 20"},
                {"wait_until": "base.x < 3 m or flag"},
                {"set": {"way": "2 m", "list": [1, 2]}},
                {"set": {"a": "${min(a, b)}"}},
                {"notify": 'a "quoted" text\nof two lines, it\'s <b> & so on -- so'},
                {"face_seen": {"within": "1 s"}},
                {"led": "red"},
            )
        )

    def _assignment(self) -> Tree:
        one, other = self.random.sample(VARIABLES, 2)
        return self.random.choice(
            (
                {one: f"${{{other} + {self.random.randint(0, 2)}}}"},
                {one: f"${{{one} - {other} * 2}}", "flag": f"${{{one} < {other}}}"},
                {one: f"${{{other} if flag else 1}}"},
                {"flag": False},
                {"word": "${word}s", one: 3},
                {"word": "two"},
            )
        )

    def _condition(self) -> str:
        one, other = self.random.choices(VARIABLES, k=2)
        number = self.random.randint(0, 2)
        return self.random.choice(
            (
                f"{one} < {number}",
                f"{one} == {other} or not flag",
                f"{one} != {number} and ({other} > 1 or flag)",
                "word == 'one'",
                f"0 <= {one} < {number}",
                "not flag",
                f"not ({one} + {other} > {number})",
            )
        )

    def _modifiers(self) -> Mapping[str, Callable[[], Any]]:
        random = self.random
        known: dict[str, Callable[[], Any]] = {
            "if": self._condition,
            "while": self._condition,
            "until": self._condition,
            "for": lambda: "1 h",
            "timeout": lambda: "1 h",
            "retry": lambda: random.choice((2, 3)),
            "repeat": lambda: random.choice((2, 3)),
            "invert": lambda: True,
            "on_failure": lambda: "succeed",
            "on_success": lambda: "fail",
        }
        if self._is_main:
            known["once"] = lambda: True
        if not self.all_kinds:
            return known

        def duration() -> str:
            return random.choice(("150 ms", "1 s", "${a * 1 s}", "0.5 ms"))

        known |= dict.fromkeys(("for", "timeout", "delay", "hold", "cooldown"), duration)
        known |= {
            "retry": lambda: random.choice((2, "forever", "${a + 1}")),
            "repeat": lambda: random.choice((2, "forever", "${b}")),
            "once": lambda: random.choice((True, "a")),
            "on_running": lambda: random.choice(("succeed", "fail")),
            "if": lambda: random.choice((self._condition(), "battery.percent > 20", "${flag}")),
            "finally": self._recovery,
        }
        assert known.keys() >= MODIFIERS.keys(), MODIFIERS.keys() - known.keys()
        return known

    def _recovery(self) -> Tree:
        return self.random.choice(({"log": "${failure}"}, {"log": "${word}"}, {"set": {"a": 1}}, {"succeed": None}))


def draw_mission(seed: int, *, all_kinds: bool = False) -> Draw:
    """Return the mission of a seed."""
    draw = Draw(Random(seed), all_kinds=all_kinds)  # noqa: S311 - as a test draws
    draw.mission()
    return draw
