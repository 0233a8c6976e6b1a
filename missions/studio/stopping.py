"""Every run of this machine stopped, or released, at once; and each command that moves a robot and is no run ended."""

import os
import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread
from typing import Any

from missions.studio import sockets
from missions.studio.holders import END_TIME, Holder, commands, holder_of
from missions.studio.sockets import linked

Said = dict[object, tuple[bool, str]]
"""What came of each that was asked: whether it is good, and the words for people."""


def ask_all(
    asked: Sequence[Mapping[str, object]], by: str, which: Sequence[str] = (), *, only: Sequence[Path] | None = None
) -> Said:
    """Ask all runs, or those of ``which``, one thing after another; return what came of it, within a second or so.

    Where a stop is asked for, commands that have no latch are ended too; where nothing is, all are listed. With
    ``only``, it is the runs of these sockets alone.
    """
    released = any(command["do"] in ("release", "resume") for command in asked)
    # What was ended is not there to be released. Who has no socket is looked for first: a run may get one meanwhile.
    others = [] if released or only is not None else [each for each in commands() if _meant(each, which)]
    found = sockets.sockets() if only is None else only
    said: Said = {}
    work = [Thread(target=_ask, args=(path, which, asked, by, said)) for path in found]
    work += [Thread(target=_end, args=(each, by, said), kwargs={"only_list": not asked}) for each in others]
    for thread in work:  # all at the same time: one that hangs holds up no other
        thread.start()
    for thread in work:
        thread.join()
    return said


def _ask(
    path: Path,
    which: Sequence[str],
    commands: Sequence[Mapping[str, object]],
    by: str,
    said: dict[object, tuple[bool, str]],
) -> None:
    """Ask a run, if it is meant, to do something, and note what came of it."""
    run = sockets.run_of(path)
    about = holder_of(int(run)) if run.isdecimal() else None
    if about is not None and not _meant(about, which):
        return
    with suppress(ConnectionRefusedError, FileNotFoundError), _hung(path, about, commands, said), linked(path) as link:
        told = link.told
        if about is None and which and {run, str(link.process), told.get("mission")}.isdisjoint(which):
            return
        if not told and not commands:
            raise TimeoutError("it does not answer")
        words = [_done(link, command, by) for command in commands]
        if told:
            about = Holder(link.process, told["mission"], told["robot"], told["simulated"])
        name = f"{run}: a run" if about is None else about.words
        said[path] = all(good for good, _ in words), name + "".join(f": {each}" for _, each in words)


@contextmanager
def _hung(
    path: Path, about: Holder | None, commands: Sequence[Mapping[str, object]], said: dict[object, tuple[bool, str]]
) -> Iterator[None]:
    """Note of a run that does not answer meanwhile what it is and what to type next; end it, if it was to stop."""
    try:
        yield
    except (ConnectionRefusedError, FileNotFoundError):
        raise  # nobody is there any more
    except (OSError, ValueError) as error:
        run = sockets.run_of(path)
        name = f"{run}: a run" if about is None else about.words
        next_step = f"`mission stop {run}` ends it"
        if any(command["do"] == "stop" for command in commands):
            with suppress(ProcessLookupError, ValueError):
                os.kill(sockets.process_in(run), signal.SIGTERM)  # which its watchdog hears, whatever hangs
            next_step = "SIGTERM was sent, which ends it"
        process = run.partition("-")[0]
        more = f"if process {process} is there still: kill -9 {process}"
        said[path] = False, f"{name}: hangs ({error}); {next_step}\n  try: {more}"


def _meant(holder: Holder, which: Sequence[str]) -> bool:
    """Say whether one is among those named: by its number, its name, or the first word of that."""
    names = {str(holder.process), holder.name, *holder.name.split()[:1]}
    return not which or not names.isdisjoint(which)


def _end(holder: Holder, by: str, said: dict[object, tuple[bool, str]], *, only_list: bool) -> None:
    """End a command that holds a robot, and note what came of it."""
    if only_list:
        said[holder] = True, holder.words
    elif holder.end(by):
        said[holder] = True, f"{holder.words}: ended, with what it moved at rest"
    else:
        more = f"if process {holder.process} is there still: kill -9 {holder.process}"
        said[holder] = False, f"{holder.words}: hangs (SIGTERM did not end it in {END_TIME:g} s)\n  try: {more}"


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
