"""Web server of the studio: its socket, request time limits, TLS certificate, routes, and shutdown.

No self-signed certificate is made; the user provides one.
"""

import asyncio
import signal
import socket
import ssl
import sys
from collections.abc import AsyncIterator, Callable, Collection, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket
from uvicorn.config import STARTUP_FAILURE
from uvicorn.protocols.http.h11_impl import H11Protocol

from missions.control.commands import MAX_REFUSED_BYTES, BadMessage
from missions.library.folders import state_folder
from missions.plugins.records.retention import list_records, studio_records_folder
from missions.plugins.studio.access import StudioAccess
from missions.plugins.studio.audit_log import AuditLog
from missions.plugins.studio.auth_gate import MEDIA_TYPES, AuthGate
from missions.plugins.studio.client_session import ClientSession
from missions.plugins.studio.connections import ClientConnection, ConnectionAcceptor
from missions.plugins.studio.file_reader import FileReader
from missions.plugins.studio.run_launcher import RunLauncher
from missions.plugins.studio.studio import PAGE_FOLDER, Studio, page_edition

# Routes behind the authentication: the page, the websocket, and records as files and reports.

MAX_CLIENTS = 96
"""Maximum number of websockets to the studio. Each open page uses three of them."""

CLOSE_TRY_LATER = 1013
"""Websocket close code if there is no room for a client."""

VERSION_MARK = 'name="version" content=""'
"""Text in the studio's page that is replaced with the page's version."""

REPORT_POLICY = "sandbox allow-scripts; frame-ancestors 'none'"
"""Content security policy of a report: its own inline script in an opaque origin.

The browser treats a report as a page of another site. So no content of a record can use the cookie or the websocket of
the studio.
"""

MakeStudio = Callable[[], Studio]


def application(make: MakeStudio, access: StudioAccess, *, hosts: Collection[str]) -> ASGIApp:
    """Return the studio as an ASGI application; ``make`` creates the state of the studio when the event loop runs.

    ``hosts`` are the host names under which the studio is reached.
    """

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        studio = app.state.studio = make()
        try:
            async with studio.hub:
                yield
        finally:
            studio.fleet.close()

    return AuthGate(Starlette(routes=routes(), lifespan=lifespan), access, hosts)


def routes() -> list[BaseRoute]:
    """Return all routes of the studio's web server."""
    return [
        WebSocketRoute("/ws", serve_websocket),
        Route("/", serve_page),
        Route("/records/{name}", serve_record),
        Route("/reports/{name}", serve_report),
        Route("/{name}", serve_asset),
    ]


async def serve_websocket(socket: WebSocket) -> None:
    """Serve a client of the studio over its websocket."""
    studio: Studio = socket.app.state.studio
    if studio.client_count >= MAX_CLIENTS:
        await socket.close(CLOSE_TRY_LATER)
        return
    role, sign_in = socket.scope["role"], socket.scope.get("sign_in")
    await ClientSession(socket, role, studio.next_client_name(role), studio, sign_in=sign_in).run()


async def serve_page(request: Request) -> Response:
    """Serve the studio's page with its version inserted."""
    del request
    try:
        text = (PAGE_FOLDER / "index.html").read_text(encoding="utf-8")
    except OSError as error:
        raise HTTPException(503, "the page is missing: reinstall MissionTree") from error
    return HTMLResponse(
        text.replace(VERSION_MARK, f'name="version" content="{page_edition()}"'), headers=_revalidate_header()
    )


async def serve_asset(request: Request) -> Response:
    """Serve a file of the studio's page, such as a script or a style sheet."""
    name = request.path_params["name"]
    if name == "index.html":
        return await serve_page(request)
    path = next((each for each in PAGE_FOLDER.iterdir() if each.name == name), None)
    if path is None or path.suffix not in MEDIA_TYPES or not path.is_file():
        raise HTTPException(404)
    return FileResponse(path, media_type=MEDIA_TYPES[path.suffix], headers=_revalidate_header())


