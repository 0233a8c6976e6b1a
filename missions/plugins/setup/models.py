"""``mission robot models``: list and download trained models that are not shipped."""

from pathlib import Path

import click

from missions.assembly.models import MODELS, FetchError, fetch, is_fetched, models_folder
from missions.cli.root import FAILURE, SUCCESS


@click.group(invoke_without_command=True, epilog="Example: mission robot models")
@click.pass_context
def models(ctx: click.Context) -> None:
    """List and download trained models. No shipped mission needs one."""
    if ctx.invoked_subcommand is None:
        print_models()


@models.command(name="list", epilog="Example: mission robot models list")
def list_command() -> None:
    """List the models, and which are installed."""
    print_models()


def print_models() -> None:
    """Print each trained model, and whether it is installed."""
    where = models_folder()
    for _, model in sorted(MODELS.items()):
        state = f"in {where / model.file}" if is_fetched(model, where) else f"mission robot models fetch {model.name}"
        click.echo(f"{model.name:<8} {model.size / 1e6:.2f} MB  {model.summary}\n{'':<8} {state}")


@models.command(name="fetch", epilog="Example: mission robot models fetch yunet")
@click.argument("name", type=click.Choice(sorted(MODELS)), metavar="NAME")
@click.option("--from", "url", metavar="URL", help="Another URL; the checksum is verified all the same.")
@click.option(
    "--into",
    "where",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Target folder; by default your data folder.",
)
def fetch_command(name: str, url: str | None, where: Path | None) -> int:
    """Download a model, check its SHA-256, and install it."""
    model, where = MODELS[name], where or models_folder()
    if is_fetched(model, where):
        click.echo(f"{where / model.file} already exists")
        return SUCCESS
    try:
        path = fetch(model, where, url=url)
    except FetchError as error:
        click.echo(f"mission: {error}" + (f"\n  try: {error.hint}" if error.hint else ""), err=True)
        return FAILURE
    click.echo(f"fetched {path}, SHA-256 as published")
    if model.name == "yunet":
        click.echo("To use it, write `detector: yunet` into the camera section of your robot file", err=True)
    return SUCCESS
