"""``mission simulate fault``: lets something go wrong with a simulated run, to see what the mission makes of it."""

from collections.abc import Mapping

import click

from missions.cli.root import FAILURE, SUCCESS
from missions.control.run_search import FoundProcess, search_runs
from missions.control.sockets import open_connection


@click.command(epilog="Example: mission simulate fault camera frozen 2 s")
@click.argument("words", nargs=-1, required=True, metavar="PART STATE [TIME]...")
@click.option("--run", "which", metavar="RUN", help="Which run: the number of its process, or its mission.")
def fault(words: tuple[str, ...], which: str | None) -> int:
    """Let something go wrong with a run in simulated time, in the words of test files (docs/testing.md).

    Such as `head unplugged 3 s`, `base bumped left 1 s`, `voice hanging`, `run stalled 500 ms`. One on real or virtual
    devices says that it is unsupported: there, pull the plug. Take `mission run NAME --simulate fast --speed 1`.
    """
    found = search_runs()
    asked = {"do": "fault", "what": " ".join(words), "by": "mission simulate fault"}
    said = [
        told
        for each in found.processes
        if not each.is_command and each.matches(() if which is None else (which,))
        for told in _inject(each, asked)
    ]
    said += [(False, f"not all runs could be looked for: {each.reason}\n  try: {each.hint}") for each in found.warnings]
    for good, what in said:
        click.echo(what, err=not good)
    if not said:
        click.echo("no such run" if which else "no mission runs", err=True)
    return SUCCESS if said and all(good for good, _ in said) else FAILURE


def _inject(found: FoundProcess, asked: Mapping[str, object]) -> list[tuple[bool, str]]:
    """Let it happen to a run; return whether it does, and the words for people. Nothing of a run that has gone."""
    why = ""
    for where in found.addresses:
        try:
            with open_connection(where) as link:
                answer = link.request(asked)
        except (ConnectionRefusedError, FileNotFoundError):
            continue  # it has gone
        except (OSError, ValueError) as error:
            why = f"does not answer ({error})"
            continue
        name = "" if found.holder is None else found.holder.name
        hint = f"\n  try: {answer['hint']}" if answer.get("hint") else ""
        return [(bool(answer["ok"]), f"{found.run}: {name}: {'done' if answer['ok'] else answer['message']}{hint}")]
    return [(False, f"{found.description}: {why}")] if why else []
