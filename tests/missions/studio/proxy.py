"""Proxies on threads of their own: one that speaks TLS, as people put one before the studio, and one that decrypts."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from ssl import SSLContext

from tests.missions.studio.lossy import served

TOLD = b"\r\nX-Forwarded-For: 203.0.113.9\r\nX-Forwarded-Proto: https\r\nX-Real-IP: 203.0.113.9\r\n"


async def _meet(target: int, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Ask the target for what somebody asks for: one request for each connection, or a websocket."""
    there, back = await asyncio.open_connection("127.0.0.1", target)
    try:
        request, _, headers = (await reader.readuntil(b"\r\n\r\n")).partition(b"\r\n")
        back.write(request + TOLD + headers)
        with suppress(OSError):
            await asyncio.gather(_pass(reader, back), _pass(there, writer))
    finally:
        for end in (back, writer):
            end.transport.abort()


async def _pass(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
    while data := await source.read(1 << 16):
        sink.write(data)
        await sink.drain()
    sink.close()


@contextmanager
def proxy(target: int, speaks: SSLContext) -> Iterator[int]:
    """Have one before a port of this computer until the end of the block; give its own port."""
    with served(partial(asyncio.start_server, partial(_meet, target), "127.0.0.1", 0, ssl=speaks)) as server:
        yield int(server.sockets[0].getsockname()[1])


@contextmanager
def plain_port(target: int, trusting: SSLContext, server_name: str = "127.0.0.1") -> Iterator[int]:
    """Serve a port that forwards plain text to the TLS port ``target``; give its number.

    ``websockets.sync`` needs it: it reads and writes on two threads, while OpenSSL allows one at a time for each
    connection. Python has no lock for that: the process aborts, or a request is never sent (CPython issue 151508).
    """

    async def forward(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        back = None
        try:
            with suppress(OSError):
                there, back = await asyncio.open_connection(
                    "127.0.0.1", target, ssl=trusting, server_hostname=server_name
                )
                await asyncio.gather(_pass(reader, back), _pass(there, writer))
        finally:
            for end in (back, writer):
                if end is not None:
                    end.transport.abort()

    with served(partial(asyncio.start_server, forward, "127.0.0.1", 0)) as server:
        yield int(server.sockets[0].getsockname()[1])
