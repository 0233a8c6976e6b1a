"""``mission behaviours``: the catalogue, from the declarations of the leaves themselves."""

import inspect
import json

import click
from rich.console import Console
from rich.table import Table

from behaviours.catalogue import LEAVES
from behaviours.leaf import Argument, Leaf
from config.faults import one_of
from config.units import UNITS, written
from missions.language.modifiers import MODIFIERS
from missions.language.plan import COMPOSITES


@click.command()
@click.argument("name", required=False)
@click.option("--json", "as_json", is_flag=True, help="For programs.")
def command(name: str | None, as_json: bool) -> None:
    """Say what each behaviour does, its arguments with units and defaults, and what it claims."""
    if name is not None and name not in LEAVES:
        if name in COMPOSITES or name in MODIFIERS:
            click.echo(f"{name}: {COMPOSITES.get(name) or f'{MODIFIERS[name].help} (takes {MODIFIERS[name].takes})'}")
            return
        words = [*LEAVES, *COMPOSITES, *MODIFIERS]
        raise click.UsageError(f"no behaviour '{name}'; {one_of(name, words)}")
    chosen = {name: LEAVES[name]} if name is not None else dict(LEAVES)
    if as_json:
        click.echo(json.dumps([_as_dict(leaf) for leaf in chosen.values()], indent=2))
    elif name is not None:
        _describe(LEAVES[name])
    else:
        _list()


def _list() -> None:
    console = Console()
    for title, rows in (
        ("Behaviours", {word: (summary(leaf), ", ".join(sorted(leaf.drives))) for word, leaf in LEAVES.items()}),
        ("Composites, each with a list of behaviours", {word: (text, "") for word, text in COMPOSITES.items()}),
        ("Modifiers, beside a behaviour", {word: (f"{m.help} ({m.takes})", "") for word, m in MODIFIERS.items()}),
    ):
        table = Table("", "", "claims" if title == "Behaviours" else "", title=title, title_justify="left", box=None)
        for word, (text, claims) in rows.items():
            table.add_row(f"[bold]{word}[/bold]", text, claims)
        console.print(table)
    console.print("\n`mission behaviours NAME` tells all about one.")


def _describe(leaf: type[Leaf]) -> None:
    click.secho(leaf.word, bold=True)
    for line in (inspect.getdoc(leaf) or "").splitlines():
        click.echo(f"  {line}")
    click.echo(f"\n  claims: {', '.join(sorted(leaf.drives)) or 'nothing'}")
    click.echo(f"  needs:  {', '.join(sorted(leaf.needs)) or 'nothing'}")
    if leaf.stores:
        click.echo(f"  as:     keeps {leaf.stores}")
    if leaf.arguments:
        click.echo("\n  arguments:")
    for argument in leaf.arguments.values():
        default = "must be given" if argument.required else f"default {shown_default(argument)}"
        principal = ", may stand alone" if argument.principal else ""
        click.echo(f"    {argument.name}: {kind_of(argument)}, {default}{principal}\n        {argument.help}")


def summary(leaf: type[Leaf]) -> str:
    """Return the first line of what a leaf says of itself."""
    return (inspect.getdoc(leaf) or "").partition("\n")[0]


def kind_of(argument: Argument) -> str:
    """Say what an argument takes: "length (m, cm, mm)"."""
    units = f" ({', '.join(UNITS[argument.kind])})" if argument.kind in UNITS else ""
    return ("two of " if argument.span else "") + argument.kind + units


def shown_default(argument: Argument) -> str:
    """Write a default as a mission would."""
    values = argument.default if argument.span else (argument.default,)
    shown = [written(value, argument.kind) if argument.kind in UNITS else str(value) for value in values]
    return f"[{', '.join(shown)}]" if argument.span else shown[0]


def _as_dict(leaf: type[Leaf]) -> dict[str, object]:
    return {
        "name": leaf.word,
        "help": inspect.getdoc(leaf),
        "claims": sorted(leaf.drives),
        "needs": sorted(leaf.needs),
        "stores": leaf.stores or None,
        "arguments": [
            {
                "name": argument.name,
                "kind": argument.kind,
                "units": list(UNITS.get(argument.kind, ())),
                "span": argument.span,
                "required": argument.required,
                "default": None if argument.required else shown_default(argument),
                "principal": argument.principal,
                "help": argument.help,
            }
            for argument in leaf.arguments.values()
        ],
    }
