"""``mission stop``: every robot of this machine still, at once, whoever runs it; and released again."""

import os
import signal
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any

import click

from missions.cli.root import FAILURE, SUCCESS
from missions.studio import sockets
from missions.studio.sockets import linked

NOBODY = "no mission runs"


@click.command()
@click.argument("which", metavar="[RUN]...", nargs=-1)
@click.option("--list", "only_list", is_flag=True, help="List the runs, and do nothing.")
@click.option("--release", is_flag=True, help="Release what is stopped; the mission stays paused.")
@click.option("--resume", is_flag=True, help="Let a paused mission go on; with --release, one that was stopped.")
@click.option("--end", is_flag=True, help="Stop, and end the mission: the run is over then.")
def command(which: tuple[str, ...], only_list: bool, release: bool, resume: bool, end: bool) -> int:
    """Stop every run of this user at once, or those named (the number of the process, or the mission).

    Base, head, arm and voice stand still, latched, and the mission is paused, until `mission stop --release`. It works
    over SSH and beside any run, with or without the studio. A run that does not answer is ended by a signal.
    """
    if end and (release or resume):
        raise click.UsageError("--end ends the run: nothing is released then")
    asked: Sequence[Mapping[str, object]] = [{"do": "stop"}, *([{"do": "halt"}] if end else [])]
    if release or resume:
        asked = [*([{"do": "release"}] if release else []), *([{"do": "resume"}] if resume else [])]
    found = sockets.sockets()
    said: dict[Path, tuple[bool, str]] = {}
    by = f"mission stop (process {os.getpid()})"
    work = [Thread(target=_ask, args=(path, which, [] if only_list else asked, by, said)) for path in found]
    for thread in work:  # all at the same time: one that hangs holds up no other
        thread.start()
    for thread in work:
        thread.join()
    for _, words in sorted(said.values(), key=lambda each: each[1]):
        click.echo(words)
    if not said:
        missing = f"no run {' or '.join(which)}: `mission stop --list` lists what runs" if which else NOBODY
        click.echo(missing, err=bool(which))
    fine = all(good for good, _ in said.values()) and (bool(said) or not which)
    return SUCCESS if fine else FAILURE


def _ask(
    path: Path,
    which: Sequence[str],
    commands: Sequence[Mapping[str, object]],
    by: str,
    said: dict[Path, tuple[bool, str]],
) -> None:
    """Ask a run, if it is meant, to do something, and note what came of it."""
    run = sockets.run_of(path)
    with suppress(OSError), linked(path) as link:
        told = link.told
        if which and run not in which and told.get("mission") not in which:
            return
        name = f"{run}: {told['mission']} on {told['robot']}" if told else f"{run}: a run that does not answer"
        simulated = f" (simulated, {told['simulated']})" if told.get("simulated") else ""
        try:
            words = [_done(link, command, by) for command in commands]
        except (OSError, ValueError) as error:
            if not any(command["do"] == "stop" for command in commands):
                said[path] = False, f"{name}: {error}"
                return
            os.kill(link.process, signal.SIGTERM)  # which its watchdog hears, whatever hangs
            said[path] = False, f"{name}: does not answer ({error}); SIGTERM was sent, which ends it"
            return
        said[path] = all(good for good, _ in words), f"{name}{simulated}" + "".join(f": {each}" for _, each in words)


def _done(link: sockets.RunLink, command: Mapping[str, object], by: str) -> tuple[bool, str]:
    """Have one thing done, and say what came of it. Raises OSError where nobody answers."""
    if command["do"] == "release":
        command = {**command, "stop": _last_stop(link)}
    answer = link.ask({**command, "by": by})
    if not answer["ok"]:
        return False, str(answer["message"])
    result: Mapping[str, Any] = answer.get("result") or {}
    parts = ", ".join(result.get("parts", ()))
    words = {
        "stop": f"stopped ({parts or 'it has nothing that moves'})",
        "halt": "is being ended",
        "release": "released, and paused",
        "resume": "goes on",
    }
    return True, words[str(command["do"])]


def _last_stop(link: sockets.RunLink) -> int:
    """Return the number of the last stop of a run."""
    link.connection.sendall(b'{"do": "watch"}\n')
    while (told := link.hear()).get("say") != "scene":
        pass
    return int(told["state"]["stops"])
