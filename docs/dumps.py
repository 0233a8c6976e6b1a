"""Draw every shipped mission for the gallery, and three of them in every form, as golden files of tests.

``make docs`` writes the stale files. The golden files of HTML pages name their style and script instead of holding
them; browser tests check those two.
"""

import json
from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from textwrap import wrap

import cv2
import numpy as np

import missions
from missions.cli.show import FORM_OF_SUFFIX, TREE_FORMS, Dump
from missions.executive.events import Event
from missions.library.shipped import load_mission, shipped_missions
from missions.plugins.pictures.compare import compare
from missions.plugins.pictures.forms import PAIR_FORMS
from missions.plugins.pictures.page.document import without_assets
from missions.plugins.studio.studio_commands import protocol_schema
from missions.trees.drawing import TreeDrawing, schema
from missions.trees.drawing_builder import drawing_of, with_states
from missions.trees.states import states_at

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "docs" / "gallery"
PAGES = ROOT / "tests" / "missions" / "views" / "pictures" / "golden"

IN_EVERY_FORM = ("greet", "patrol", "motions/square")
"""Missions that are drawn in every form; the others only as SVG."""

LINKED = {
    ".txt": "text",
    ".unicode": "py_trees",
    ".ascii": "ASCII",
    ".dot": "DOT",
    ".mmd": "Mermaid",
    ".json": "JSON",
    ".png": "PNG",
}
"""Labels of the gallery's links to other forms, by suffix."""

MOMENT = 5.0
"""Seconds into `greet` of the example picture of a moment."""


def dumps() -> Mapping[Path, Callable[[], Dump]]:
    """Return a function that makes each file's content, by path. Raises ImportError without the extra ``plots``."""
    found: dict[Path, Callable[[], Dump]] = {}
    for name in shipped_missions():
        for suffix in (".svg", ".html", *LINKED) if name in IN_EVERY_FORM else (".svg",):
            found[file_of(name, suffix)] = partial(dump, name, suffix)
    found[GALLERY / "at.svg"] = lambda: TREE_FORMS["svg"](moment())
    found[GALLERY / "diff.svg"] = lambda: PAIR_FORMS["svg"](compare(drawing("motions/square"), drawing("square_3m")))
    found[ROOT / "docs" / "tree.schema.json"] = lambda: json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"
    found[ROOT / "docs" / "studio.schema.json"] = lambda: (
        json.dumps(protocol_schema(), indent=1, ensure_ascii=False) + "\n"
    )
    return found


def dump(name: str, suffix: str) -> Dump:
    """Return a mission in the form of ``suffix``; an HTML page names its style and script."""
    made = TREE_FORMS[FORM_OF_SUFFIX[suffix]](drawing(name))
    return without_assets(made) if suffix == ".html" and isinstance(made, str) else made


def file_of(name: str, suffix: str) -> Path:
    """Return the path of a mission's file; the name of a folder becomes a prefix."""
    folder = PAGES if suffix == ".html" else GALLERY
    return folder / f"{name.replace('/', '-')}{suffix}"


@cache
def drawing(name: str) -> TreeDrawing:
    """Return the drawing of a shipped mission."""
    return drawing_of(load_mission(name))


def moment() -> TreeDrawing:
    """Return the drawing of `greet` at ``MOMENT``, in simulated time."""
    events: list[Event] = []
    missions.run("greet", simulate="fast", eyes="truth", listeners=[events.append])
    return with_states(drawing("greet"), states_at(events, MOMENT), MOMENT)


def is_stale(path: Path, wanted: Dump) -> bool:
    """Return whether a file is missing or has other content; for a PNG, whether it looks different."""
    if not path.is_file():
        return True
    found = path.read_bytes()
    data = wanted.encode() if isinstance(wanted, str) else wanted
    return found != data if path.suffix != ".png" else not look_alike(found, data)


def look_alike(one: bytes, other: bytes) -> bool:
    """Return whether two PNGs look the same; releases of a renderer differ slightly at edges."""
    left, right = (cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR) for data in (one, other))
    if left is None or right is None or left.shape != right.shape:
        return False
    off = np.abs(left.astype(np.int16) - right)
    return bool(off.mean() < 1.0 and (off.max(axis=2) > 32).mean() < 0.001)


def wrap_paragraph(text: str) -> str:
    """Return a paragraph of Markdown with lines of at most 100 characters; a list stays as it is."""
    if text.startswith(("- ", "    ")):
        return text
    return "\n".join(wrap(text, 100, break_long_words=False, break_on_hyphens=False))


def gallery() -> str:
    """Return the gallery in Markdown: each mission's picture, and links to its other forms, if any."""
    return "\n\n".join(_entry(name) for name in shipped_missions())


def _entry(name: str) -> str:
    picture = f"![The tree of {name}](gallery/{file_of(name, '.svg').name})"
    entry = f"## {name}\n\n{wrap_paragraph(drawing(name).summary)}\n\n{picture}"
    if name not in IN_EVERY_FORM:
        return entry
    links = (f"[{label}](gallery/{file_of(name, suffix).name})" for suffix, label in LINKED.items())
    return f"{entry}\n\n{' · '.join(links)}"


def write() -> list[Path]:
    """Write the stale files, remove files without a mission, and return the paths that changed."""
    changed = []
    wanted = dumps()
    for path, make in wanted.items():
        made = make()
        if is_stale(path, made):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(made.encode() if isinstance(made, str) else made)
            changed.append(path)
    for path in sorted([*GALLERY.glob("*.*"), *PAGES.glob("*.html")]):
        if path not in wanted:
            path.unlink()
            changed.append(path)
    return changed
