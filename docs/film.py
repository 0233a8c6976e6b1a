"""Draw the film of `greet` for the README: camera, room and face beside the tree with its running nodes.

    python -m docs.film

The run is simulated with a fixed seed, so the film changes only with the mission, the simulation or this module.
"""

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib import get_data_path
from PIL import Image, ImageDraw, ImageFont

from missions.library.shipped import load_mission
from missions.trees.drawing import SIGNS, TreeBox
from missions.trees.drawing_builder import drawing_of

FILM = Path(__file__).parent / "studio" / "greet.webp"

FRAME_INTERVAL = 0.08
"""Seconds between two pictures of `mission run --film`."""

LAST_FRAME_TIME = 2.5
"""Seconds for which the last frame is shown before the film starts again."""

SIZE = (1000, 550)
VIEW = (440, 330)
MAP = (293, 220)
FACE = (147, 220)

PAPER, INK, GREY, LINE = "#ffffff", "#1a2330", "#5b6675", "#d5dbe3"
COLOURS: Mapping[str, tuple[str, str]] = {
    "idle": (PAPER, "#aab3bf"),
    "running": ("#dfeaf8", "#0b5cad"),
    "suspended": ("#dfeaf8", "#0b5cad"),
    "success": (PAPER, "#0f7a4f"),
    "skipped": (PAPER, "#aab3bf"),
    "failure": (PAPER, "#a8341b"),
}
"""Background and accent of a row, by the status of its node."""

ROW = 37
INDENT = 24
LEFT = VIEW[0] + 24

REASON_TIME = 0.6
"""Seconds for which the reason of a running node is shown."""

Status = tuple[str, str, float]
"""A status, its reason, and its start in seconds."""

IDLE: Status = ("idle", "", 0.0)


