"""Figures of Matplotlib in files."""

from pathlib import Path
from typing import TYPE_CHECKING

from config.saving import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


NO_PLOTS = "a picture needs Matplotlib: pip install 'missiontree[plots]'"


def save_figure(figure: "Figure", path: Path, dpi: int, mode: int | None = None) -> Path:
    """Write a figure in the form that the name of the file ends in, whole or not at all; return its path.

    ``mode`` is as that of ``whole_file``. Raises OSError; ValueError for an ending that Matplotlib does not know.
    """
    with whole_file(path, mode) as file:
        figure.savefig(file, dpi=dpi, format=path.suffix.removeprefix(".") or "png")
    return path
