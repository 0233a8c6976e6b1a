"""``mission servo monitor``: what all joints feel, again and again."""

import json
from dataclasses import asdict

import click
from rich.live import Live
from rich.text import Text

from missions.cli.console import console
from missions.cli.numbers import InUnit
from missions.cli.root import FAILURE, SUCCESS
from missions.cli.servo.bench import Bench, opened_bus, pause
from missions.cli.servo.reading import Felt, feel, table_of
from missions.cli.servo.target import Target, target_options


@click.command(epilog="Example: mission servo monitor elbow --once")
@target_options
@click.argument("joints", nargs=-1, metavar="[JOINT|GROUP]...")
@click.option("--once", is_flag=True, help="Print one table, and end.")
@click.option("--json", "as_json", is_flag=True, help="A line of JSON a round, in SI units; angles in radians.")
@click.option("--rate", type=InUnit("Hz", 0.1, 50.0), default=5.0, show_default=True, help="Rounds a second.")
def monitor(target: Target, joints: tuple[str, ...], once: bool, as_json: bool, rate: float) -> int:
    """Show what the joints feel, live.

    Only reads: torque and goals stay as they are. Ctrl-C ends it. Angles in degrees. Exit code 1 where a servo does
    not answer (with --once).
    """
    with opened_bus(target) as bench:
        if once:
            felt = feel(bench.bus, bench.chosen(joints))
            click.echo(_json(bench, felt) if as_json else table_of(felt))
            return SUCCESS if all(each.state is not None for each in felt) else FAILURE
        _show(bench, joints, 1.0 / rate, as_json=as_json)
    return SUCCESS


def _show(bench: Bench, names: tuple[str, ...], period: float, *, as_json: bool) -> None:
    """Show round after round, until somebody interrupts."""
    chosen = bench.chosen(names)
    with Live(console=console(), auto_refresh=False) as live:
        while True:
            begun = bench.clock.now()
            felt = feel(bench.bus, chosen)
            if as_json:
                click.echo(_json(bench, felt))
            else:
                live.update(Text(table_of(felt), no_wrap=True, overflow="ellipsis"), refresh=True)
            pause(max(0.0, begun + period - bench.clock.now()))


def _json(bench: Bench, felt: list[Felt]) -> str:
    told = {
        each.joint.name: {"remark": each.remark} | ({} if each.state is None else asdict(each.state)) for each in felt
    }
    return json.dumps({"t": round(bench.clock.now(), 3), "joints": told})
