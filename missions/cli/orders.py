"""Whether what a user asks of a run makes sense, before anything is opened or written."""

from math import inf
from pathlib import Path

import click

from drivers.api.kinds import WIRED
from drivers.camera.source import Kind, kind_of
from missions.cli.movie import check_place
from missions.language.plan import Plan
from missions.order import RunRequest


def check_order(order: RunRequest) -> None:
    """Raise click.UsageError for options that contradict each other, or could only be ignored."""
    simulated = order.simulation is not None
    if order.simulation != "fast" and (order.eyes == "truth" or order.speed != inf):
        raise click.UsageError("--eyes truth and --speed are for simulated time: add --simulate fast")
    if order.simulation == "fast" and order.camera is not None:
        raise click.UsageError("--camera gives pictures in real time: it goes with --simulate wire, not with fast")
    if order.ports and simulated:
        raise click.UsageError("--port names real ports, which are used only with --robot NAME and without --simulate")
    for part in order.ports:
        if part not in WIRED:
            raise click.UsageError(f"--port: '{part}' is no part with a port; these are: {', '.join(WIRED)}")
    if order.world is not None and not simulated:
        raise click.UsageError("--world is for a simulated robot: add --simulate, or leave it out")
    if order.camera is not None:
        _check_camera(order.camera)
    if order.pad is not None and order.simulation == "fast":
        raise click.UsageError("--pad is for hands, in real time: it goes with --simulate wire, not with fast")


def _check_camera(source: str) -> None:
    """Raise for a file that is not there: unlike a device, it will not be plugged in."""
    kind = kind_of(source) if source.strip() else None
    if kind is None or (kind in (Kind.VIDEO, Kind.PICTURE) and not Path(source).is_file()):
        raise click.UsageError(f"--camera: '{source}': no such file, and no index, device or address of a camera")


def check_pad(order: RunRequest, plan: Plan) -> None:
    """Raise click.UsageError for a pad that would have nothing to drive."""
    if order.pad is not None and "base" not in plan.tree.parts:
        raise click.UsageError(f"--pad drives the base, which {plan.mission} does not use")


def check_events(path: Path, plan: Plan) -> None:
    """Raise click.UsageError for an events file that would take the place of a file that the run reads."""
    for step in plan.tree.walk():
        if Path(step.source.name).exists() and path.exists() and path.samefile(step.source.name):
            raise click.UsageError(f"--events would write over the mission {path}")


def check_film(path: Path, order: RunRequest) -> None:
    """Raise click.UsageError for a film that cannot be made, or would take the place of something."""
    if order.simulation != "fast":
        raise click.UsageError("--film is made in simulated time: add --simulate fast")
    check_place(path, "--film")
