"""``mission show`` of a world: its content as text, as a plan, or as the robot's camera sees it."""

import shlex
from pathlib import Path

import click
import cv2

from config.file_io import save_file
from config.library import find_file
from config.robot import RobotConfig
from config.world import WorldConfig, load_world
from drivers.api import Image
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import PinholeLens, Viewpoint, camera_viewpoint
from missions.cli.outputs import report_write_errors
from missions.library.drivers import load_robot
from missions.library.worlds import build_world
from missions.plugins.pictures.plan import plan_svg
from missions.plugins.pictures.png import png
from missions.plugins.pictures.world_text import describe_world

PNG_ZOOM = 1.5
"""Pixels of a PNG per unit of the plan."""

FORMS = (".svg", ".png")


def show_world(name: str, output: Path | None, time: float, robot: str, *, camera: bool) -> None:
    """Print the content of a world, or draw it to ``output``: from above, or as the ``camera`` of a robot sees it."""
    config = load_world(find_file("worlds", name))
    if output is None:
        if camera:
            raise click.UsageError(f"--camera needs an output file, such as -o {config.name}.png")
        for line in describe_world(config):
            click.echo(line)
        click.echo(f"\nTo draw it: mission show {name} -o {config.name}.svg")
        return
    if output.suffix not in FORMS or (camera and output.suffix != ".png"):
        raise click.UsageError(f"'{output}': the file name must end in {'.png' if camera else ' or '.join(FORMS)}")
    if output.suffix == ".svg":
        data = _plan(config, time).encode()
    elif camera:
        data = _png(_camera_view(config, load_robot(find_file("robots", robot)), time))
    else:
        data = _plan_png(_plan(config, time), output)
    with report_write_errors(output, "-o"):
        save_file(output, data)
    click.echo(f"drew {output}")


def _plan(config: WorldConfig, time: float) -> str:
    return plan_svg(config.name, build_world(config), config.summary, time)


def _plan_png(svg: str, output: Path) -> bytes:
    try:
        return png(svg, zoom=PNG_ZOOM)
    except ImportError as error:
        instead = shlex.quote(str(output.with_suffix(".svg")))
        raise click.UsageError(
            f"a plan as PNG needs resvg and Matplotlib\n  try: pip install 'missiontree[plots]', or -o {instead}"
        ) from error


def _camera_view(config: WorldConfig, robot: RobotConfig, time: float) -> Image:
    """Return the camera's view from the robot's start pose with the head straight ahead."""
    if robot.camera is None:
        raise click.UsageError(f"{robot.name} has no camera: choose another --robot")
    world, camera = build_world(config), robot.camera.upright()
    lens = PinholeLens(camera.width, camera.height, camera.field_of_view)
    view: Viewpoint = camera_viewpoint(world.start, 0.0, 0.0, camera.position)
    return Renderer(world, lens, noise=config.noise).draw(view, time)


def _png(image: Image) -> bytes:
    done, data = cv2.imencode(".png", image)
    if not done:
        raise click.ClickException("the picture cannot be encoded as PNG")
    return data.tobytes()
