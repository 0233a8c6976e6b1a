"""The bad network of other tests: what TCP promises, it keeps."""

import asyncio
from itertools import count

from tests.missions.studio.lossy import SEGMENT, Lossy


def test_data_behind_a_lost_segment_arrives_in_order() -> None:
    sent = b"".join(bytes([number]) * SEGMENT for number in range(60))
    segments = count()

    async def work() -> bytes:
        heard, whole = bytearray(), asyncio.Event()

        async def listen(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            while piece := await reader.read(SEGMENT):
                heard.extend(piece)
            writer.close()
            whole.set()

        target = await asyncio.start_server(listen, "127.0.0.1", 0)
        network = Lossy(target.sockets[0].getsockname()[1], 0.02, lambda _, up: up and next(segments) == 0)
        async with target, await network.serve():
            reader, writer = await asyncio.open_connection("127.0.0.1", network.port)
            writer.write(sent)
            writer.write_eof()
            await whole.wait()
            writer.close()
            await reader.read()
        return bytes(heard)

    assert asyncio.run(asyncio.wait_for(work(), 20.0)) == sent