async def serve_record(request: Request) -> Response:
    """Serve a record as a download."""
    found = _record(request)
    _log_download(request, "download", "ok")
    return FileResponse(found, media_type="application/octet-stream", filename=found.name)


async def serve_report(request: Request) -> Response:
    """Serve the report of a record, as `mission record report` writes it."""
    studio: Studio = request.app.state.studio
    try:
        text = await studio.report(_record(request).name)
    except BadMessage as error:
        _log_download(request, "report", error.error)
        return PlainTextResponse(f"{error}\n" + (f"  try: {error.hint}\n" if error.hint else ""), 422)
    _log_download(request, "report", "ok")
    return HTMLResponse(text, headers={"Content-Security-Policy": REPORT_POLICY})


def _record(request: Request) -> Path:
    """Return the path of the requested record. Operators only: records contain pictures."""
    if request.scope["role"] != "operator":
        raise HTTPException(403)
    try:
        found = next(
            (path for path in list_records(studio_records_folder()) if path.name == request.path_params["name"]), None
        )
    except OSError as error:
        raise HTTPException(503, f"{studio_records_folder()}: {error.strerror}") from error
    if found is None:
        raise HTTPException(404)
    return found


def _log_download(request: Request, word: str, outcome: str) -> None:
    role, name = request.scope["role"], request.path_params["name"]
    request.app.state.studio.audit.write(role, role, {"do": word, "name": name}, outcome)


def _revalidate_header() -> dict[str, str]:
    """Return the header that makes a browser ask at each visit whether the page has changed."""
    return {"Cache-Control": "no-cache"}


REQUEST_TIMEOUT = 5.0
"""Seconds within which a request must be complete."""

MAX_PENDING_ACCEPTS = 1024
"""Maximum number of connections that wait to be accepted; beyond that, the client retries after about 1 s."""

PING_INTERVAL = 5.0
"""Seconds between two websocket pings, and the time limit for the answer."""

SEND_BUFFER_BYTES = 1 << 17
"""Size of the kernel's send buffer of a client in bytes; small, since data that waits there becomes outdated."""

MAX_HEADER_BYTES = 16 * 1024
"""Maximum size of the headers of a request in bytes."""


@dataclass(frozen=True, slots=True)
class StudioAddress:
    """Address and settings of the studio's server. ``names`` are its host names; ``certificate`` and ``key`` PEM files.

    ``leash`` is the file descriptor of a pipe, or None: the server ends when the other end of the pipe is closed.
    """

    host: str = "127.0.0.1"
    port: int = 8642
    names: Collection[str] = ()
    certificate: Path | None = None
    key: Path | None = None
    record: bool = True
    access: StudioAccess = field(default_factory=StudioAccess)
    leash: int | None = None

    @property
    def scheme(self) -> str:
        """URL scheme: http or https."""
        return "http" if self.certificate is None else "https"

    def link(self, token: str, port: int | None = None) -> str:
        """Return the link that signs in with ``token``; ``port`` replaces the configured port if it is given."""
        host = local_address() if self.host in ("0.0.0.0", "::") else self.host  # noqa: S104 - compared, not bound
        named = f"[{host}]" if ":" in host else host
        return f"{self.scheme}://{named}:{port or self.port}/?token={token}"


class TimedProtocol(H11Protocol):
    """HTTP connection that is closed if a request does not arrive in time."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.app_state["visit"].transport = transport
        self._start_timeout()

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the timer at once: during a flood, it would hold thousands of closed connections."""
        self._timeout.cancel()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """Restart the timer, within which the next request on this connection must arrive."""
        self.scope = None  # type: ignore[assignment]
        self._timeout.cancel()
        super().on_response_complete()
        self._start_timeout()

    def _start_timeout(self) -> None:
        self._timeout = self.loop.call_later(REQUEST_TIMEOUT, self._check_timeout)

    def _check_timeout(self) -> None:
        if getattr(self, "scope", None) is None and not self.transport.is_closing():
            self.transport.abort()


