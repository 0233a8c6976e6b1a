"""A reverse proxy as people put one before the studio: it speaks TLS, and tells in headers whom it asks for."""

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
