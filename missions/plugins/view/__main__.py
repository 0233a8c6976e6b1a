"""View process: ``python -m missions.plugins.view FD``, with FD its end of a socket to the run."""

import asyncio
import json
import signal
import socket
import sys
from io import TextIOWrapper

from drivers.clock import SystemClock
from missions.plugins.view.app import ViewApp

MAX_MESSAGE_SIZE = 1 << 26
"""Maximum bytes of a message from the run: the drawing of the largest allowed mission."""


def main() -> None:
    """Show the run on the terminal until it ends."""
    # A Ctrl-C before the terminal is raw is for the run, not for this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    plain = "utf" not in sys.stderr.encoding.lower()
    if plain and isinstance(sys.stderr, TextIOWrapper):
        sys.stderr.reconfigure(errors="replace")  # escape codes instead would make lines longer
    with socket.socket(fileno=int(sys.argv[1])) as run:
        asyncio.run(run_view(run, plain=plain))


async def run_view(run: socket.socket, *, plain: bool) -> None:
    """Show the messages from ``run`` until it closes the socket."""
    reader, writer = await asyncio.open_connection(sock=run, limit=MAX_MESSAGE_SIZE)

    def send(order: str) -> None:
        writer.write(json.dumps({"do": order}).encode() + b"\n")

    # Mouse reports would flood the line; and without them, text can be selected as usual.
    await ViewApp(reader, send, SystemClock(), plain=plain).run_async(mouse=False)
    writer.close()


if __name__ == "__main__":
    main()