class StudioServer(uvicorn.Server):
    """uvicorn server that accepts with ``ConnectionAcceptor`` and that SIGINT and SIGTERM shut down."""

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await self.lifespan.startup()
        if self.lifespan.should_exit:
            sys.exit(STARTUP_FAILURE)

        def protocol(visit: ClientConnection) -> asyncio.Protocol:
            return TimedProtocol(self.config, self.server_state, {**self.lifespan.state, "visit": visit})

        doors: Any = ConnectionAcceptor(protocol, self.config.ssl)
        for each in sockets or ():
            doors.open(each)
        self.servers = [doors]
        self.started = True

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Shut the server down at SIGINT, SIGTERM or SIGHUP while the context is entered."""
        loop, numbers = asyncio.get_running_loop(), (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        for number in numbers:
            loop.add_signal_handler(number, self.end)
        try:
            yield
        finally:
            for number in numbers:
                loop.remove_signal_handler(number)

    def end(self) -> None:
        """Request the shutdown of the server; returns at once."""
        self.should_exit = True


def open_listener(address: StudioAddress) -> socket.socket:
    """Return the listening socket of an address. Raises OSError."""
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    found = socket.socket(family)
    try:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        found.setsockopt(
            socket.IPPROTO_TCP, socket.TCP_NODELAY, 1
        )  # Nagle's algorithm would delay an answer after a message by 40 ms
        found.bind((address.host, address.port))
        found.listen(MAX_PENDING_ACCEPTS)  # at once: two sockets that do not listen yet can bind the same port
    except BaseException:
        found.close()
        raise
    return found


def uvicorn_config(address: StudioAddress, make: Any) -> uvicorn.Config:
    """Return the configuration of uvicorn; ``make`` creates the state of the studio.

    Raises ssl.SSLError or OSError for an invalid certificate.
    """
    app = application(make, address.access, hosts=address.names)
    secure: dict[str, Any] = {}
    if address.certificate is not None:
        secure = {"ssl_certfile": address.certificate, "ssl_keyfile": address.key or address.certificate}
        ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(
            address.certificate, address.key or address.certificate
        )
    return uvicorn.Config(
        app,
        http="h11",
        ws="websockets-sansio",
        ws_max_size=MAX_REFUSED_BYTES,
        ws_max_queue=16,
        ws_ping_interval=PING_INTERVAL,
        ws_ping_timeout=PING_INTERVAL,
        ws_per_message_deflate=False,
        h11_max_incomplete_event_size=MAX_HEADER_BYTES,
        proxy_headers=False,  # a client can forge the forwarding headers
        server_header=False,
        access_log=False,  # the links have tokens in them
        log_config=None,
        log_level="critical",
        timeout_graceful_shutdown=2,
        lifespan="on",
        **secure,
    )


def serve(address: StudioAddress, sockets: Sequence[socket.socket], on_started: Any) -> list[int]:
    """Serve the studio on the listening ``sockets`` until a signal; call ``on_started`` when it is ready.

    Return the process ids of the runs that were started from the studio and go on.
    """
    launcher = RunLauncher(record=address.record)
    reader = FileReader()
    server = StudioServer(
        uvicorn_config(
            address, lambda: Studio(AuditLog(state_folder() / "studio.log"), launcher, reader, address.access)
        )
    )

    async def work() -> None:
        task = asyncio.create_task(server.serve(list(sockets)))
        if address.leash is not None:
            asyncio.get_running_loop().add_reader(address.leash, server.end)
        while not server.started and not task.done():
            await asyncio.sleep(0.01)
        if server.started:
            on_started()
        await task

    try:
        asyncio.run(work())
    finally:
        reader.close()
    return launcher.running


def local_address() -> str:
    """Return this computer's address in the network; the loopback address without a network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # UDP connect sends nothing; it only selects the local address
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])
