"""What a view shows, in words: lines of text with signs, of which colours only say more of the same."""

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
"""Colours for statuses that people with any kind of colour vision tell apart, as far as colours can."""

DIM, GOOD, POOR, BAD = "#8a8a8a", "#4fc08d", "#e0c060", "bold #f08a5d"


class LevelSign(NamedTuple):
    """How a level is shown."""

    sign: str
    ascii: str
    style: str


LEVELS: Mapping[str, LevelSign] = {
    "OK": LevelSign("✓", "+", GOOD),
    "WARN": LevelSign("!", "!", POOR),
    "ERROR": LevelSign("✗", "x", BAD),
    "STALE": LevelSign("…", "~", POOR),
}
"""The levels of parts, in the words of ``missions.executive.parts``."""

LOG_STYLES: Mapping[str, str] = {
    "✗": BAD,
    "error:": BAD,
    "critical:": BAD,
    "!": POOR,
    "warning:": POOR,
    "robot:": "bold",
}
"""Words among the first of a line of the log, and the colour that they give it."""

ASCII_TABLE = str.maketrans({"✓": "+", "✗": "x", "…": "~", "°": "deg", "\N{REPLACEMENT CHARACTER}": "?"})
"""Signs of ours where there is only ASCII."""

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
"""How the figures of parts are written, in this order: a form, and what one SI unit is in it."""


@dataclass(slots=True)
class ViewState:
    """All that a view knows of a run; ``plain`` where its terminal has no other signs than ASCII's."""

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
        """Take in what a message of ``missions.trees.feed`` says is new, but for the log."""
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
        """Take in what is run, on what."""
        self.mission, self.robot = drawing.mission, robot
        self.inside = {box.key: box.mission for box in drawing.root.walk() if box.mission}

    def node_status(self, key: str) -> NodeState:
        """Return what the node with this key is doing."""
        return self.nodes.get(key, NodeState())

    def status_sign(self, status: Status) -> str:
        """Return the sign of a status."""
        return (ASCII_SIGNS if self.plain else SIGNS)[status]

    def newest_running_leaf(self, root: TreeBox) -> str:
        """Return the key of the leaf that has begun last of those that run; empty where none does."""
        running = (box.key for box in root.walk() if not box.children and self.node_status(box.key).status in ACTIVE)
        return max(running, key=lambda key: self.node_status(key).since, default="")


def node_label(box: TreeBox, scene: ViewState) -> Text:
    """Return the line of a node: its sign and title, why it is so and for how long, and its modifiers."""
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
    """Return why a node is as it is; first what a modifier that has failed says."""
    badges = (scene.node_status(badge.key) for badge in box.badges)
    failed = next((now.reason for now in badges if now.status == "failure" and now.reason), "")
    return failed or scene.node_status(box.key).reason


def header_line(scene: ViewState, width: int, silence: float = 0.0) -> Text:
    """Return the first line: which mission on what, and how it goes; ``silence`` is how long nothing came (s)."""
    left = Text.assemble((f" {scene.mission}", "bold"), (f" on {scene.robot}" if scene.robot else "", DIM))
    right = Text()
    if scene.lates:
        right.append(f"{scene.lates} late   ", style=POOR)
    right.append(f"tick {scene.tick}   {scene.t:.1f} s   ", style=DIM)
    if silence > 0.0:
        right.append(f"{_level_label('STALE', scene)}: no news for {silence:.0f} s ", style=POOR)
    elif scene.stopping:
        right.append("stopping ", style=BAD)
    elif scene.paused:
        right.append("paused ", style=POOR)
    else:
        right.append("running ", style=STYLES["running"])
    left.truncate(max(0, width - right.cell_len), pad=True)
    return left + right


def footer_line(scene: ViewState) -> Text:
    """Return the last line: the keys, and what they do now."""
    keys = (
        ("space", "go on" if scene.paused else "pause"),
        *((("n", "one tick"),) if scene.paused else ()),
        ("s", "stop at once" if scene.stopping else "stop"),
        ("/", "search"),
        ("f", "fold"),
        ("r", "follow"),
    )
    return Text(" ") + Text("   ").join(Text.assemble((key, "bold"), (f" {does}", DIM)) for key, does in keys)


def part_lines(scene: ViewState) -> Text:
    """Return a line for each part of the robot: its level, how old its reading is, and that or what is the matter."""
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
    """Return the figures of a part as people read them."""
    written = (form.format(values[name] * factor) for name, (form, factor) in FIGURE_FORMATS.items() if name in values)
    return "  ".join(written)


def variable_lines(scene: ViewState) -> Text:
    """Return a line for each variable."""
    lines = (Text.assemble((f"{_variable_name(name, scene)} ", DIM), value) for name, value in scene.variables.items())
    return Text("\n").join(lines)


def _variable_name(name: str, scene: ViewState) -> str:
    """Return the name of a variable; one of a mission inside, which comes with the key of its node, with its name."""
    key, _, inner = name.rpartition(" ")
    return f"{scene.inside.get(key, key)}: {inner}" if key else name


def log_line(line: str, scene: ViewState) -> Text:
    """Return a line of the log, in a colour where it tells of trouble."""
    words = line.split()
    trouble = next((style for sign, style in LOG_STYLES.items() if sign in words[:4]), "")
    return Text(_to_displayable(line, scene), style=trouble)


def node_details(box: TreeBox, scene: ViewState) -> Text:
    """Return all of one node in a line: what the file says of it, where, and why it is as it is."""
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
