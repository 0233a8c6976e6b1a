"""``mission simulate fault``: injects a fault into a simulated run."""

from collections.abc import Mapping

import click

from missions.cli.root import FAILURE, SUCCESS
from missions.control.run_search import FoundProcess, search_runs
from missions.control.sockets import open_connection


@click.command(epilog="Example: mission simulate fault camera frozen 2 s")
@click.argument("words", nargs=-1, required=True, metavar="FAULT...")
@click.option("--run", "which", metavar="RUN", help="Run: its process id or its mission.")
def fault(words: tuple[str, ...], which: str | None) -> int:
    """Inject a fault into a run in simulated time, in the words of test files (docs/testing.md).

    FAULT is PART STATE [SIDE] [TIME], such as `head unplugged 3 s`, `base bumped left 1 s`, `voice hanging`, or
    `run stalled 500 ms`. A run on real or virtual devices refuses them: pull the plug there, or start the run with
    `mission run NAME --simulate fast --speed 1`.
    """
    found = search_runs()
    request = {"do": "fault", "what": " ".join(words), "by": "mission simulate fault"}
    results = [
        result
        for each in found.processes
        if not each.is_command and each.matches(() if which is None else (which,))
        for result in _inject(each, request)
    ]
    results += [(False, f"not all runs could be found: {each.reason}\n  try: {each.hint}") for each in found.warnings]
    for good, what in results:
        click.echo(what, err=not good)
    if not results:
        click.echo("no such run" if which else "no mission runs", err=True)
    return SUCCESS if results and all(good for good, _ in results) else FAILURE


def _inject(found: FoundProcess, request: Mapping[str, object]) -> list[tuple[bool, str]]:
    """Inject a fault into one run; return a list with one pair (success, text for the user).

    The list is empty if the run has ended.
    """
    why = ""
    for where in found.addresses:
        try:
            with open_connection(where) as link:
                answer = link.request(request)
        except (ConnectionRefusedError, FileNotFoundError):
            continue  # it has gone
        except (OSError, ValueError) as error:
            why = f"does not answer ({error})"
            continue
        name = "" if found.holder is None else found.holder.name
        hint = f"\n  try: {answer['hint']}" if answer.get("hint") else ""
        return [(bool(answer["ok"]), f"{found.run}: {name}: {'done' if answer['ok'] else answer['message']}{hint}")]
    return [(False, f"{found.description}: {why}")] if why else []
