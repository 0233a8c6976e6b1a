"""Texts of the view: lines with signs, in colours that only repeat the information."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from typing import Any, NamedTuple

from rich.text import Text

from missions.trees.drawing import ACTIVE, ASCII_SIGNS, SIGNS, NodeState, Status, TreeBox, TreeDrawing

STYLES: Mapping[str, str] = {
    "idle": "#8a8a8a",
    "running": "bold #5fb7f0",
    "suspended": "bold #e0c060",
    "success": "#4fc08d",
    "skipped": "#8a8a8a",
    "failure": "bold #f08a5d",
}
"""Colours of statuses, as distinguishable as possible with any kind of colour vision."""

DIM, GOOD, POOR, BAD = "#8a8a8a", "#4fc08d", "#e0c060", "bold #f08a5d"


class LevelSign(NamedTuple):
    """Sign and colour for the health of a part, such as WARN; ``ascii`` is the sign without Unicode."""

    sign: str
    ascii: str
    style: str


LEVELS: Mapping[str, LevelSign] = {
    "OK": LevelSign("✓", "+", GOOD),
    "WARN": LevelSign("!", "!", POOR),
    "ERROR": LevelSign("✗", "x", BAD),
    "STALE": LevelSign("…", "~", POOR),
}
"""Sign of each health level of a part; ``missions.executive.parts`` defines the levels."""

LOG_STYLES: Mapping[str, str] = {
    "✗": BAD,
    "error:": BAD,
    "critical:": BAD,
    "!": POOR,
    "warning:": POOR,
    "robot:": "bold",
}
"""Colour of a log line, by a word near its beginning, such as "error:"."""

ASCII_TABLE = str.maketrans({"✓": "+", "✗": "x", "…": "~", "°": "deg", "\N{REPLACEMENT CHARACTER}": "?"})
"""Replacements of the view's Unicode signs by ASCII, for ``str.translate``."""

FIGURE_FORMATS: Mapping[str, tuple[str, float]] = {
    "battery": ("battery {:.0f} %", 1.0),
    "speed": ("{:z.2f} m/s", 1.0),
    "x": ("x {:z.2f}", 1.0),
    "y": ("y {:z.2f} m", 1.0),
    "heading": ("{:z.0f}°", degrees(1.0)),
    "turn": ("{:z.0f}°/s", degrees(1.0)),
    "pan": ("pan {:z.0f}°", degrees(1.0)),
    "tilt": ("tilt {:z.0f}°", degrees(1.0)),
    "nearest": ("nearest {:z.2f} m", 1.0),
    "joints": ("{:.0f} joints", 1.0),
    "moving": ("{:.0f} moving", 1.0),
    "hottest": ("up to {:.0f} °C", 1.0),
}
"""Formats of the values of parts, in this order, with the factor from SI units."""


@dataclass(slots=True)
class ViewState:
    """State of a run as known from its messages to the view; ``plain`` for a terminal with ASCII only."""

    plain: bool = False
    mission: str = ""
    robot: str = ""
    t: float = 0.0
    tick: int = 0
    lates: int = 0
    paused: bool = False
    stopping: bool = False
    inside: dict[str, str] = field(default_factory=dict)  # the names of the missions inside, by the keys of their nodes
    nodes: dict[str, NodeState] = field(default_factory=dict)
    variables: dict[str, str] = field(default_factory=dict)
    parts: Sequence[Mapping[str, Any]] = ()

    def apply(self, message: Mapping[str, Any]) -> None:
        """Apply the changes in a message of ``missions.trees.feed``, except for the log."""
        for name in ("t", "tick", "lates", "paused", "stopping", "parts"):
            if name in message:
                setattr(self, name, message[name])
        for key, now in message.get("changed", {}).items():
            self.nodes[key] = NodeState(*now)
        for name, value in message.get("variables", {}).items():
            self.variables[name] = value
            if value is None:
                del self.variables[name]

    def set_drawing(self, drawing: TreeDrawing, robot: str) -> None:
        """Set the tree drawing of the mission and the name of the robot."""
        self.mission, self.robot = drawing.mission, robot
        self.inside = {box.key: box.mission for box in drawing.root.walk() if box.mission}

    def node_status(self, key: str) -> NodeState:
        """Return the status of the node with this key."""
        return self.nodes.get(key, NodeState())

    def status_sign(self, status: Status) -> str:
        """Return the sign of a node status, in Unicode or ASCII."""
        return (ASCII_SIGNS if self.plain else SIGNS)[status]

    def newest_running_leaf(self, root: TreeBox) -> str:
        """Return the key of the running leaf that started last; empty if there is none."""
        running = (box.key for box in root.walk() if not box.children and self.node_status(box.key).status in ACTIVE)
        return max(running, key=lambda key: self.node_status(key).since, default="")


