"""``mission fault``: lets something go wrong with a simulated run, to see what the mission makes of it."""

import click

from missions.cli.root import FAILURE, SUCCESS
from missions.studio import sockets
from missions.studio.holders import holder_of
from missions.studio.sockets import linked


@click.command(epilog="Example: mission fault camera frozen 2 s")
@click.argument("words", nargs=-1, required=True, metavar="PART STATE [TIME]...")
@click.option("--run", "which", metavar="RUN", help="Which run: the number of its process, or its mission.")
def command(words: tuple[str, ...], which: str | None) -> int:
    """Let something go wrong with a run in simulated time, in the words of test files (docs/testing.md).

    Such as `head unplugged 3 s`, `base bumped left 1 s`, `voice hanging`, `run stalled 500 ms`. One on real or virtual
    devices says that it is unsupported: there, pull the plug. Take `mission run NAME --simulate fast --speed 1`.
    """
    said: list[tuple[bool, str]] = []
    for path in sockets.sockets():
        run = sockets.run_of(path)
        about = holder_of(int(run)) if run.isdecimal() else None
        name = "" if about is None else about.name
        if which is not None and which not in (run, name, *name.split()[:1]):
            continue
        try:
            with linked(path) as link:
                answer = link.ask({"do": "fault", "what": " ".join(words), "by": "mission fault"})
        except (ConnectionRefusedError, FileNotFoundError):
            continue  # it has gone
        except (OSError, ValueError) as error:
            said.append((False, f"{run}: {name}: does not answer ({error})"))
            continue
        hint = f"\n  try: {answer['hint']}" if answer.get("hint") else ""
        said.append((bool(answer["ok"]), f"{run}: {name}: {'done' if answer['ok'] else answer['message']}{hint}"))
    for good, what in said:
        click.echo(what, err=not good)
    if not said:
        click.echo("no such run" if which else "no mission runs", err=True)
    return SUCCESS if said and all(good for good, _ in said) else FAILURE
