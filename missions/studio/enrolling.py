"""Letting the robot know somebody from what the camera of a run sees: by `mission person add`, and by its rules."""

import asyncio
import base64
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from config.library import shipped
from missions.library.people import PeopleError, proper_name
from missions.studio.commands import Watch
from missions.studio.form import BadMessage
from missions.studio.watching import Hearer, Watching
from missions.studio.wishes import AddPerson, ShowPerson

COUNT = 6
"""Pictures that are taken."""

EVERY = 0.8
"""Seconds from one to the next: time to turn one's head a little."""

PATIENCE = 30.0
"""Seconds that the pictures may take, and as many that `mission person add` may."""


async def add_person(
    command: AddPerson, shown: Sequence[bytes], watching: Watching | None = None, robot: str = ""
) -> Mapping[str, object]:
    """Answer `add_person`: with the people of the ``robot``, where it is one of the library, else the user's."""
    try:
        proper_name(command.name)  # what cannot be one is said before anybody poses
    except PeopleError as error:
        raise BadMessage("no_person", str(error), error.hint) from error
    pictures = shown if watching is None else await _pictures(watching)
    if not pictures:
        raise BadMessage("no_person", "nobody was added: no picture was handed over", "show_person")
    with TemporaryDirectory(prefix="person-") as folder:
        files = [Path(folder, f"{number}.jpg") for number in range(1, len(pictures) + 1)]
        for file, picture in zip(files, pictures, strict=True):
            file.write_bytes(picture)
        words = ["--robot", robot] if robot in shipped("robots") else []
        said = await asyncio.to_thread(_add, *words, "--", command.name, *map(str, files))
    return {"message": said}


def picture_in(command: ShowPerson) -> bytes:
    """Return the picture that somebody hands over. Raises BadMessage; what is in it `mission person add` finds out."""
    try:
        return base64.b64decode(command.jpeg, validate=True)
    except ValueError as error:
        raise BadMessage("bad_field", f"'jpeg' is no base64: {error}") from error


async def _pictures(watching: Watching) -> list[bytes]:
    """Take pictures of who stands before the camera of a run. Raises BadMessage where it shows none."""
    hearer, taken, last = Hearer(watching), list[bytes](), -EVERY
    try:
        async with asyncio.timeout(PATIENCE):
            await watching.watch(hearer, Watch(state=False, pictures=1 / EVERY))
            async for line in hearer.lines():
                told = json.loads(line)
                if told["say"] != "picture":
                    continue
                watching.seen(hearer, told["t"])
                if told["t"] - last < EVERY:
                    continue
                last = told["t"]
                taken.append(base64.b64decode(told["jpeg"]))
                if len(taken) == COUNT:
                    return taken
    except TimeoutError:
        pass
    finally:
        watching.leave(hearer)
    why = f"the camera of run {watching.run} has shown {len(taken)} pictures, and it takes {COUNT}"
    raise BadMessage(
        "no_person", f"nobody was added: {why}", "a mission that uses the camera, such as by_hand/drive_and_look"
    )


def _add(*words: str) -> str:
    """Run `mission person add`, and return what it says. Raises BadMessage with its own words where it refuses."""
    done = subprocess.run(  # noqa: S603 - ourselves
        [sys.executable, "-m", "missions", "person", "add", *words],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    if done.returncode:
        raise BadMessage("no_person", done.stderr.strip()[-4000:] or f"it ended with exit code {done.returncode}")
    return "\n".join(filter(None, [done.stdout.strip(), done.stderr.strip()]))
