"""Messages as a run of a small mission sends them to its view."""

from collections.abc import Mapping

from missions.trees.drawing import Badge, TreeBox, TreeDrawing, to_json

Message = Mapping[str, object]

GREET = TreeBox(
    "1",
    "sequence",
    "sequence",
    "→",
    "greet.yaml",
    3,
    children=(
        TreeBox(
            "1.1.1",
            "find_face",
            "find_face",
            "■",
            "greet.yaml",
            4,
            arguments={"pan": "[-60 deg, 60 deg]", "speed": "20 deg/s"},
            badges=(Badge("1.1", "timeout", "60 s", 5),),
        ),
        TreeBox(
            "1.2",
            "mission",
            "mission",
            "▣",
            "greet.yaml",
            6,
            mission="wave",
            children=(TreeBox("1.2.1", "gesture", "gesture", "■", "wave.yaml", 3, said="hello"),),
        ),
        TreeBox("1.3", "say", "say", "■", "greet.yaml", 7, said="[bold]Hello!"),
    ),
)


def first(root: TreeBox = GREET) -> Message:
    """Return the message that comes before all others."""
    return {"drawing": to_json(TreeDrawing("greet", "Greet.", "greet.yaml", root)), "robot": "turtlebot2_arm"}


def news(t: float = 0.0, **what: object) -> Message:
    """Return a message of what is new."""
    return {"t": t, "tick": int(20 * t), "late": 0.0, "lates": 0, "paused": False, "stopping": False, **what}


def part(level: str, **what: object) -> Message:
    """Return a part of the robot as a message has it."""
    return {"part": "base", "level": level, "age": 0.1, "values": {}, "detail": "", "hint": "", **what}


def many(missions: int, leaves: int) -> TreeBox:
    """Return a tree of that many missions of that many leaves each."""
    inside = (
        TreeBox(
            f"1.{number}",
            "mission",
            "mission",
            "▣",
            "long.yaml",
            number,
            mission=f"part_{number}",
            children=_leaves(f"1.{number}", leaves),
        )
        for number in range(1, missions + 1)
    )
    return TreeBox("1", "sequence", "sequence", "→", "long.yaml", 1, children=tuple(inside))


def _leaves(key: str, count: int) -> tuple[TreeBox, ...]:
    return tuple(TreeBox(f"{key}.{i}", "wait", f"wait {key}.{i}", "■", "part.yaml", i) for i in range(1, count + 1))
