"""``mission behaviours``: the catalogue, from the declarations of the leaves themselves."""

import inspect
import json
from collections.abc import Mapping
from pathlib import Path

import click
from rich.table import Table

from behaviours.leaf import Leaf
from config.units import UNITS
from missions.cli.names import BEHAVIOUR
from missions.cli.options import behaviours_option, own_files
from missions.cli.printable import console, echo
from missions.language.counts import COUNTS
from missions.language.nodes import BRANCHES, COMPOSITES, MODIFIERS, OTHERS
from missions.language.steps import BESIDE
from missions.language.synonyms import word_meant
from missions.library.catalogue import shown_default, summary, terms
from missions.library.vocabulary import vocabulary


@click.command(epilog="Example: mission behaviours find_face")
@click.argument("name", type=BEHAVIOUR, required=False)
@click.option("--json", "as_json", is_flag=True, help="For programs.")
@behaviours_option
def command(name: str | None, as_json: bool, files: tuple[Path, ...]) -> None:
    """Say what each behaviour does, its arguments with units and defaults, and what it claims."""
    leaves = vocabulary(own_files(files), files)
    if name is not None and name not in leaves:
        known = _known()
        if name in known:
            click.echo(f"{name}: {known[name]}")
            return
        hint = word_meant(name, leaves, BRANCHES, (*MODIFIERS, *BESIDE), alone=False)
        raise click.UsageError(f"no behaviour '{name}'" + (f"; {hint}" if hint else "; `mission behaviours` has all"))
    chosen = {name: leaves[name]} if name is not None else leaves
    if as_json:
        click.echo(json.dumps([_as_dict(leaf) for leaf in chosen.values()], indent=2))
    elif name is not None:
        _describe(leaves[name])
    else:
        _list(leaves)


def _known() -> Mapping[str, str]:
    """Return what every word of the language does that is no leaf."""
    beside = {word: f"{text} (takes {takes})" for word, (takes, text) in COUNTS.items()}
    modifiers = {word: f"{each.help} (takes {each.takes})" for word, each in MODIFIERS.items()}
    return {word: kind.help for word, kind in BRANCHES.items()} | beside | modifiers


def _list(leaves: Mapping[str, type[Leaf]]) -> None:
    shown = console(highlight=True)
    for title, rows in (
        ("Behaviours", {word: (summary(leaf), ", ".join(sorted(leaf.drives))) for word, leaf in leaves.items()}),
        ("Composites, each with a list of behaviours", {word: (kind.help, "") for word, kind in COMPOSITES.items()}),
        ("Others that have behaviours below them", {word: (kind.help, "") for word, kind in OTHERS.items()}),
        ("Beside a parallel", {word: (f"{text} ({takes})", "") for word, (takes, text) in COUNTS.items()}),
        ("Modifiers, beside a behaviour", {word: (f"{m.help} ({m.takes})", "") for word, m in MODIFIERS.items()}),
    ):
        table = Table("", "", "claims" if title == "Behaviours" else "", title=title, title_justify="left", box=None)
        for word, (text, claims) in rows.items():
            table.add_row(f"[bold]{word}[/bold]", text, claims)
        shown.print(table)
    shown.print("\n`mission behaviours NAME` tells all about one.")


def _describe(leaf: type[Leaf]) -> None:
    echo(leaf.word, "bold")
    for line in (inspect.getdoc(leaf) or "").splitlines():
        click.echo(f"  {line}")
    click.echo(f"\n  claims: {', '.join(sorted(leaf.drives)) or 'nothing'}")
    click.echo(f"  needs:  {', '.join(sorted(leaf.needs)) or 'nothing'}")
    if leaf.uses:
        click.echo(f"  uses:   {', '.join(sorted(leaf.uses))}, where there is one")
    if leaf.stores:
        click.echo(f"  as:     keeps {leaf.stores}")
    if leaf.arguments:
        click.echo("\n  arguments:")
    for argument in leaf.arguments.values():
        principal = "; may stand alone" if argument.principal else ""
        click.echo(f"    {argument.name}: {terms(argument)}{principal}\n        {argument.help}")


def _as_dict(leaf: type[Leaf]) -> dict[str, object]:
    return {
        "name": leaf.word,
        "help": inspect.getdoc(leaf),
        "claims": sorted(leaf.drives),
        "needs": sorted(leaf.needs),
        "uses": sorted(leaf.uses),
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
