"""Messages as a run of a small mission sends them to its view."""

from collections.abc import Mapping

from missions.trees.drawing import Badge, Box, Drawing, to_json

Message = Mapping[str, object]

GREET = Box(
    "1",
    "sequence",
    "sequence",
    "→",
    "greet.yaml",
    3,
    children=(
        Box(
            "1.1.1",
            "find_face",
            "find_face",
            "■",
            "greet.yaml",
            4,
            arguments={"pan": "[-60 deg, 60 deg]", "speed": "20 deg/s"},
            badges=(Badge("1.1", "timeout", "60 s", 5),),
        ),
        Box(
            "1.2",
            "mission",
            "mission",
            "▣",
            "greet.yaml",
            6,
            mission="wave",
            children=(Box("1.2.1", "gesture", "gesture", "■", "wave.yaml", 3, said="hello"),),
        ),
        Box("1.3", "say", "say", "■", "greet.yaml", 7, said="[bold]Hello!"),
    ),
)


def first(root: Box = GREET) -> Message:
    """Return the message that comes before all others."""
    return {"drawing": to_json(Drawing("greet", "Greet.", "greet.yaml", root)), "robot": "turtlebot2_arm"}


def news(t: float = 0.0, **what: object) -> Message:
    """Return a message of what is new."""
    return {"t": t, "tick": int(20 * t), "late": 0.0, "lates": 0, "paused": False, "stopping": False, **what}


def part(level: str, **what: object) -> Message:
    """Return a part of the robot as a message has it."""
    return {"part": "base", "level": level, "age": 0.1, "values": {}, "detail": "", "hint": "", **what}


def many(missions: int, leaves: int) -> Box:
    """Return a tree of that many missions of that many leaves each."""
    inside = (
        Box(
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
    return Box("1", "sequence", "sequence", "→", "long.yaml", 1, children=tuple(inside))


def _leaves(key: str, count: int) -> tuple[Box, ...]:
    return tuple(Box(f"{key}.{i}", "wait", f"wait {key}.{i}", "■", "part.yaml", i) for i in range(1, count + 1))
