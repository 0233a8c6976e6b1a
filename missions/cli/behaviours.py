"""Catalogue of behaviours, for ``mission list behaviours`` and ``mission show NAME``."""

import inspect
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import click
from rich.table import Table

from behaviours.leaf import Leaf
from config.units import UNITS
from missions.cli.console import console, echo
from missions.cli.options import folder_behaviour_files
from missions.language.nodes import BRANCHES, COMPOSITES, FAILURE_NAME, MODIFIERS, OTHER_PARENTS, OWNED_KEYS
from missions.language.operators import FUNCTION_HELP
from missions.language.parallel_counts import COUNTS
from missions.language.steps import BESIDE_KEYS, STEP_KEY_HELP
from missions.language.synonyms import unknown_word_hint
from missions.library.catalogue import default_text, requirements_text, summary
from missions.library.vocabulary import load_leaves


def show_behaviour(name: str, files: Sequence[Path], *, as_json: bool) -> None:
    """Print the catalogue entry of a leaf, or the help of a composite or modifier.

    ``files`` are Python files with the user's own leaves. Raises click.UsageError if ``name`` is unknown.
    """
    leaves = load_leaves(folder_behaviour_files(files), files)
    if name in leaves:
        if as_json:
            click.echo(json.dumps([_as_dict(leaves[name])], indent=2))
        else:
            _describe(leaves[name])
    elif name in (known := word_help()):
        click.echo(known[name] if known[name].startswith(f"{name}(") else f"{name}: {known[name]}")
    else:
        hint = unknown_word_hint(name, leaves, BRANCHES, (*MODIFIERS, *BESIDE_KEYS), alone=False)
        raise click.UsageError(
            f"unknown behaviour '{name}'" + (f"; {hint}" if hint else "; `mission list behaviours` lists all")
        )


def list_behaviours(files: Sequence[Path], *, as_json: bool) -> None:
    """Print a line for each leaf, composite and modifier; with ``as_json``, print the leaves with their arguments."""
    leaves = load_leaves(folder_behaviour_files(files), files)
    if as_json:
        click.echo(json.dumps([_as_dict(leaf) for leaf in leaves.values()], indent=2))
    else:
        _list(leaves)


def is_word(name: str, files: Sequence[Path]) -> bool:
    """Return whether ``name`` is a behaviour or another word of the language."""
    return name in load_leaves(files) or name in word_help()


def word_help() -> Mapping[str, str]:
    """Return the help of each composite, modifier, other key and function, by its word in missions."""
    modifier_texts = {word: f"{text} (takes {takes})" for word, (takes, text) in COUNTS.items()}
    modifier_texts |= {word: f"{text} (takes {takes})" for word, (_, takes, text) in OWNED_KEYS.items()}
    modifiers = {word: f"{each.help} (takes {each.takes})" for word, each in MODIFIERS.items()}
    branches = {word: kind.help for word, kind in BRANCHES.items()}
    failure = {FAILURE_NAME: "reason of the last failure: in later children of a selector, in 'recover' and 'finally'"}
    return STEP_KEY_HELP | failure | FUNCTION_HELP | branches | modifier_texts | modifiers


def _list(leaves: Mapping[str, type[Leaf]]) -> None:
    shown = console(highlight=True)
    for title, rows in (
        ("Behaviours", {word: (summary(leaf), ", ".join(sorted(leaf.drives))) for word, leaf in leaves.items()}),
        ("Composites, with a list of children", {word: (kind.help, "") for word, kind in COMPOSITES.items()}),
        ("Other nodes with children", {word: (kind.help, "") for word, kind in OTHER_PARENTS.items()}),
        ("Keys beside a parallel", {word: (f"{text} ({takes})", "") for word, (takes, text) in COUNTS.items()}),
        ("Modifiers, beside a behaviour", {word: (f"{m.help} ({m.takes})", "") for word, m in MODIFIERS.items()}),
        (
            "Keys beside a modifier or a selector",
            {word: (f"beside {only}: {text} ({takes})", "") for word, (only, takes, text) in OWNED_KEYS.items()},
        ),
    ):
        table = Table("", "", "claims" if title == "Behaviours" else "", title=title, title_justify="left", box=None)
        for word, (text, claims) in rows.items():
            table.add_row(f"[bold]{word}[/bold]", text, claims)
        shown.print(table)
    shown.print("\n`mission show NAME` shows the details.")


def _describe(leaf: type[Leaf]) -> None:
    echo(leaf.tag, "bold")
    for line in (inspect.getdoc(leaf) or "").splitlines():
        click.echo(f"  {line}")
    click.echo(f"\n  claims: {', '.join(sorted(leaf.drives)) or 'nothing'}")
    click.echo(f"  needs:  {', '.join(sorted(leaf.needs)) or 'nothing'}")
    if leaf.optional_parts:
        click.echo(f"  uses:   {', '.join(sorted(leaf.optional_parts))}, if the robot has them")
    if leaf.output_doc:
        click.echo(f"  as:     stores {leaf.output_doc}")
    if leaf.arguments:
        click.echo("\n  arguments:")
    for argument in leaf.arguments.values():
        principal = "; may stand alone" if argument.principal else ""
        click.echo(f"    {argument.name}: {requirements_text(argument)}{principal}\n        {argument.help}")
    if leaf.example:
        click.echo("\n  example:")
        for line in leaf.example.splitlines():
            click.echo(f"    {line}")


def _as_dict(leaf: type[Leaf]) -> dict[str, object]:
    return {
        "name": leaf.tag,
        "help": inspect.getdoc(leaf),
        "claims": sorted(leaf.drives),
        "needs": sorted(leaf.needs),
        "uses": sorted(leaf.optional_parts),
        "stores": leaf.output_doc or None,
        "arguments": [
            {
                "name": argument.name,
                "kind": argument.kind,
                "units": list(UNITS.get(argument.kind, ())),
                "span": argument.span,
                "required": argument.required,
                "default": None if argument.required else default_text(argument),
                "principal": argument.principal,
                "help": argument.help,
            }
            for argument in leaf.arguments.values()
        ],
    }
