"""The layouts of game pads that were taught: one file of the user's, ``~/.config/missiontree/pads.json``."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from config.defaults import config_folder
from config.reading import read_regular_text
from config.saving import PRIVATE, save_file
from drivers.errors import NotConnected
from missions.plugins.teleop.layout import Control, PadLayout, Stick

FILE = "pads.json"
MAX_CODE, MAX_VALUE = 0x2FF, 2**31
TEACH = "mission teleop --teach-pad  (again; it replaces this file's entry)"


def pads_file() -> Path:
    """Return where they are."""
    return config_folder() / FILE


def load_taught(path: Path | None = None) -> dict[str, PadLayout]:
    """Return the layouts by ``PadModel.key``; none without the file.

    Raises NotConnected for a file that is damaged: a pad with half a layout must not drive.
    """
    path = pads_file() if path is None else path
    try:
        found = json.loads(read_regular_text(path))
        layouts = {str(key): _layout(told) for key, told in found.items()}
        for key, layout in layouts.items():
            for fault in layout.faults():
                raise ValueError(f"{key}: {fault}")
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise NotConnected(f"pad: {path}: cannot be used: {error}", hint=f"rm {path}; then {TEACH}") from error
    return layouts


def keep_taught(key: str, layout: PadLayout, path: Path | None = None) -> Path:
    """Keep a layout, in the place of an earlier one of this pad; return the file. Raises OSError, NotConnected."""
    path = pads_file() if path is None else path
    layouts = {**load_taught(path), key: layout}
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    text = json.dumps({name: _told(each) for name, each in layouts.items()}, indent=2) + "\n"
    save_file(path, text, PRIVATE)
    return path


def _told(layout: PadLayout) -> dict[str, object]:
    return {
        "hold": _control_told(layout.hold),
        "stops": [_control_told(each) for each in layout.stops],
        "enable": _control_told(layout.enable),
        "ahead": {"axis": layout.ahead.code, "sign": layout.ahead.sign, "rest": layout.ahead.rest},
        "left": {"axis": layout.left.code, "sign": layout.left.sign, "rest": layout.left.rest},
    }


def _control_told(control: Control) -> dict[str, object]:
    if control.rest is None:
        return {"button": control.code}
    return {"axis": control.code, "rest": control.rest, "end": control.end}


def _layout(told: Mapping[str, Any]) -> PadLayout:
    stops = tuple(_control(each) for each in told["stops"])
    return PadLayout(
        _control(told["hold"]), stops, _control(told["enable"]), _stick(told["ahead"]), _stick(told["left"])
    )


def _control(told: Mapping[str, Any]) -> Control:
    if "button" in told:
        return Control(_whole(told["button"], 0, MAX_CODE))
    rest, end = (_whole(told[word], -MAX_VALUE, MAX_VALUE) for word in ("rest", "end"))
    return Control(_whole(told["axis"], 0, MAX_CODE), rest, end)


def _stick(told: Mapping[str, Any]) -> Stick:
    sign = _whole(told["sign"], -1, 1)
    if sign == 0:
        raise ValueError("a stick with the sign 0")
    rest = None if told["rest"] is None else _whole(told["rest"], -MAX_VALUE, MAX_VALUE)
    return Stick(_whole(told["axis"], 0, MAX_CODE), sign, rest)


def _whole(value: object, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ValueError(f"{value!r:.40} is not a whole number from {low} to {high}")
    return value