def node_label(box: TreeBox, scene: ViewState) -> Text:
    """Return the line of a node: sign and title, running time, reason, and modifiers."""
    now = scene.node_status(box.key)
    line = Text(f"{box.case}: " if box.case else "", style=DIM, no_wrap=True)
    line.append(f"{scene.status_sign(now.status)} {box.title}", style=STYLES[now.status])
    seconds = int(scene.t - now.since)
    if now.status in ACTIVE and not box.children and seconds > 0:
        line.append(f"  {seconds} s", style=DIM)
    if reason := _node_reason(box, scene):
        line.append(f"  {reason}", style=STYLES["failure"] if now.status == "failure" else "")
    for badge in box.badges:
        status = scene.node_status(badge.key).status
        sign = f"{scene.status_sign(status)} " if status == "failure" else ""
        line.append(f"  [{sign}{badge.kind}: {badge.text}]", style=STYLES["failure"] if sign else DIM)
    return line


def _node_reason(box: TreeBox, scene: ViewState) -> str:
    """Return the reason of a node's status; if one of its modifiers has failed, the reason of that failure."""
    badges = (scene.node_status(badge.key) for badge in box.badges)
    failed = next((now.reason for now in badges if now.status == "failure" and now.reason), "")
    return failed or scene.node_status(box.key).reason


def header_line(scene: ViewState, width: int, silence: float = 0.0) -> Text:
    """Return the first line: mission, robot and progress; ``silence`` is the time since the last message (s)."""
    left = Text.assemble((f" {scene.mission}", "bold"), (f" on {scene.robot}" if scene.robot else "", DIM))
    right = Text()
    if scene.lates:
        right.append(f"{scene.lates} late   ", style=POOR)
    right.append(f"tick {scene.tick}   {scene.t:.1f} s   ", style=DIM)
    if silence > 0.0:
        right.append(f"{_level_label('STALE', scene)}: no message for {silence:.0f} s ", style=POOR)
    elif scene.stopping:
        right.append("stopping ", style=BAD)
    elif scene.paused:
        right.append("paused ", style=POOR)
    else:
        right.append("running ", style=STYLES["running"])
    left.truncate(max(0, width - right.cell_len), pad=True)
    return left + right


def footer_line(scene: ViewState) -> Text:
    """Return the last line: the keys and their present actions."""
    keys = (
        ("space", "resume" if scene.paused else "pause"),
        *((("n", "step"),) if scene.paused else ()),
        ("s", "stop now" if scene.stopping else "stop"),
        ("/", "search"),
        ("f", "fold"),
        ("r", "follow"),
    )
    return Text(" ") + Text("   ").join(Text.assemble((key, "bold"), (f" {does}", DIM)) for key, does in keys)


def part_lines(scene: ViewState) -> Text:
    """Return a line for each part of the robot: level, age of its reading, and values or problem."""
    return Text("\n").join(line for part in scene.parts for line in _lines_of_part(part, scene))


def _lines_of_part(part: Mapping[str, Any], scene: ViewState) -> Iterator[Text]:
    level, age = part["level"], part["age"]
    line = Text.assemble(
        (f"{_level_label(level, scene):<7} ", LEVELS[level].style),
        f"{part['part']:<7} ",
        (f"{'' if age is None else f'{age:.1f} s':>6}  ", DIM),
    )
    if part["detail"]:
        line.append(part["detail"], style=LEVELS[level].style)
    else:
        line.append(_to_displayable(format_figures(part["values"]), scene))
    yield line
    if part["hint"]:
        yield Text(f"        try: {part['hint']}", style=DIM)


def format_figures(values: Mapping[str, float]) -> str:
    """Return the values of a part in display units."""
    written = (form.format(values[name] * factor) for name, (form, factor) in FIGURE_FORMATS.items() if name in values)
    return "  ".join(written)


def variable_lines(scene: ViewState) -> Text:
    """Return a line with name and value for each variable of the mission."""
    lines = (Text.assemble((f"{_variable_name(name, scene)} ", DIM), value) for name, value in scene.variables.items())
    return Text("\n").join(lines)


def _variable_name(name: str, scene: ViewState) -> str:
    """Return the display name of a variable; in a sub-mission, with the name of that mission instead of a node key."""
    key, _, inner = name.rpartition(" ")
    return f"{scene.inside.get(key, key)}: {inner}" if key else name


def log_line(line: str, scene: ViewState) -> Text:
    """Return a line of the log, coloured if it reports a problem."""
    words = line.split()
    trouble = next((style for sign, style in LOG_STYLES.items() if sign in words[:4]), "")
    return Text(_to_displayable(line, scene), style=trouble)


def node_details(box: TreeBox, scene: ViewState) -> Text:
    """Return the details of a node in one line: file, line, title, arguments, variable and reason."""
    arguments = ", ".join(f"{name}: {text}" for name, text in box.untitled_arguments.items())
    said = (
        f"{{{arguments}}}" if arguments else "",
        f"as {box.keep_as}" if box.keep_as else "",
        _node_reason(box, scene),
    )
    return Text("  ").join(
        (Text(f" {box.file}:{box.line}", style=DIM), Text(box.title), *(Text(each) for each in said if each))
    )


def _to_displayable(text: str, scene: ViewState) -> str:
    return text.translate(ASCII_TABLE) if scene.plain else text


def _level_label(level: str, scene: ViewState) -> str:
    sign = LEVELS[level]
    return f"{sign.ascii if scene.plain else sign.sign} {level}"
