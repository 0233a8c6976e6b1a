"""``mission world``: what a world file describes, in words, as a plan, or as the robot's camera sees it."""

from pathlib import Path

import click
import cv2

from config.library import find
from config.robot import RobotConfig, load_robot
from config.world import WorldConfig, load_world
from drivers.api import Image
from drivers.sim.render import Renderer
from drivers.sim.topview import TopView
from drivers.sim.viewpoint import Pinhole, Viewpoint, mounted
from missions.assembly.worlds import build_world
from missions.cli.options import SECONDS
from missions.cli.outputs import writing
from missions.order import DEFAULT_ROBOT
from missions.pictures.plan import plan
from missions.pictures.words import lines_about

PIXELS = 120
"""Pixels to a metre of a plan as a picture, where the room is not larger than ``LARGEST`` then."""

LARGEST = 1600
"""Pixels of the longer side of such a picture."""

FORMS = (".svg", ".png")


@click.group()
def command() -> None:
    """Show simulated worlds."""


@command.command()
@click.argument("name", metavar="WORLD")
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="FILE", help="Draw it, into FILE.svg or .png.")
@click.option("--camera", is_flag=True, help="Draw what the robot's camera sees at the start, into FILE.png.")
@click.option(
    "--at",
    "time",
    default="0 s",
    show_default=True,
    metavar="TIME",
    type=SECONDS,
    help='How it is then: such as "5 s".',
)
@click.option("--robot", default=DEFAULT_ROBOT, show_default=True, metavar="NAME", help="Whose camera; name or file.")
def show(name: str, output: Path | None, camera: bool, time: float, robot: str) -> None:
    """Say what is in a world (a name or a file), or draw it."""
    config = load_world(find("worlds", name))
    if output is None:
        if camera:
            raise click.UsageError(f"--camera draws a picture: say where, such as -o {config.name}.png")
        for line in lines_about(config):
            click.echo(line)
        click.echo(f"\nTo draw it: mission world show {name} -o {config.name}.svg")
        return
    if output.suffix not in FORMS or (camera and output.suffix != ".png"):
        raise click.UsageError(f"'{output}': the name must end in {'.png' if camera else ' or '.join(FORMS)}")
    if output.suffix == ".svg":
        data = plan(config.name, build_world(config), config.summary, time).encode()
    else:
        data = _png(_seen(config, load_robot(find("robots", robot)), time) if camera else _map(config, time))
    with writing(output, "-o"):
        output.write_bytes(data)
    click.echo(f"drew {output}")


def _map(config: WorldConfig, time: float) -> Image:
    scale = min(PIXELS, LARGEST / (max(config.length, config.width) + 0.7))
    size = (round((config.length + 0.7) * scale), round((config.width + 0.7) * scale))
    world = build_world(config)
    return TopView(world, size).draw(time, world.start)


def _seen(config: WorldConfig, robot: RobotConfig, time: float) -> Image:
    """Draw what the camera sees while the robot stands where it starts and its head looks ahead."""
    world, camera = build_world(config), robot.camera
    if camera is None:
        raise click.UsageError(f"{robot.name} has no camera: choose another --robot")
    lens = Pinhole(camera.width, camera.height, camera.field_of_view)
    view: Viewpoint = mounted(world.start, 0.0, 0.0, camera.position)
    return Renderer(world, lens, noise=config.noise).draw(view, time)


def _png(image: Image) -> bytes:
    done, data = cv2.imencode(".png", image)
    if not done:
        raise click.ClickException("the picture cannot be encoded as PNG")
    return data.tobytes()