def main() -> None:
    """Run `greet`, draw the film, and print its size."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        events, pictures = run(folder)
        rows = list(tree_rows(drawing_of(load_mission("greet")).root))
        frames = [
            frame(Image.open(picture).convert("RGB"), rows, events, number * FRAME_INTERVAL)
            for number, picture in enumerate(pictures)
        ]
    frames.append(frame(frames[-1].copy(), rows, events, ended(events), panes=False))
    lasts = [round(1000 * FRAME_INTERVAL)] * (len(frames) - 1) + [round(1000 * LAST_FRAME_TIME)]
    frames[0].save(
        FILM, save_all=True, append_images=frames[1:], duration=lasts, loop=0, quality=70, method=6, minimize_size=True
    )
    sys.stdout.write(f"wrote {FILM.name}: {len(frames)} frames, {FILM.stat().st_size / 1e6:.2f} MB\n")


def run(folder: Path) -> tuple[Sequence[Mapping[str, object]], Sequence[Path]]:
    """Run the mission in simulated time; return its events and the pictures of its film."""
    asked = ["run", "greet", "--simulate", "fast", "--seed", "1"]
    places = ["--film", str(folder / "film"), "--events", str(folder / "events.jsonl")]
    subprocess.run([sys.executable, "-m", "missions", *asked, *places], check=True, capture_output=True)  # noqa: S603
    lines = (folder / "events.jsonl").read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines], sorted((folder / "film").iterdir())


def ended(events: Sequence[Mapping[str, object]]) -> float:
    """Return the end of the run in seconds."""
    return max(seconds(event) for event in events)


def seconds(event: Mapping[str, object]) -> float:
    """Return the time of an event."""
    return float(str(event["t"]))


def tree_rows(box: TreeBox, depth: int = 0) -> Iterator[tuple[int, TreeBox]]:
    """Yield each node with its depth, in the order of the file."""
    yield depth, box
    for child in box.children:
        yield from tree_rows(child, depth + 1)


def statuses_at(events: Sequence[Mapping[str, object]], time: float) -> Mapping[str, Status]:
    """Return the status of each node at ``time``, by its key."""
    changes = (event for event in events if event["event"] == "node_changed" and seconds(event) <= time + 1e-6)
    return {str(event["node"]): (str(event["status"]), str(event["reason"]), seconds(event)) for event in changes}


def frame(
    picture: Image.Image,
    rows: Sequence[tuple[int, TreeBox]],
    events: Sequence[Mapping[str, object]],
    time: float,
    *,
    panes: bool = True,
) -> Image.Image:
    """Return a frame of the film; without ``panes``, ``picture`` is a frame whose tree is drawn again."""
    image = Image.new("RGB", SIZE, PAPER) if panes else picture
    draw = ImageDraw.Draw(image)
    if panes:
        height = picture.height
        camera = picture.crop((0, 0, height * 4 // 3, height)).resize(VIEW, Image.Resampling.LANCZOS)
        above = picture.crop((height * 4 // 3, 0, height * 8 // 3, height)).resize(MAP, Image.Resampling.LANCZOS)
        face = picture.crop((height * 8 // 3, 0, picture.width, height)).resize(FACE, Image.Resampling.LANCZOS)
        image.paste(camera, (0, 0))
        image.paste(above, (0, VIEW[1]))
        image.paste(face, (MAP[0], VIEW[1]))
        mark_face(draw, events, time, VIEW[0] / (height * 4 / 3))
        for text, (x, y) in (("camera", (8, 6)), ("from above", (8, VIEW[1] + 6)), ("face", (MAP[0] + 8, VIEW[1] + 6))):
            label(draw, text, (x, y))
    draw_tree(draw, rows, statuses_at(events, time), time)
    return image


def mark_face(draw: ImageDraw.ImageDraw, events: Sequence[Mapping[str, object]], time: float, scale: float) -> None:
    """Draw a box around the face that the detector found at ``time``."""
    percepts = (event for event in events if event["event"] == "percept")
    seen = {abs(float(str(event["stamp"])) - time): event["faces"] for event in percepts}
    offset = min(seen, default=1.0)
    faces = seen[offset] if offset < FRAME_INTERVAL else ()
    for face in faces if isinstance(faces, list) else ():
        x, y, width, height = (float(value) * scale for value in face["box"])
        draw.rectangle((x, y, x + width, y + height), outline="#ffb000", width=3)


def label(draw: ImageDraw.ImageDraw, text: str, place: tuple[float, float]) -> None:
    """Write a label on a dark background."""
    x, y = place
    width = draw.textlength(text, font(13))
    draw.rounded_rectangle((x - 4, y - 2, x + width + 5, y + 17), 4, fill="#1a2330")
    draw.text((x, y), text, fill="#ffffff", font=font(13))


def draw_tree(
    draw: ImageDraw.ImageDraw, rows: Sequence[tuple[int, TreeBox]], now: Mapping[str, Status], time: float
) -> None:
    """Draw the tree with one row for each node, with its status."""
    draw.rectangle((VIEW[0], 0, *SIZE), fill=PAPER)
    draw.line((VIEW[0], 0, VIEW[0], SIZE[1]), fill=LINE)
    draw.text((LEFT, 16), "mission run greet", fill=INK, font=font(22, bold=True))
    draw.text((SIZE[0] - 20, 20), f"{time:.1f} s", fill=GREY, font=font(18), anchor="ra")
    for number, (depth, box) in enumerate(rows):
        draw_row(draw, 62 + number * ROW, depth, box, now, time)
    status, _, _ = now.get("1", IDLE)
    if status == "success":
        draw.text((LEFT, 514), f"✓ success after {time:.1f} s", fill=COLOURS["success"][1], font=font(18, bold=True))


def draw_row(
    draw: ImageDraw.ImageDraw, y: int, depth: int, box: TreeBox, now: Mapping[str, Status], time: float
) -> None:
    """Draw one node: status, symbol, title and modifiers, and its reason at the right while it runs."""
    status, reason, since = now.get(box.key, IDLE)
    outer, _, _ = now.get(box.badges[0].key, IDLE) if box.badges else (status, reason, since)
    shown = outer if outer in ("running", "suspended") else status
    ground, accent = COLOURS[shown]
    x = LEFT + depth * INDENT
    draw.rounded_rectangle((x, y, SIZE[0] - 16, y + ROW - 5), 6, fill=ground)
    draw.rectangle((x, y, x + 4, y + ROW - 5), fill=accent)
    draw.text((x + 14, y + 6), SIGNS[shown], fill=accent, font=font(17, bold=True))  # type: ignore[index]
    draw.text((x + 38, y + 6), box.symbol, fill=GREY, font=font(17))
    x += 64
    strong = shown in ("running", "suspended")
    for text, colour, size in (
        (box.title, INK if shown != "idle" else GREY, font(17, bold=strong)),
        *((f"{badge.kind} {badge.text}", "#7a5200", font(14)) for badge in box.badges),
        (f"as {box.keep_as}" if box.keep_as else "", GREY, font(14)),
    ):
        if text:
            draw.text((x, y + (6 if size.size == 17 else 8)), text, fill=colour, font=size)
            x += round(draw.textlength(text, size)) + 12
    if strong and reason and time - since < REASON_TIME and draw.textlength(reason, font(14)) < SIZE[0] - 26 - x:
        draw.text((SIZE[0] - 24, y + 8), reason, fill=accent, font=font(14), anchor="ra")


@cache
def font(size: int, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Return the font of our pictures."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(get_data_path()) / "fonts" / "ttf" / name, size)


if __name__ == "__main__":
    main()
