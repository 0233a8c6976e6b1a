"""Writer of YAML files, such as recorded gestures.

Each text is parsed before it is returned, so nothing is written that the loader refuses.
"""

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path

from config.diagnostics import SourceText
from config.file_io import sync_folder
from config.gesture import GestureConfig, parse_gesture
from config.yaml_nodes import plain_value


def gesture_text(gesture: GestureConfig, file: str = "gesture") -> str:
    """Return the text of a gesture file; keyframes name only the joints that have moved since the last one.

    Angles are rounded to a microradian, times to a tenth of a millisecond. Raises InvalidFileError, with ``file`` as
    its name, for an invalid gesture: no keyframe, times that do not rise, too large.
    """
    lines = [f"gesture: {yaml_word(gesture.name)}"]
    if gesture.summary.strip():
        lines.append(f"summary: {json.dumps(gesture.summary, ensure_ascii=False)}")
    lines += [f"interpolation: {gesture.interpolation}", "keyframes:"]
    before: dict[str, str] = {}
    for time, positions in gesture.keyframes:
        angles = {joint: f"{number_text(angle, 6)} rad" for joint, angle in positions.items()}
        moved = {yaml_word(joint): angle for joint, angle in angles.items() if before.get(joint) != angle}
        lines.append(f"  - {flow_mapping({'at': f'{number_text(time, 4)} s'}, moved)}")
        before |= angles
    text = "\n".join(lines) + "\n"
    parse_gesture(SourceText(file, text))
    return text


def write_new(path: Path, text: str) -> None:
    """Write a new file, and wait until it is on the disk.

    Raises FileExistsError with a message if the file exists, and other OSErrors.
    """
    try:
        with path.open("x", encoding="utf-8") as file:
            try:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            except BaseException:  # a full disk, a Ctrl-C: what was not written must not be there already next time
                path.unlink(missing_ok=True)
                raise
    except FileExistsError as error:
        raise FileExistsError(f"{path} already exists: choose another name") from error
    sync_folder(path.parent)


def flow_mapping(*parts: Mapping[str, str]) -> str:
    """Return several mappings as one YAML flow mapping."""
    return "{" + ", ".join(f"{key}: {value}" for part in parts for key, value in part.items()) + "}"


def number_text(value: float, digits: int) -> str:
    """Return a number as text with at most ``digits`` decimals."""
    return f"{round(value, digits) + 0.0:.12g}"


def yaml_word(text: str) -> str:
    """Return a name as a YAML text, quoted if necessary."""
    return (
        text
        if re.fullmatch(r"[A-Za-z_]\w*", text) and plain_value(text) == text
        else json.dumps(text, ensure_ascii=False)
    )
