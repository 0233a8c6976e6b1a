"""``mission motion``: the eight motions of the TurtleBot course, by number."""

import click

from missions.cli import run
from missions.library.shipped import load_mission

MOTIONS = {
    "1": "forward",
    "2": "spin_left",
    "3": "spin_right",
    "4": "square",
    "5": "triangle",
    "6": "back_and_forth",
    "7": "circle_anticlockwise",
    "8": "circle_clockwise",
}
"""The motions by their numbers in the course: missions in the folder ``motions``."""


def _mission_of(ctx: click.Context, argument: click.Parameter, value: str | None) -> str:
    """Return the mission that a motion is; list them all, and end, where none is named."""
    if value is None and not ctx.resilient_parsing:
        for number, name in MOTIONS.items():
            click.echo(f"  {number}  {name:<22} {load_mission(f'motions/{name}').summary}")
        ctx.exit()
    name = MOTIONS.get(value or "", value or "")
    if name not in MOTIONS.values():
        numbered = ", ".join(f"{number} {name}" for number, name in MOTIONS.items())
        raise click.BadParameter(f"there is no motion '{value}'; there are {numbered}", ctx=ctx, param=argument)
    return f"motions/{name}"


command = run.RunCommand(
    "motion",
    callback=run.command.callback,
    params=[
        click.Argument(["name"], required=False, metavar="[MOTION]", callback=_mission_of),
        *(option for option in run.command.params if isinstance(option, click.Option)),
    ],
    help="Run one of the eight motions of the TurtleBot course, by number or name; without one, list them.\n\n"
    "Params, robots and all else are as in `mission run`.",
    epilog="Example: mission motion 1 --param distance='20 cm'",
)
"""``mission run`` itself, but for how its mission is named."""
